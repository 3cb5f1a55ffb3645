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
from hydroid.reporting.moving_arm import MOST, MovingArm, moving_arm
from hydroid.reporting.response_report import MOTIONS, motion_section, motions

PROBLEM = make_problem(outputs=(2, 3), samples=400)
ARM = PROBLEM.settings.arm
LOG = replace(PROBLEM.logs[0], angle=PROBLEM.logs[0].angle * [0, 1, 1, 0, 0, 0, 0])
ERROR = 0.05 * np.sin(3 * LOG.time)[:, None] * [1, 0]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return load_model(ARM).compile()


def predicted(
    response: np.ndarray, joints: tuple[int, ...] = (2, 3), log: Log = LOG
) -> Prediction:
    return Prediction("fit", log, joints, response, {}, None)


def moved(model: mujoco.MjModel, error=ERROR, most: int = MOST) -> MovingArm:
    return moving_arm(
        model, ARM.joint_names, predicted(LOG.angle[:, [1, 2]] - error), most
    )


def picture(
    arm: MovingArm, name: str, part: int, moment: int, point: np.ndarray
) -> np.ndarray:
    """Where a point of a rigid part is drawn, as the page's script works it out."""
    view = arm.views[name]
    pose = arm.poses["measured"][part].reshape(-1, 3, 4)
    pose = pose[min(moment, len(pose) - 1)]
    axes = view.axes.reshape(-1, 2, 3)
    return (
        axes[min(moment, len(axes) - 1)] @ (pose[:, :3] @ point + pose[:, 3])
        + view.corner
    )


def test_the_last_link_is_drawn_where_mujoco_puts_it(model):
    arm = moved(model)
    root, tip = (
        int(model.joint(ARM.joint_names[2]).bodyid[0]),
        model.body(ARM.link_names[-1]).id,
    )
    moments = (0, len(arm.time) - 1)
    world, drawn = [], []
    for moment in moments:
        data = posed(model, LOG.angle[np.searchsorted(LOG.time, arm.time[moment])])
        world.append(data.xpos[tip].copy())
        own = (data.xpos[tip] - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
        drawn.append(picture(arm, "side", 2, moment, own))
    axes = arm.views["side"].axes
    assert axes.shape == (len(arm.time), 6)
    assert np.ptp(axes, axis=0) == pytest.approx(0.0, abs=1e-9)  # nothing slews
    right, down = axes[0].reshape(2, 3) @ (world[1] - world[0])
    assert drawn[1] - drawn[0] == pytest.approx([right, down], abs=1e-6)
    assert np.linalg.norm(drawn[1] - drawn[0]) > 10
    assert [*arm.views] == ["side"]


def test_the_view_from_the_side_turns_with_the_machine_and_from_above_it_stands_still(
    model,
):
    """A slew of 150 degrees: the arm stays as long in the picture as it was."""
    slew = np.radians(np.linspace(0.0, 150.0, len(LOG.time)))
    turned = replace(LOG, angle=LOG.angle * 0.0 + slew[:, None] * [1, 0, 0, 0, 0, 0, 0])
    arm = moving_arm(
        model, ARM.joint_names, predicted(turned.angle[:, [0]], (1,), turned)
    )
    last = len(arm.time) - 1
    part = len(arm.poses["measured"]) - 1
    tip = max(
        (one for one in arm.shapes if one.body == part),
        key=lambda one: np.abs(one.corners).max(),
    )
    corner = tip.corners[np.abs(tip.corners).sum(axis=1).argmax()]
    begun, ended = (picture(arm, "side", part, moment, corner) for moment in (0, last))
    assert ended == pytest.approx(begun, abs=1.0)
    above = [picture(arm, "above", part, moment, corner) for moment in (0, last)]
    assert np.linalg.norm(above[1] - above[0]) > 100
    assert len(arm.views["above"].axes) == 1
    for view in arm.views.values():
        assert sorted(view.order) == list(range(len(arm.shapes)))


def test_all_of_the_arm_stays_in_the_picture(model):
    arm = moved(model)
    for name, view in arm.views.items():
        for moment in (0, len(arm.time) // 2, len(arm.time) - 1):
            for shape in arm.shapes:
                for corner in shape.corners:
                    x, y = picture(arm, name, shape.body, moment, corner)
                    assert 0 <= x <= view.size[0]
                    assert 0 <= y <= view.size[1]


def test_a_long_log_has_few_moments_and_begins_at_the_largest_difference(model):
    arm = moved(model, most=20)
    assert 18 <= len(arm.time) <= 20
    assert (arm.time[0], arm.time[-1]) == (LOG.time[0], LOG.time[-1])
    assert (
        abs(arm.errors["shoulder"][arm.start]) == np.abs(arm.errors["shoulder"]).max()
    )


def test_the_worst_logs_are_shown_and_one_that_diverged_never():
    good = predicted(LOG.angle[:, [1, 2]])
    bad, lost = (predicted(good.response + error) for error in (0.1, np.nan))
    plots = motions(ARM, {"a.csv": good, "b.csv": lost, "c.csv": bad})
    assert [plot.row for plot in plots] == ["c.csv", "a.csv"]
    assert motions(ARM, {"b.csv": lost}) == ()
    many = motions(ARM, {str(i): good for i in range(MOTIONS + 3)})
    assert len(many) == MOTIONS
    alone = motion_section(
        ARM, {"a.csv": good, "b.csv": lost, "c.csv": bad}, "Orange: wished."
    )
    assert alone is not None
    assert [tab.button for tab in alone.tabs] == ["c.csv", "a.csv"]
    assert motion_section(ARM, {"b.csv": lost}) is None
