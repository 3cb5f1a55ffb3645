"""What joints lose beside each other is what a plant says of both at once."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import EARLY, EARLY_SETTINGS, made_model
from report_fits import make_problem

from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.reporting.shared_pump import slow_down

PUMP = {"pump_flow": 0.8, "pump_droop": 20.0}


def made(outputs=(2, 3), **hydraulics):
    changes = {"simulation.model": "quasi-static", "outputs": [*outputs]}
    return made_model(EARLY, changes, hydraulics=EARLY_SETTINGS | hydraulics)


def driven() -> Log:
    """A log with 80 % of command of the shoulder, then -60 % of the elbow."""
    log = make_problem(outputs=(2, 3), samples=400).logs[0]
    command = np.zeros_like(log.command)
    command[100:200, 1] = 80.0
    command[200:300, 2] = -60.0
    # the arm stands where its joints may
    pose = Plant(made(), joints=(2, 3)).angle
    angle = pose + np.linspace(0.0, 0.1, len(log.time))[:, None]
    return replace(log, command=command, angle=angle)


def test_a_joint_beside_another_is_as_slow_as_the_plant_says():
    model, log = made(**PUMP), driven()
    slower = slow_down(model, [log])
    assert slower is not None
    plant = Plant(model, joints=(2, 3))
    pose = log.start.copy()
    pose[1] = (log.angle[:, 1].min() + log.angle[:, 1].max()) / 2
    alone = plant.speeds({"shoulder": 80.0}, at=pose)[1]
    beside = plant.speeds({"shoulder": 80.0, "elbow": -60.0}, at=pose)[1]
    assert abs(beside) < 0.99 * abs(alone)
    first, second = slower.table.rows
    assert first[0] == "shoulder"
    assert str(first[1]).startswith("+80 %")
    speed, itself, change = first[3:]
    assert float(str(speed)) == pytest.approx(np.degrees(abs(alone)), rel=0.01)
    assert itself == ""
    lost = float(str(change).removesuffix(" %"))
    assert lost == pytest.approx(100 * (beside / alone - 1), abs=0.5)
    assert second[0] == "elbow"
    assert slower.answer == f"shoulder {change} beside another joint"


def test_joints_that_share_no_limited_pump_are_not_slower():
    log = driven()
    assert slow_down(made(), [log]) is None
    assert slow_down(made(outputs=(2,), **PUMP), [log]) is None
