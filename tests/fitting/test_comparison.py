"""Errors compared in pairs: what differs is told, what does not is not, however many
starts overlap."""

import numpy as np
import pytest

from hydroid.fitting.comparison import BLOCK, LEAST_BLOCKS, compare, in_blocks
from hydroid.joint_verdict import Outcome

BETWEEN = 2.0


def starts(
    seed: int, size: float = 1.0, seconds: float = 75.0, ahead: float = 5.0
) -> np.ndarray:
    """How far a random walk gets in some time, from starts all along a log: what an
    integrator errs by."""
    period = 0.1
    walk = size * np.cumsum(
        np.random.default_rng(seed).normal(0, 0.01, round(seconds / period))
    )
    first = np.arange(0, len(walk) - round(ahead / period), round(BETWEEN / period))
    return walk[first + round(ahead / period)] - walk[first]


def compared(ours: list[np.ndarray], theirs: list[np.ndarray]):
    blocks = [
        [block for log in logs for block in in_blocks(log, BETWEEN)]
        for logs in (ours, theirs)
    ]
    return compare(*blocks)


@pytest.mark.parametrize("logs", [[75.0], [22.0] * 6, [60.0] * 3])
def test_of_equal_models_one_in_ten_at_most_is_called_better_or_worse(
    logs: list[float],
):
    told = 0
    for trial in range(300):
        ours = [starts(100 * trial + i, seconds=s) for i, s in enumerate(logs)]
        theirs = [starts(100 * trial + 50 + i, seconds=s) for i, s in enumerate(logs)]
        told += compared(ours, theirs).outcome is not Outcome.UNTOLD
    # two standard deviations, and somewhat more for blocks that touch
    assert told / 300 < 0.15


def test_what_errs_half_as_much_at_the_same_starts_is_better_and_the_other_way_round_worse():
    theirs = [starts(1)]
    ours = [0.5 * theirs[0]]
    better, worse = compared(ours, theirs), compared(theirs, ours)
    assert (better.outcome, worse.outcome) == (Outcome.BETTER, Outcome.WORSE)
    expected = np.degrees(1.0) ** 2 * np.mean(ours[0] ** 2 - theirs[0] ** 2)
    assert better.difference_deg2 == pytest.approx(expected)
    assert worse.difference_deg2 == pytest.approx(-expected)
    assert better.sd_deg2 == pytest.approx(worse.sd_deg2)


def test_starts_that_say_the_same_again_are_no_further_evidence():
    ours, theirs = [starts(1)], [starts(2)]
    blocks = [in_blocks(errors[0], BETWEEN) for errors in (ours, theirs)]
    once = compare(*blocks)
    again = compare(*([np.repeat(block, 7) for block in some] for some in blocks))
    assert again.sd_deg2 == pytest.approx(once.sd_deg2)
    assert again.outcome is once.outcome


def test_the_standard_error_of_independent_blocks_of_one_value_is_the_plain_one():
    rng = np.random.default_rng(1)
    ours, theirs = rng.normal(size=(2, 12, 1))
    one = compare([*ours], [*theirs])
    differences = np.degrees(1.0) ** 2 * (ours**2 - theirs**2)
    assert one.sd_deg2 == pytest.approx(np.std(differences, ddof=1) / np.sqrt(12))


def test_blocks_last_ten_seconds_and_hold_every_start_of_a_log_once():
    errors = starts(1)
    blocks = in_blocks(errors, BETWEEN)
    assert min(len(block) for block in blocks) * BETWEEN >= BLOCK
    np.testing.assert_array_equal(np.concatenate(blocks), errors)
    short = in_blocks(np.array([1.0, np.nan, 2.0]), BETWEEN)
    assert [block.tolist() for block in short] == [[1.0, 2.0]]
    assert in_blocks(np.full(3, np.nan), BETWEEN) == []


@pytest.mark.parametrize("blocks", range(LEAST_BLOCKS))
def test_few_blocks_tell_nothing(blocks: int):
    one = compare([np.array([0.001])] * blocks, [np.array([1.0])] * blocks)
    assert (one.outcome, one.blocks) == (Outcome.UNTOLD, blocks)


def test_what_diverges_is_worse_wherever_it_does():
    one = compare([np.array([0.0, np.inf])], [np.array([1.0, 1.0])])
    assert (one.outcome, one.difference_deg2) == (Outcome.WORSE, None)
