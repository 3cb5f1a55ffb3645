"""The arm as outlines, without a renderer: the corners of its links, where they are in poses and in motion.

A page gets the corners of each link once, and for each moment how its rigid parts are turned and moved in the
picture. Its script (`moving_arm.js`) draws the simulated arm over the measured one.
"""

from collections.abc import Mapping, Sequence
from functools import partial

import mujoco
import numpy as np
import trimesh

from hydroid.arm.model import load_model
from hydroid.arrays import Array, record
from hydroid.cad.source import SHOWN
from hydroid.fitting.validation import Prediction
from hydroid.reporting.page import Plot, Section
from hydroid.settings.arm import Arm


@record
class Shape:
    """A shape of a body: its outermost corners in the body's frame [m], shape (n, 3)."""

    body: int
    corners: Array

    def placed(self, poses: Array) -> Array:
        """Return the corners in poses of all bodies, (..., nbody, d, 4) -> (..., n, d)."""
        return placed(self.corners, poses[..., self.body, :, :])


def placed(corners: Array, pose: Array) -> Array:
    """Return corners, shape (n, 3), turned and moved, (..., d, 4) -> (..., n, d)."""
    return corners @ pose[..., :3].swapaxes(-1, -2) + pose[..., None, :, 3]


def shapes(model: mujoco.MjModel) -> list[Shape]:
    """Return the shapes of all bodies; of an arm without any, lines from body to body."""
    directions = trimesh.creation.icosphere(subdivisions=1).vertices.T
    found: list[Shape] = []
    for geom in np.flatnonzero(model.geom_group <= SHOWN).tolist():
        if (points := _points(model, geom)) is not None:
            turn = np.empty(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            # the corners that lie farthest out in any direction give the outline
            outermost = points[np.unique((points @ directions).argmax(axis=0))]
            pose = np.column_stack([turn.reshape(3, 3), model.geom_pos[geom]])
            found.append(Shape(int(model.geom_bodyid[geom]), placed(outermost, pose)))
    return found or _lines(model)


def body_poses(model: mujoco.MjModel, angles: Array) -> Array:
    """Return turn and place [m] of all bodies at angles of all joints [rad], (F, nq) -> (F, nbody, 3, 4)."""
    data, poses = mujoco.MjData(model), np.empty((len(angles), model.nbody, 3, 4))
    for pose, angle in zip(poses, angles, strict=True):
        data.qpos[:] = angle
        mujoco.mj_kinematics(model, data)
        pose[..., :3], pose[..., 3] = data.xmat.reshape(-1, 3, 3), data.xpos
    return poses


def sight(azimuth: float, elevation: float) -> Array:
    """Return to the right, up and ahead for a camera that looks to these angles [deg], rows of (3, 3)."""
    a, e = np.radians([azimuth, elevation])
    ahead = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    return np.stack([right, np.cross(right, ahead), ahead])


def _lines(model: mujoco.MjModel) -> list[Shape]:
    """A line from each body to each that it carries; that of the last leads to its centre of mass."""
    found: list[Shape] = []
    for body in range(1, model.nbody):
        ends = model.body_pos[model.body_parentid == body]
        ends = ends if len(ends) else model.body_ipos[[body]]
        found += [Shape(body, np.stack([np.zeros(3), end])) for end in ends]
    return found


def _points(model: mujoco.MjModel, geom: int) -> Array | None:
    """Return points of a shape's surface in its own frame [m], shape (n, 3); None: it is no solid."""
    kinds, make, size = mujoco.mjtGeom, trimesh.creation, model.geom_size[geom]
    match kinds(int(model.geom_type[geom])):
        case kinds.mjGEOM_MESH:
            mesh = model.mesh(int(model.geom_dataid[geom]))
            return model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]].astype(float)
        case kinds.mjGEOM_BOX:
            return make.box(extents=2 * size).vertices
        case kinds.mjGEOM_SPHERE | kinds.mjGEOM_ELLIPSOID:
            return make.icosphere(subdivisions=2).vertices * model.geom_aabb[geom, 3:]
        case kinds.mjGEOM_CYLINDER:
            return make.cylinder(radius=size[0], height=2 * size[1], sections=24).vertices
        case kinds.mjGEOM_CAPSULE:
            return make.capsule(radius=size[0], height=2 * size[1], count=[16, 16]).vertices
        case _:
            return None


MOST, LOGS = 1200, 8  # moments of all logs of a page together, and logs that it shows in motion
RATE = 10.0  # moments in a second; the page draws what lies between them
VIEW = 112.0, -16.0  # where a camera would look to: azimuth and elevation [deg]
_SIZE, _MARGIN = 1000, 30  # longer side of the picture, and what stays free around the arm
_CAPTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where they differ "
    "most. Other joints replay their measured angles."
)


