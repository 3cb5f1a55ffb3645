"""A load slows what it opposes, drives what it helps, and creeps past a shut valve that
leaks."""

import numpy as np
import pytest
from made_logs import HYDRAULIC, step_log

from hydroid import load_settings
from hydroid.posterior.bench import make_bench
from hydroid.posterior.linear import estimate_box
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.under_load import Known, UnderLoad, under_load
from hydroid.problem.bindings import Bindings

TRUE = {name: value for name, value in HYDRAULIC.items() if name not in ("F1", "x1")}


def carried(joint: int = 2, stage: str = "hyd", **changes: object) -> UnderLoad:
    """What a joint carries if each free parameter is known to 1 %."""
    own = {
        f"{group}.{name}": value
        for key, value in changes.items()
        for group, _, name in [key.partition("__")]
    }
    springs = {"parameters.S.fixed": 0.0}
    settings = load_settings(f"article-{stage}", springs | own)
    parameters = settings.parameter_set()
    theta = parameters.vector(TRUE, "test")
    box = estimate_box(parameters, theta)
    posterior = Posterior(box, 100.0 * np.eye(box.varied.sum()))
    log = step_log(settings.arm.pose("study"), {joint: [30.0, 50.0]})
    log.angle[-1, joint - 1] += 0.6  # the travel
    found = under_load(settings, posterior, [log], joint)
    bench = make_bench(settings, [log], joint)
    gravity, inertia = bench.weigh(Bindings(settings).candidates(theta[None]))
    assert (found.gravity.value, found.inertia.value) == (gravity[0], inertia[0])
    return found


def test_twice_the_load_is_slower_where_the_joint_raises_it():
    found = carried()
    by_word = {moved.word: moved for moved in found.moved}
    rises = [speed.value for speed in by_word["raising"].speeds]
    falls = [speed.value for speed in by_word["lowering"].speeds]
    assert rises == sorted(rises, reverse=True)
    assert falls == sorted(falls)
    change = by_word["raising"].change
    assert isinstance(change, Known)
    assert change.value == pytest.approx(100 * (rises[2] / rises[1] - 1))
    low, high = change.interval
    assert low is not None
    assert high is not None
    assert low < change.value < high < 0
    # the masses are fixed: no log has changed what the joint carries
    assert found.gravity.given
    assert found.inertia.given


def test_a_shut_valve_that_leaks_lets_the_joint_sink():
    gravity = carried().gravity.value
    leaks = carried(hydraulics__leakage=1e-2, hydraulics__dry_friction=0.0).shut
    tight = carried(hydraulics__leakage=0.0).shut
    assert leaks is not None
    assert tight is not None
    assert leaks.value * gravity < 0
    assert tight.value == 0.0


def test_a_joint_that_gravity_does_not_load_has_no_speeds_under_load():
    assert carried(joint=1).moved == ()


def test_no_load_changes_a_speed_that_follows_its_command_alone():
    alone = {"hydraulics__by_command": 1.0, "simulation__model": "quasi-static"}
    for moved in carried(**alone).moved:
        without, *others = (speed.value for speed in moved.speeds)
        assert without > 0.0
        assert others == [without, without]
        assert moved.change is not None
        assert moved.change.value == 0.0
