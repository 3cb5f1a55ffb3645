"""Verdicts on made-up numbers whose answer is known."""

import numpy as np
import pytest
from claims import Outcome, power, verdicts
from measures import course
from studies import Claim, Runs, Table

RNG = np.random.default_rng(1)
CLAIM = Claim(says="A beats B", item="table 1", column="error", lower="A", than="B")
BASE, NOISE = RNG.uniform(1, 2, 10), np.exp(RNG.normal(0, 0.1, 10))
HALF = Table(title="", columns=("error",), article={"A": (1.0,), "B": (2.0,)})
TWICE = Table(title="", columns=("error",), article={"A": (2.0,), "B": (1.0,)})
HOLDS, OPPOSITE, EXCLUDED, UNDECIDED = Outcome
EQUAL = Claim(
    says="A is as good as B",
    item="table 1",
    column="error",
    lower="A",
    than="B",
    equal=True,
)
OF_ONE = Claim(says="A is below 2", item="table 1", column="error", lower="A", below=2)


def rows(**measures) -> Runs:
    """One run of A and B with each seed; a measure is a pair of their values."""
    made = [
        {"cell": c, "seed": s + 1}
        for c in "AB"
        for s in range(len(next(iter(measures.values()))[0]))
    ]
    for name, pair in measures.items():
        for run, value in zip(made, np.concatenate(pair), strict=True):
            run[name] = float(value)
    return made


@pytest.mark.parametrize(
    ("claim", "a", "b", "printed", "outcome"),
    [
        (CLAIM, BASE, 2 * BASE * NOISE, True, HOLDS),  # an effect of the article's size
        (CLAIM, 2 * BASE * NOISE, BASE, True, OPPOSITE),
        (CLAIM, BASE, BASE * NOISE, True, EXCLUDED),  # none
        # no halving, where the article prints nothing
        (CLAIM, BASE, BASE * NOISE, False, EXCLUDED),
        (CLAIM, BASE[:2], 2 * BASE[:2] * NOISE[:2], True, UNDECIDED),  # too few seeds
        (CLAIM, BASE, BASE * NOISE**40, True, UNDECIDED),  # too much noise
        (CLAIM, BASE, BASE, True, EXCLUDED),  # the same runs
        (EQUAL, BASE, BASE * NOISE, False, HOLDS),
        (EQUAL, BASE, 2 * BASE * NOISE, False, OPPOSITE),
        (EQUAL, BASE, BASE * NOISE**8, False, UNDECIDED),
        (OF_ONE, 1.2 * NOISE, BASE, False, HOLDS),
        (OF_ONE, 2.8 * NOISE, BASE, False, OPPOSITE),
        (OF_ONE, 2.0 * NOISE, BASE, False, EXCLUDED),
    ],
)
def test_the_answer_is_the_known_one(claim, a, b, printed: bool, outcome: Outcome):
    (verdict,) = verdicts([claim], rows(error=(a, b)), [HALF] if printed else [])
    assert verdict.outcome is outcome
    assert verdict.printed == (0.5 if printed else None)
    ratio = a / b if claim.than else a
    assert verdict.ratio == pytest.approx(np.exp(np.mean(np.log(ratio)))) or len(a) < 3


def test_a_printed_ratio_against_the_claim_is_no_effect_that_could_be_excluded():
    (verdict,) = verdicts([CLAIM], rows(error=(0.7 * BASE, BASE * NOISE**20)), [TWICE])
    assert verdict.interval[1] < 2  # without what is printed
    assert (verdict.printed, verdict.outcome) == (2.0, UNDECIDED)


def test_only_seeds_that_both_cells_have_are_compared():
    made = rows(error=(np.arange(1.0, 9.0), np.arange(1.0, 9.0) + 1))
    made[0] = {"cell": "A", "seed": 1, "failed": "diverged"}
    made[-1]["error"] = np.nan
    (verdict,) = verdicts([CLAIM], made, [])
    assert verdict.seeds == 6


@pytest.fixture
def no_power(monkeypatch: pytest.MonkeyPatch) -> None:
    """How many seeds would be enough takes a verdict most of its time, and is no part of
    its outcome."""
    monkeypatch.setattr("claims.power", lambda *_: 1.0)


@pytest.mark.usefixtures("no_power")
def test_claims_of_an_item_are_wrong_together_in_one_of_twenty_studies():
    claims, wrong = (
        [CLAIM.model_copy(update={"says": f"{i}", "column": f"{i}"}) for i in range(4)],
        0,
    )
    for _ in range(300):  # no effect
        made = rows(**{f"{i}": np.exp(RNG.normal(size=(2, 10))) for i in range(4)})
        wrong += any(v.outcome in (HOLDS, OPPOSITE) for v in verdicts(claims, made, []))
    assert wrong <= 0.08 * 300


def test_holm_asks_less_of_the_next_claim_once_one_is_decided():
    sure, open_still = (
        CLAIM.model_copy(update={"says": s, "column": s}) for s in ("sure", "open")
    )
    made = rows(sure=(BASE, 2 * BASE * NOISE), open=(BASE, BASE * NOISE))
    (alone,) = verdicts([open_still], made, [])
    after, decided = verdicts([open_still, sure], made, [])
    assert decided.outcome is HOLDS
    assert after.interval == pytest.approx(alone.interval)
    both = verdicts(
        [open_still, open_still.model_copy(update={"says": "again"})], made, []
    )
    assert (
        both[0].interval[0]
        < alone.interval[0]
        < alone.interval[1]
        < both[0].interval[1]
    )


@pytest.mark.usefixtures("no_power")
@pytest.mark.parametrize(
    ("effect", "deviation", "seeds"), [(np.log(0.5), 0.8, 12), (0.0, 0.2, 12)]
)
def test_the_power_is_how_often_such_seeds_decide(
    effect: float, deviation: float, seeds: int
):
    claim, found = CLAIM if effect else EQUAL, 0
    for _ in range(400):
        a = np.exp(RNG.normal(effect, deviation, seeds))
        found += (
            verdicts([claim], rows(error=(a, np.ones(seeds))), [])[0].outcome is HOLDS
        )
    assert power(effect, deviation, seeds, 0.05) == pytest.approx(found / 400, abs=0.08)


def test_a_search_has_converged_when_a_twentieth_of_the_descent_is_left():
    history = [[1, 6, None], [2, 9, 11.0], [3, 12, 1.6], [4, 15, 1.5], [5, 18, 1.0]]
    assert course(history) == {
        "generations": 4,
        "objective at half": 1.6,
        "history": "nan 11 1.6 1.5 1",
    }
    assert course([[1, 6, 2.0]])["generations"] == 1
