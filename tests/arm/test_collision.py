"""Distances between bodies, held against MuJoCo's contacts, and against balls on
sticks."""

import mujoco
import numpy as np
import pytest
from arms import MODELS, posed

from hydroid.arm.model import CollisionChecker, Machine, load_machine
from hydroid.errors import ModelError
from hydroid.settings.arm import Arm

SWINGS = (MODELS / "swings.xml").read_text()
"""two balls on sticks of 1 m, whose hinges are 3 m apart and 2 m above the floor"""


@pytest.fixture(scope="module")
def machine(arm: Arm) -> Machine:
    return load_machine(arm, pair=True)


def sweep(arm: Arm, samples: int, seed: int = 0) -> np.ndarray:
    """From the study pose to ever larger sines through the joints' ranges [rad], shape
    (samples, 14)."""
    rng = np.random.default_rng(seed)
    low, high = (
        np.tile(np.maximum(arm.lower, -3), 2),
        np.tile(np.minimum(arm.upper, 3), 2),
    )
    part = np.linspace(0, 1, samples)[:, None]
    turned = np.sin(20 * part * rng.uniform(0.5, 2.0, 14) + rng.uniform(0, 6, 14))
    study = np.tile(arm.pose("study"), 2)
    return study + part * (0.5 * (low + high) + 0.5 * (high - low) * turned - study)


def test_bodies_meet_where_mujoco_finds_contacts(machine: Machine, arm: Arm):
    model, angle = machine.model, sweep(arm, 150)
    clearance = machine.checker.clearance(0.01 * np.arange(len(angle)), angle)
    inside = [
        posed(model, pose).contact.dist.min(initial=0.0) < -1e-6 for pose in angle
    ]
    assert 0 < sum(inside) < len(angle)
    np.testing.assert_array_equal(clearance.distance < -1e-6, inside)
    for margin in (0.0, 0.03, 0.08):
        below = np.flatnonzero(clearance.distance < margin)
        assert machine.checker.first_below(angle, margin) == next(iter(below), None)


def test_depth_and_time_of_a_meeting():
    text = SWINGS.replace('pos="3 0 2"', 'pos="2.1 0 2"')
    model = mujoco.MjModel.from_xml_string(text)
    time = np.linspace(0.0, 2.0, 201)
    # past the other ball, 0.1 m from it
    angle = np.column_stack([0.4 * (1 - time), np.zeros(201)])
    (meeting,) = CollisionChecker(model).clearance(time, angle).meetings
    assert meeting.bodies == ["first", "second"]
    assert meeting.deepest_at_s == pytest.approx(1.0)
    assert meeting.depth_m == pytest.approx(0.1)
    near = np.hypot(np.cos(angle[:, 0]) - 1.1, np.sin(angle[:, 0])) < 0.2
    assert (meeting.from_s, meeting.to_s) == pytest.approx(tuple(time[near][[0, -1]]))
    assert CollisionChecker(model).first_below(angle, 0.0) == np.argmax(near)


def test_a_model_without_shapes_is_refused():
    model = mujoco.MjModel.from_xml_string(
        SWINGS.replace("<geom", '<geom contype="0" conaffinity="0"')
    )
    with pytest.raises(ModelError, match="no two of its bodies can collide"):
        CollisionChecker(model, "swings")


def test_nothing_meets_in_a_named_pose(machine: Machine, arm: Arm):
    poses = np.array([np.tile(arm.pose(name), 2) for name in arm.poses])
    clearance = machine.checker.clearance(np.arange(len(poses), dtype=float), poses)
    assert not clearance.meetings
    excluded = {frozenset(pair) for pair in clearance.excluded}
    assert {
        frozenset({"carrier", f"{side}_link1"}) for side in ("right", "left")
    } <= excluded
