"""Speeds and commands of a plant by name: what it settles to, in any pose, and why a
wish cannot be had."""

import numpy as np
import pytest
from made_models import EARLY, EARLY_SETTINGS, made_model

from hydroid.errors import SettingsError
from hydroid.plant import Limit, Plant

VALUES = EARLY | {"delay": 0.02}
MODELS = ["dynamic", "quasi-static"]
CLOSE = {"dynamic": 0.05, "quasi-static": 0.01}
"""part of a speed; the dynamic model's oil also yields to a load that changes on the
way"""


def made(model="quasi-static", joints=(2, 3), **hydraulics) -> Plant:
    changes = {"simulation.model": model}
    made = made_model(VALUES, changes, hydraulics=EARLY_SETTINGS | hydraulics)
    return Plant(made, joints=joints)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "wish", [{"shoulder": 0.06}, {"shoulder": -0.04, "elbow": 0.05}]
)
def test_the_plant_moves_as_wished_under_the_commands_for_it(model, wish):
    plant = made(model)
    middle = plant.angle
    seconds = 0.6
    back = middle.copy()
    for name, speed in wish.items():
        back[plant.names.index(name)] -= speed * seconds
    plant.reset(back)
    found = plant.commands(wish, at=middle)
    assert not found.limits
    for _ in range(round(seconds / plant.period)):
        plant.step(found.command)
    before, after = plant.angle, plant.step(found.command)
    for name, speed in wish.items():
        joint = plant.names.index(name)
        assert found.speed[joint] == pytest.approx(speed, rel=1e-4)
        assert (after - before)[joint] / plant.period == pytest.approx(
            speed, rel=CLOSE[model]
        )


@pytest.mark.parametrize("model", MODELS)
def test_speeds_and_commands_are_inverse_wherever_the_plant_stands(model):
    plant, wish = made(model), {"shoulder": 0.05, "elbow": -0.08}
    for pose in ("rig", "study", None):
        found = plant.commands(wish, at=pose)
        np.testing.assert_allclose(
            plant.speeds(found.command, at=pose), found.speed, rtol=1e-5, atol=1e-12
        )
    start = plant.angle
    assert np.array_equal(plant.reset(), start)  # asking moves nothing


def test_a_pose_by_names_leaves_the_other_joints_where_they_stand():
    plant = made()
    pose = plant.angle
    pose[plant.names.index("shoulder")] = 0.3
    by_name = plant.commands({"elbow": 0.05}, at={"shoulder": 0.3})
    assert np.array_equal(
        by_name.command, plant.commands({"elbow": 0.05}, at=pose).command
    )
    assert np.array_equal(plant.reset({"shoulder": 0.3}), pose)
    with pytest.raises(SettingsError, match="no joint knee"):
        plant.reset({"knee": 0.3})


def test_a_heavier_load_takes_more_command_to_lift():
    light = made()
    heavy = Plant(light.identified, joints=[2, 3], payload=20.0)
    up = light.speeds({"shoulder": 60})[1]
    lifts = np.sign(up) * 0.05
    commands = [
        abs(plant.commands({"shoulder": lifts}).command[1]) for plant in (light, heavy)
    ]
    lowers = [
        abs(plant.commands({"shoulder": -lifts}).command[1]) for plant in (light, heavy)
    ]
    gravity = commands[1] - commands[0], lowers[1] - lowers[0]
    assert max(gravity) > 0.1 > -0.1 > min(gravity)


def test_each_reason_why_a_wish_cannot_be_had_has_a_name():
    plant = made()
    assert plant.commands({"shoulder": 50.0}).limits == {"shoulder": Limit.FULL}
    arm = plant.identified.settings.arm
    at_stop = plant.angle
    at_stop[1] = arm.upper[1]
    stopped = plant.commands({"shoulder": 0.1}, at=at_stop)
    assert stopped.limits == {"shoulder": Limit.STOP}
    assert not stopped.command.any()
    assert not plant.commands({"shoulder": -0.05}, at=at_stop).limits
    jumps = made(onset_a=2.0, onset_b=2.0)
    assert jumps.commands({"elbow": 1e-3}).limits == {"elbow": Limit.SLOWEST}
    leaks = made("dynamic", leakage=0.02)
    assert leaks.commands({}).limits == {"shoulder": Limit.LEAKS, "elbow": Limit.LEAKS}


def test_two_joints_want_more_than_the_pump_gives():
    alone = made()
    fastest = {
        name: 0.8 * alone.speeds({name: 100})[joint]
        for name, joint in (("shoulder", 1), ("elbow", 2))
    }
    assert not alone.commands(fastest).limits
    shared = made(pump_flow=0.8, pump_droop=20.0)
    found = shared.commands(fastest)
    assert Limit.PUMP in found.limits.values()
    assert not shared.commands({"shoulder": 0.1 * fastest["shoulder"]}).limits
    late = np.abs(found.speed[[1, 2]]) < np.abs([*fastest.values()]) * 0.999
    assert late.any()


@pytest.mark.parametrize(
    ("refused", "says"),
    [
        (lambda: made().commands({"boom": 0.1}), "no joint boom"),
        (lambda: made().commands([0.1, 0.1]), "7 finite numbers"),
        (
            lambda: made().commands({"azimuth": 0.1}),
            "only shoulder, elbow take commands",
        ),
        (lambda: made().commands({"shoulder": 0.1}, at="nowhere"), "no pose 'nowhere'"),
        (lambda: made().speeds({"shoulder": np.nan}), "finite"),
        (lambda: made().speeds({"shoulder": 1.0}, at=[0.0]), "7 finite angles"),
    ],
)
def test_what_cannot_be_asked_is_refused(refused, says):
    with pytest.raises((SettingsError, ValueError), match=says):
        refused()


def test_stage_1_has_no_speeds():
    plant = Plant(made_model(VALUES, stage="mech"))
    with pytest.raises(SettingsError, match="stage 2"):
        plant.commands({"shoulder": 0.1})
