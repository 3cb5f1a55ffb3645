"""The arm in motion, as a page draws it: the measured arm, and over it the simulated
one.

A page gets the corners of each link once, and for each moment how its rigid parts are
turned and moved in the world, and where a camera looks. Its script (`moving_arm.js`)
draws both arms. The camera from the side turns with the machine, so that a slew never
hides the arm behind itself; another one looks down on it.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.validation import Prediction
from hydroid.reporting.outlines import Shape, body_poses, shapes, sight
from hydroid.units import display

MOST = 1200
"""moments of all logs of a page together"""
RATE = 10.0
"""moments in a second; the page draws what lies between them"""
SIDE = 112.0, -16.0
"""where a camera looks to that sees an arm along x from its side: azimuth and elevation
[deg]"""
UPRIGHT = 0.99
"""part of an axis's direction that points upwards, from which on its joint slews the
machine"""
SLEWS = np.radians(1.0)
"""turn of the machine from which on it is shown from above, too [rad]"""
REACH = 0.05
"""part of the arm's size that it must reach sideways for its direction to be known"""
_SIZE = 1000
"""longer side of the picture from the side"""
_MARGIN = 30
"""what stays free around the arm in it"""


@record
class View:
    """What one camera sees.

    Attributes:
        size: of its picture, width and height.
        axes: what points to the right and downwards in the picture, shape (F, 6); (1,
            6) of a camera that does not turn.
        corner: what is added to that [1], shape (2,).
        order: the shapes, the farthest first.
    """

    size: tuple[int, int]
    axes: Array
    corner: Array
    order: list[int]


@record
class MovingArm:
    """An arm and how it moves.

    Attributes:
        shapes: each with the number of its rigid part as its body.
        time: of the moments [s], shape (F,).
        poses: `measured` and `simulated`: rows of the 3 × 4 turn and place [m] of each
            part, shape (parts, F, 12), or (1, 12) for one that stands still.
        views: from the `side`, and from `above` if the machine slews.
        errors: measured minus simulated angle by the joint's name [°], of one that
            slides [mm], shape (F,).
        units: of the errors, by name.
        start: number of the moment at which both arms are farthest apart.
    """

    shapes: list[Shape]
    time: Array
    poses: dict[str, list[Array]]
    views: dict[str, View]
    errors: dict[str, Array]
    units: dict[str, str]
    start: int


def moving_arm(
    model: mujoco.MjModel,
    names: Sequence[str],
    prediction: Prediction,
    most: int = MOST,
) -> MovingArm:
    """Return how an arm with joints of these names moves, at `most` moments or
    fewer."""
    log = prediction.log
    compared = [joint - 1 for joint in prediction.joints]
    measured = log.posed
    simulated = measured.copy()
    simulated[:, compared] = prediction.response
    error = measured - simulated
    # links that do not turn on each other are drawn as one rigid part
    moves = np.ptp(measured, axis=0) + np.abs(error).max(axis=0) > 1e-4  # [rad]
    roots = _roots(model, moves)
    parts = sorted(set(roots))
    # the largest error of each joint is one of them
    count = int(np.clip(RATE * np.ptp(log.time) + 1, 2, most - len(compared)))
    evenly = np.linspace(0, len(log.time) - 1, count)
    largest = np.abs(error).argmax(axis=0)[compared]
    moments = np.unique([*evenly.round().astype(int), *largest])
    measured_poses = body_poses(model, measured[moments])
    simulated_poses = body_poses(model, simulated[moments])
    outlines = _rigid_parts(model, simulated_poses[0], roots, parts)
    poses = np.stack([measured_poses, simulated_poses])[:, :, parts]
    corners = [outline.placed(poses) for outline in outlines]
    placed = np.concatenate(corners, axis=2)
    heading = _heading(model, measured[moments])
    # the camera at the side turns with the machine
    cameras = [sight(SIDE[0] + np.degrees(turn), SIDE[1]) for turn in heading]
    side = _view(outlines, placed, cameras)
    views = {"side": side}
    if np.ptp(heading) > SLEWS:
        scale = float(np.linalg.norm(side.axes[0, :3]))
        views["above"] = _view(outlines, placed, [sight(90.0, -90.0)], scale)

    by_part = {"measured": _by_part(poses[0]), "simulated": _by_part(poses[1])}
    errors, units = _errors(model, names, compared, error[moments])
    # in metres: angles and lengths cannot be compared
    apart = np.linalg.norm(placed[0] - placed[1], axis=-1).max(axis=1)
    farthest = int(apart.argmax())
    return MovingArm(
        outlines, log.time[moments], by_part, views, errors, units, farthest
    )


