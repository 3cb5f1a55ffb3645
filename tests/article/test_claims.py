"""Verdicts on made-up numbers whose answer is known."""

import numpy as np
import pytest
from claims import Outcome, verdicts
from measures import generations_to_converge
from studies import Claim, Table

from hydroid.studies import Row

RNG = np.random.default_rng(1)
CLAIM = Claim(says="A beats B", item="table 1", column="error", lower="A", than="B")
BASE, NOISE = RNG.uniform(1, 2, 10), np.exp(RNG.normal(0, 0.1, 10))
HALF = Table(title="", columns=("error",), article={"A": (1.0,), "B": (2.0,)})


def rows(a, b) -> list[Row]:
    cells = [("A", i, v) for i, v in enumerate(a, 1)] + [("B", i, v) for i, v in enumerate(b, 1)]
    return [Row(cell, seed, {"error": float(v)}) for cell, seed, v in cells]


@pytest.mark.parametrize(
    ("a", "b", "printed", "outcome"),
    [
        (BASE, 2 * BASE * NOISE, True, Outcome.HOLDS),  # an effect of the article's size
        (2 * BASE * NOISE, BASE, True, Outcome.OPPOSITE),
        (BASE, BASE * NOISE, True, Outcome.EXCLUDED),  # none
        (BASE, BASE * NOISE, False, Outcome.UNDECIDED),
        (BASE[:2], 2 * BASE[:2] * NOISE[:2], True, Outcome.UNDECIDED),  # too few seeds
        (BASE, BASE * NOISE**40, True, Outcome.UNDECIDED),  # too much noise
    ],
)
def test_the_answer_is_the_known_one(a, b, printed: bool, outcome: Outcome):
    (verdict,) = verdicts([CLAIM], rows(a, b), [HALF] if printed else [])
    assert verdict.outcome is outcome
    assert verdict.printed == (0.5 if printed else None)
    assert verdict.ratio == pytest.approx(np.exp(np.mean(np.log(a / b)))) or len(a) < 3


def test_only_seeds_that_both_cells_have_are_compared():
    made = rows(np.arange(1.0, 9.0), np.arange(1.0, 9.0) + 1)
    made[0] = Row("A", 1, {}, "diverged")
    made[-1] = Row("B", 8, {"error": float("nan")})
    (verdict,) = verdicts([CLAIM], made, [])
    assert verdict.seeds == 6


def test_the_intervals_of_an_item_cover_together():
    claims, wrong = [CLAIM] * 4, 0
    for _ in range(300):  # no effect: one of four claims seems to have one in 5 % of the studies, at most
        made = verdicts(claims, rows(np.exp(RNG.normal(size=10)), np.exp(RNG.normal(size=10))), [])
        wrong += any(v.outcome is not Outcome.UNDECIDED for v in made)
    assert wrong <= 0.05 * 300
    alone, together = (verdicts([CLAIM] * n, rows(BASE, BASE * NOISE), [])[0].interval for n in (1, 4))
    assert together[0] < alone[0] < alone[1] < together[1]


def test_a_search_has_converged_when_a_twentieth_of_the_descent_is_left():
    history = [[1, 6, None], [2, 9, 11.0], [3, 12, 1.6], [4, 15, 1.5], [5, 18, 1.0]]
    assert generations_to_converge(history) == 4
    assert generations_to_converge([[1, 6, 2.0]]) == 1
