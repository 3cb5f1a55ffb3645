"""The arm in motion: its parts lie in the picture where MuJoCo puts its links."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from arms import posed
from report_fits import make_problem

from hydroid.arm.model import load_model
from hydroid.fitting.validation import Prediction
from hydroid.log import Log
from hydroid.reporting.outlines import MOST, VIEW, MovingArm, motion_section, moving_arm, sight

PROBLEM = make_problem(outputs=(2, 3), samples=400)
ARM = PROBLEM.settings.arm
LOG = replace(PROBLEM.logs[0], angle=PROBLEM.logs[0].angle * [0, 1, 1, 0, 0, 0, 0])
ERROR = 0.05 * np.sin(3 * LOG.time)[:, None] * [1, 0]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return load_model(ARM).compile()


def predicted(response: np.ndarray, joints: tuple[int, ...] = (2, 3), log: Log = LOG) -> Prediction:
    return Prediction("fit", log, joints, response, {}, None)


def moved(model: mujoco.MjModel, error=ERROR, most: int = MOST) -> MovingArm:
    return moving_arm(model, ARM.joint_names, predicted(LOG.angle[:, [1, 2]] - error), most)


def test_the_last_link_is_drawn_where_mujoco_puts_it(model):
    arm = moved(model)
    root, tip = int(model.joint(ARM.joint_names[2]).bodyid[0]), model.body(ARM.link_names[-1]).id
    poses, moments = arm.poses["measured"][2].reshape(-1, 2, 4), (0, len(arm.time) - 1)
    world, drawn = [], []
    for moment in moments:
        data = posed(model, LOG.angle[np.searchsorted(LOG.time, arm.time[moment])])
        world.append(data.xpos[tip].copy())
        own = (data.xpos[tip] - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
        drawn.append(poses[moment, :, :3] @ own + poses[moment, :, 3])
    scale = np.linalg.norm(poses[0, 0, :3])
    right, up, _ = scale * sight(*VIEW) @ (world[1] - world[0])
    assert drawn[1] - drawn[0] == pytest.approx([right, -up], abs=1e-6 * scale)
    assert np.linalg.norm(drawn[1] - drawn[0]) > 10


def test_a_long_log_has_few_moments_and_begins_at_the_largest_difference(model):
    arm = moved(model, most=20)
    assert len(arm.time) == 20
    assert (arm.time[0], arm.time[-1]) == (LOG.time[0], LOG.time[-1])
    assert abs(arm.errors["shoulder"][arm.start]) == np.abs(arm.errors["shoulder"]).max()


def test_the_worst_log_is_shown_first_and_one_that_diverged_never():
    good = predicted(LOG.angle[:, [1, 2]])
    bad, lost = (predicted(good.response + error) for error in (0.1, np.nan))
    section = motion_section(ARM, {"a.csv": good, "b.csv": lost, "c.csv": bad})
    assert [tab.button for tab in section.tabs] == ["c.csv", "a.csv"]
    assert motion_section(ARM, {"b.csv": lost}) is None