def _by_part(poses: Array) -> list[Array]:
    """Return poses of parts, shape (F, parts, 3, 4), part by part, (F, 12), or (1, 12)
    of one that stands still."""
    rows = poses.reshape(*poses.shape[:2], 12).swapaxes(0, 1)
    return [part if np.ptp(part, axis=0).any() else part[:1] for part in rows]


def _roots(model: mujoco.MjModel, moves: Array) -> list[int]:
    """Return the body that each body turns with: itself if its joint `moves`, or one
    that carries it.
    """
    moving = {0, *model.jnt_bodyid[moves].tolist()}
    roots = list[int]()
    for body, parent in enumerate(model.body_parentid.tolist()):
        roots.append(body if body in moving else roots[parent])
    return roots


def _rigid_parts(
    model: mujoco.MjModel, start: Array, roots: list[int], parts: list[int]
) -> list[Shape]:
    """Return all shapes in the frames of their rigid parts, from the poses at the
    start, (nbody, 3, 4).
    """
    outlines = list[Shape]()
    for shape in shapes(model):
        pose = start[roots[shape.body]]
        corners = (shape.placed(start) - pose[:, 3]) @ pose[:, :3]
        outlines.append(Shape(parts.index(roots[shape.body]), corners))
    return outlines


def _heading(model: mujoco.MjModel, angles: Array) -> Array:
    """Return the direction that the machine faces at angles of all joints, (F, nq) ->
    (F,) [rad].

    It is that of the arm at the start, and turns with the upright joints that carry all
    others.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = angles[0]
    mujoco.mj_kinematics(model, data)
    turned = np.zeros(len(angles))
    base = data.xanchor[0]
    for joint in range(model.njnt):
        is_hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        if not is_hinge or abs(data.xaxis[joint, 2]) < UPRIGHT:
            break
        turn = angles[:, joint] - angles[0, joint]
        turned += np.sign(data.xaxis[joint, 2]) * turn
        base = data.xanchor[joint]
    centres = data.xipos[1:]
    reach = centres[-1] - base
    sideways = float(np.hypot(*reach[:2]))
    size = float(np.ptp(centres, axis=0).max(initial=0.0) + 1e-9)
    # an arm that stands upright faces nowhere
    if sideways <= REACH * size:
        return turned
    return turned + np.arctan2(reach[1], reach[0])


def _view(
    outlines: Sequence[Shape],
    placed: Array,
    cameras: Sequence[Array],
    scale: float = 0.0,
) -> View:
    """Return what a camera sees of corners [m], (2, F, n, 3), that looks (right, up,
    ahead) at each moment.

    scale: of the picture [1/m]; 0: so that it is as large as it may be.
    """
    right_and_up = np.stack([camera[:2] for camera in cameras])
    # in a picture y points down
    axes = right_and_up * np.array([[1.0], [-1.0]])
    product = "fij,afnj->afni" if len(cameras) > 1 else "gij,afnj->afni"
    in_picture = np.einsum(product, axes, placed)
    low = in_picture.min(axis=(0, 1, 2))
    high = in_picture.max(axis=(0, 1, 2))
    span = high - low
    if not scale:
        scale = (_SIZE - 2 * _MARGIN) / float(max(span))
    size = scale * span + 2 * _MARGIN
    width, height = size.round().astype(int).tolist()
    depths = list[float]()
    first = 0
    for outline in outlines:
        corners = placed[1, 0, first : first + len(outline.corners)]
        depths.append(float((corners @ cameras[0][2]).mean()))
        first += len(outline.corners)
    farthest_first = sorted(range(len(outlines)), key=lambda i: -depths[i])
    corner = _MARGIN - scale * low
    return View((width, height), scale * axes.reshape(-1, 6), corner, farthest_first)


def _errors(
    model: mujoco.MjModel, names: Sequence[str], compared: Sequence[int], error: Array
) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the errors of the compared joints [°, mm] and their units, by name, from
    [rad, m], (F, nq).
    """
    errors = dict[str, Array]()
    units = dict[str, str]()
    for joint in compared:
        slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        shown = display(slides=slides)
        units[names[joint]] = shown.mark
        errors[names[joint]] = shown.factor * error[:, joint]
    return errors, units
