"""Verdicts on made-up numbers whose answer is known."""

import numpy as np
import pytest
from scipy.stats import wilcoxon

from hydroid.settings.study_shown import Claim
from hydroid.study.claims import Outcome, holm, signed_rank, verdicts
from hydroid.study.measures import Row

RNG = np.random.default_rng(1)
CLAIM = Claim(says="A beats B", column="error", lower="A", than="B")


def rows(a, b) -> list[Row]:
    cells = [("A", i, v) for i, v in enumerate(a, 1)] + [("B", i, v) for i, v in enumerate(b, 1)]
    return [Row(cell, seed, {"error": float(v)}) for cell, seed, v in cells]


def test_a_difference_on_every_seed_is_confirmed_and_its_opposite_contradicted():
    base = RNG.uniform(1, 2, 10)
    (verdict,) = verdicts([CLAIM], rows(base, base + RNG.uniform(0.1, 0.2, 10)))
    assert verdict.outcome is Outcome.CONFIRMED
    assert verdict.effect == 1.0
    assert verdict.p == pytest.approx(2 / 2**10)
    assert verdict.sentence.startswith("A beats B: confirmed (median error ")
    assert verdict.sentence.endswith("p = 0.002, effect +1.00, 10 seeds).")
    (opposite,) = verdicts([CLAIM], rows(base + RNG.uniform(0.1, 0.2, 10), base))
    assert (opposite.outcome, opposite.effect) == (Outcome.CONTRADICTED, -1.0)


def test_noise_is_not_confirmed_and_five_seeds_are_too_few():
    a, b = RNG.uniform(1, 2, (2, 10))
    (verdict,) = verdicts([CLAIM], rows(a, b))
    assert verdict.outcome is Outcome.OPEN
    (few,) = verdicts([CLAIM], rows(np.ones(5), np.full(5, 2.0)))
    assert few.outcome is Outcome.UNTESTED
    assert "5 seeds are too few" in few.sentence
    (equal,) = verdicts([CLAIM], rows(np.ones(10), np.ones(10)))
    assert (equal.outcome, equal.p, equal.effect) == (Outcome.OPEN, 1.0, 0.0)
    assert "error is the same in both, seed by seed" in equal.sentence


def test_a_claim_that_no_run_can_tell_says_why_and_takes_no_part_in_the_correction():
    silent = Claim(says="A is heavy", untested="nobody weighed it", item="")
    base = RNG.uniform(1, 2, 10)
    made = rows(base, base + RNG.uniform(0.1, 0.2, 10))
    first, second = verdicts([silent, CLAIM], made)
    assert first.sentence == "A is heavy: not tested (nobody weighed it)."
    assert second.p == verdicts([CLAIM], made)[0].p
    for wrong in (
        {"column": "error", "lower": "A"},
        {"untested": "why", "column": "e", "lower": "A", "than": "B"},
    ):
        with pytest.raises(ValueError, match="give column, lower and than; or untested"):
            Claim(says="neither or both", **wrong)


def test_only_seeds_that_both_cells_have_are_compared():
    made = rows(np.arange(8.0), np.arange(8.0) + 1)
    made[0] = Row("A", 1, {}, "diverged")
    made[-1] = Row("B", 8, {"error": float("nan")})
    (verdict,) = verdicts([CLAIM], made)
    assert verdict.seeds == 6
    assert verdict.medians == (3.5, 4.5)


def test_holm_corrects_over_all_claims_of_a_study():
    # by hand: 0.01 · 3, 0.02 · 2, 0.3 · 1; a p-value is never below that of a smaller one
    assert holm(np.array([0.3, 0.01, 0.02])) == pytest.approx([0.3, 0.03, 0.04])
    assert holm(np.array([0.03, 0.031, np.nan])) == pytest.approx([0.06, 0.06, np.nan], nan_ok=True)
    assert holm(np.array([0.6, 0.7])) == pytest.approx([1.0, 1.0])
    base = RNG.uniform(1, 2, 7)
    made = rows(base, base + 0.1)  # p = 2 / 2^7 alone
    assert verdicts([CLAIM], made)[0].outcome is Outcome.CONFIRMED
    assert verdicts([CLAIM] * 3, made)[0].outcome is Outcome.CONFIRMED
    (many, *_) = verdicts([CLAIM] * 4, made)  # 4 · 2 / 2^7 is above 0.05: no result could be significant
    assert many.outcome is Outcome.UNTESTED
    assert "7 seeds are too few for 4 claims" in many.sentence
    four = [made[i] for i in (*range(4), *range(7, 11))]
    assert "4 seeds are too few for any answer" in verdicts([CLAIM], four)[0].sentence


def test_signed_ranks_are_scipys():
    difference = RNG.normal(0.3, 1.0, 12)
    p, effect = signed_rank(difference)
    assert p == wilcoxon(difference).pvalue
    positive = np.argsort(np.argsort(np.abs(difference)))[difference > 0].sum() + (difference > 0).sum()
    assert effect == pytest.approx(2 * positive / (12 * 13 / 2) - 1)