@record
class MovingArm:
    """An arm and how it moves, in units of the picture of a size.

    Attributes:
        shapes: in the order in which they are drawn, each with the number of its rigid part as its body.
        time: of the moments [s], shape (F,).
        poses: `measured` and `simulated`: how each part lies in the picture, rows of the 2 × 3 turn and of
            the place, shape (parts, F, 8), or (1, 8) for one that stands still.
        errors: measured minus simulated angle by the joint's name [°], of one that slides [mm], shape (F,).
        units: of the errors, by name.
        start: number of the moment with the largest error.
    """

    size: tuple[int, int]
    shapes: list[Shape]
    time: Array
    poses: dict[str, list[Array]]
    errors: dict[str, Array]
    units: dict[str, str]
    start: int


def motion_section(
    arm: Arm, predictions: Mapping[str, Prediction], caption: str = _CAPTION
) -> Section | None:
    """Return the section with a tab for each of the worst logs, by name; none for what diverged."""
    finite = [item for item in predictions.items() if np.isfinite(item[1].response).all()]
    if not finite:
        return None
    finite.sort(key=lambda item: -max(one.rms for one in item[1].indices.values()))
    few = f"{LOGS} of {len(finite)} logs, the worst first. " if len(finite) > LOGS else ""
    del finite[LOGS:]
    draw = partial(moving_arm, load_model(arm).compile(), arm.joint_names, most=MOST // len(finite))
    tabs = (
        Plot(f"motion_{i}", name, partial(draw, one), button=name) for i, (name, one) in enumerate(finite, 1)
    )
    return Section("The arm in motion", few + caption, tabs=tuple(tabs))


def moving_arm(
    model: mujoco.MjModel, names: Sequence[str], prediction: Prediction, most: int = MOST
) -> MovingArm:
    """Return how an arm with joints of these names moves, at `most` moments or fewer."""
    log, compared = prediction.log, [joint - 1 for joint in prediction.joints]
    measured, simulated = log.posed, log.posed.copy()
    simulated[:, compared] = prediction.response
    error = measured - simulated
    moves = np.ptp(measured, axis=0) + np.abs(error).max(axis=0) > 1e-4  # [rad]
    moving = {0, *model.jnt_bodyid[moves].tolist()}
    roots: list[int] = []  # the body that each one turns with: itself, or one that carries it
    for body, parent in enumerate(model.body_parentid.tolist()):
        roots.append(body if body in moving else roots[parent])
    parts = sorted(set(roots))
    count = int(np.clip(RATE * np.ptp(log.time) + 1, 2, most))
    moments = np.unique(np.linspace(0, len(log.time) - 1, count).round().astype(int))
    poses = np.stack([body_poses(model, angle[moments]) for angle in (measured, simulated)])

    view, start = sight(*VIEW), poses[1, 0]
    farthest_first = sorted(shapes(model), key=lambda one: -(one.placed(start) @ view[2]).mean())
    outlines: list[Shape] = []
    for shape in farthest_first:
        pose = start[roots[shape.body]]
        corners = (shape.placed(start) - pose[:, 3]) @ pose[:, :3]
        outlines.append(Shape(parts.index(roots[shape.body]), corners))
    seen = view[:2] @ poses[:, :, parts]  # in units of the picture, with the arm always inside
    corners = np.concatenate([shape.placed(seen).reshape(-1, 2) for shape in outlines])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / max(high - low)
    width, height = (scale * (high - low) + 2 * _MARGIN).round().astype(int).tolist()
    flipped = scale * seen * [[1], [-1]]  # y points down in a picture
    flipped[..., 3] += _MARGIN + scale * np.array([-low[0], high[1]])
    arms = flipped.reshape(*seen.shape[:3], 8).swapaxes(1, 2)
    fitted = [[part if np.ptp(part, axis=0).any() else part[:1] for part in arm] for arm in arms]
    lying = {"measured": fitted[0], "simulated": fitted[1]}
    slides = {names[joint]: model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE for joint in compared}
    factors = [1e3 if each else np.degrees(1.0) for each in slides.values()]
    errors = dict(zip(slides, (factors * error[moments][:, compared]).T, strict=True))
    units = {name: " mm" if each else "°" for name, each in slides.items()}
    worst = int(np.abs([*errors.values()]).max(axis=0).argmax())
    return MovingArm((width, height), outlines, log.time[moments], lying, errors, units, worst)
