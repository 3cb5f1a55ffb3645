"""Verdicts on made-up numbers whose answer is known."""

import numpy as np
import pytest
from claims import Outcome, holm, signed_rank, verdicts
from measures import generations_to_converge
from scipy.stats import wilcoxon
from studies import Claim

from hydroid.studies.study import Row

RNG = np.random.default_rng(1)
CLAIM = Claim(says="A beats B", item="table 1", column="error", lower="A", than="B")
BASE = RNG.uniform(1, 2, 10)
MORE = BASE + RNG.uniform(0.1, 0.2, 10)


def rows(a, b) -> list[Row]:
    cells = [("A", i, v) for i, v in enumerate(a, 1)] + [("B", i, v) for i, v in enumerate(b, 1)]
    return [Row(cell, seed, {"error": float(v)}) for cell, seed, v in cells]


@pytest.mark.parametrize(
    ("a", "b", "outcome", "detail"),
    [
        (BASE, MORE, Outcome.CONFIRMED, "effect +1.00, 10 seeds"),
        (MORE, BASE, Outcome.CONTRADICTED, "effect -1.00, 10 seeds"),
        (np.ones(10), np.ones(10), Outcome.OPEN, "effect +0.00, 10 seeds"),
        (np.ones(5), np.full(5, 2.0), Outcome.UNTESTED, "too few seeds for 0 claims, 5 seeds"),
    ],
)
def test_the_answer_is_the_known_one(a, b, outcome: Outcome, detail: str):
    (verdict,) = verdicts([CLAIM], rows(a, b))
    assert verdict.outcome is outcome
    assert verdict.detail.endswith(detail)


def test_a_claim_that_no_run_can_tell_says_why_and_takes_no_part_in_the_correction():
    silent = Claim(says="A is heavy", item="table 1", untested="nobody weighed it")
    first, second = verdicts([silent, CLAIM], rows(BASE, MORE))
    assert (first.outcome, first.detail) == (Outcome.UNTESTED, "nobody weighed it")
    assert f"p = {2 / 2**10:.2g}," in second.detail


def test_only_seeds_that_both_cells_have_are_compared():
    made = rows(np.arange(8.0), np.arange(8.0) + 1)
    made[0] = Row("A", 1, {}, "diverged")
    made[-1] = Row("B", 8, {"error": float("nan")})
    (verdict,) = verdicts([CLAIM], made)
    assert verdict.detail.startswith("median error 3.5 against 4.5;")
    assert verdict.detail.endswith("6 seeds")


def test_holm_corrects_over_all_claims_of_a_study():
    # by hand: 0.01 · 3, 0.02 · 2, 0.3 · 1; a p-value is never below that of a smaller one
    assert holm(np.array([0.3, 0.01, 0.02])) == pytest.approx([0.3, 0.03, 0.04])
    assert holm(np.array([0.03, 0.031, np.nan])) == pytest.approx([0.06, 0.06, np.nan], nan_ok=True)
    made = rows(BASE[:7], BASE[:7] + 0.1)  # p = 2 / 2^7 alone
    assert verdicts([CLAIM] * 3, made)[0].outcome is Outcome.CONFIRMED
    (many, *_) = verdicts([CLAIM] * 4, made)  # 4 · 2 / 2^7 is above 0.05: no result could be significant
    assert many.outcome is Outcome.UNTESTED


def test_signed_ranks_are_scipys():
    difference = RNG.normal(0.3, 1.0, 12)
    p, effect = signed_rank(difference)
    assert p == wilcoxon(difference).pvalue
    positive = np.argsort(np.argsort(np.abs(difference)))[difference > 0].sum() + (difference > 0).sum()
    assert effect == pytest.approx(2 * positive / (12 * 13 / 2) - 1)


def test_a_search_has_converged_when_a_twentieth_of_the_descent_is_left():
    history = [[1, 6, None], [2, 9, 11.0], [3, 12, 1.6], [4, 15, 1.5], [5, 18, 1.0]]
    assert generations_to_converge(history) == 4
    assert generations_to_converge([[1, 6, 2.0]]) == 1
