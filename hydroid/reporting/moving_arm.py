"""The arm in motion for a page: the simulated arm over the measured one, drawn from the side as outlines.

A page gets the corners of each link once, and for each moment how its rigid parts are turned and moved in the
picture. Its script (`moving_arm.js`) draws the outlines; no renderer is needed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array
from hydroid.fitting.validation import Prediction
from hydroid.reporting.outlines import Shape, body_poses, shapes, sight
from hydroid.reporting.page import Plot, Section, Tab
from hydroid.settings.arm import Arm

MOST, LOGS = 1200, 8
"""moments of all logs of a page together, and logs that it shows in motion"""
RATE = 10.0
"""moments in a second; the page draws what lies between them"""
VIEW = 112.0, -16.0
"""where a camera would look to: azimuth and elevation [deg]"""
_SIZE, _MARGIN = 1000, 30
"""longer side of the picture, and what stays free around the arm"""
_CAPTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where they differ "
    "most. Joints that are not compared follow the log."
)


@dataclass(frozen=True, eq=False)
class MovingArm:
    """An arm and how it moves, in units of the picture.

    Attributes:
        size: width and height of the picture.
        shapes: in the order in which they are drawn, each with the number of its rigid part as its body.
        time: of the moments [s], shape (F,).
        poses: `measured` and `simulated`: how each part lies in the picture, rows of the 2 × 3 turn and of
            the place, shape (parts, F, 8), or (1, 8) for one that stands still.
        errors: measured minus simulated angle by the joint's name [deg], shape (F,).
        start: number of the moment with the largest error.
    """

    size: tuple[int, int]
    shapes: list[Shape]
    time: Array
    poses: dict[str, list[Array]]
    errors: dict[str, Array]
    start: int


def motion_section(arm: Arm, predictions: Mapping[str, Prediction]) -> tuple[Section, ...]:
    """Return the section with a tab for each of the first logs, by name; none for what diverged."""
    finite = [item for item in predictions.items() if np.isfinite(item[1].response).all()][:LOGS]
    if not finite:
        return ()
    draw = partial(moving_arm, load_model(arm).compile(), arm.joint_names, most=MOST // len(finite))
    plots = (Plot(f"motion_{i}", name, partial(draw, one)) for i, (name, one) in enumerate(finite, 1))
    return (Section("The arm in motion", _CAPTION, tabs=tuple(Tab(p.caption, p) for p in plots)),)


def moving_arm(
    model: mujoco.MjModel, names: Sequence[str], prediction: Prediction, most: int = MOST
) -> MovingArm:
    """Return how an arm with joints of these names moves, at `most` moments or fewer."""
    log, compared = prediction.log, [joint - 1 for joint in prediction.joints]
    simulated = log.angle.copy()
    simulated[:, compared] = prediction.response
    error = log.angle - simulated
    moves = np.ptp(log.angle, axis=0) + np.abs(error).max(axis=0) > 1e-4  # [rad]
    moving = {0, *model.jnt_bodyid[moves].tolist()}
    roots: list[int] = []  # the body that each one turns with: itself, or one that carries it
    for body, parent in enumerate(model.body_parentid.tolist()):
        roots.append(body if body in moving else roots[parent])
    parts = sorted(set(roots))
    count = int(np.clip(RATE * np.ptp(log.time) + 1, 2, most))
    moments = np.unique(np.linspace(0, len(log.time) - 1, count).round().astype(int))
    series = {"measured": log.angle, "simulated": simulated}
    poses = {name: body_poses(model, angle[moments]) for name, angle in series.items()}

    view, start = sight(*VIEW), poses["simulated"][0]
    drawn: list[tuple[float, Shape]] = []
    for shape in shapes(model):
        world, pose = shape.placed(start), start[roots[shape.body]]
        corners = (world - pose[:, 3]) @ pose[:, :3]
        drawn.append((float((world @ view[2]).mean()), Shape(parts.index(roots[shape.body]), corners)))
    outlines = [shape for _, shape in sorted(drawn, key=lambda one: -one[0])]  # the farthest first
    seen = {name: view[:2] @ pose[:, parts] for name, pose in poses.items()}
    size, fitted = _fitted(outlines, seen)
    errors = {names[joint]: np.degrees(error[moments, joint]) for joint in compared}
    worst = int(np.abs([*errors.values()]).max(axis=0).argmax())
    return MovingArm(size, outlines, log.time[moments], fitted, errors, worst)


def _fitted(
    outlines: Sequence[Shape], seen: Mapping[str, Array]
) -> tuple[tuple[int, int], dict[str, list[Array]]]:
    """Return the picture's size, and poses (F, parts, 2, 4) in its units, with the arm always inside."""
    corners = [shape.placed(pose).reshape(-1, 2) for pose in seen.values() for shape in outlines]
    low, high = (end(np.concatenate(corners), axis=0) for end in (np.min, np.max))
    scale = (_SIZE - 2 * _MARGIN) / max(high - low)
    width, height = (scale * (high - low) + 2 * _MARGIN).round().astype(int).tolist()
    fitted: dict[str, list[Array]] = {}
    for name, pose in seen.items():
        flipped = scale * pose * [[1], [-1]]  # y points down in a picture
        flipped[..., 3] += _MARGIN + scale * np.array([-low[0], high[1]])
        parts = flipped.reshape(*pose.shape[:2], 8).swapaxes(0, 1)
        fitted[name] = [part if np.ptp(part, axis=0).any() else part[:1] for part in parts]
    return (width, height), fitted
