"""Steps of a fit: each has a name of its own, for its checkpoint, and leads to an
estimate by name."""

from itertools import product

import pytest

from hydroid.fitting.step import Step, step_of


def every_step() -> list[Step]:
    """Steps of all kinds that fits take."""
    terms = (), ("pump",), ("pump", "oil"), ("oil",)
    phases = "", "from afar", "at first", "on the way"
    rungs = [
        Step(model, names, phase, horizon=part)
        for model, names, phase, part in product(
            ("refined", "dynamic", "joint"), terms, phases, (0, 1, 2, 3)
        )
    ]
    starts = [
        Step("start", (), phase, start, joint, bool(joint) and numbers, horizon)
        for phase, start, joint, numbers, horizon in product(
            ("", "from afar"), (1, 2, 11), (0, 1, 2, 11), (False, True), (1, 2)
        )
    ]
    return list(dict.fromkeys([*rungs, *starts]))


def test_no_two_steps_have_the_same_name():
    steps = every_step()
    assert len({step.name for step in steps}) == len(steps)


@pytest.mark.parametrize(
    "estimate", ["refined", "dynamic+pump+oil", "joint+refined", "refined+start"]
)
def test_a_step_leads_to_the_estimate_that_it_is_named_by(estimate: str):
    step = step_of(estimate)
    assert step.estimate == estimate
    assert step.changed(joint=2, phase="on the way").estimate == estimate
    assert step.changed(model="dynamic").terms == step.terms
