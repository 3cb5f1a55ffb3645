"""The arm as outlines, without a renderer: the corners of its links, and where they are in its poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from hydroid.cad.shapes import SHOWN, geom_mesh
from hydroid.parameters import Array

_DIRECTIONS = 40
"""directions in which a shape's outermost corners are kept"""


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of a body: its outermost corners in the body's frame [m], shape (n, 3)."""

    body: int
    corners: Array


def shapes(model: mujoco.MjModel) -> list[Shape]:
    """Return the shapes of all bodies; of an arm without any, lines from body to body."""
    found: list[Shape] = []
    for geom in np.flatnonzero(model.geom_group <= SHOWN).tolist():
        if len(points := _corners(model, geom)):
            turn = np.empty(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            corners = model.geom_pos[geom] + _outermost(points) @ turn.reshape(3, 3).T
            found.append(Shape(int(model.geom_bodyid[geom]), corners))
    return found or _lines(model)


def poses(model: mujoco.MjModel, names: Sequence[str], angles: Array) -> Array:
    """Return turn and place [m] of all bodies at angles of joints [rad], (F, J) -> (F, nbody, 3, 4)."""
    data, address = mujoco.MjData(model), [int(model.joint(name).qposadr[0]) for name in names]
    found = np.empty((len(angles), model.nbody, 3, 4))
    for pose, angle in zip(found, angles, strict=True):
        data.qpos[address] = angle
        mujoco.mj_kinematics(model, data)
        pose[..., :3], pose[..., 3] = data.xmat.reshape(-1, 3, 3), data.xpos
    return found


def outline(points: Array) -> Array:
    """Return the convex outline of points, shape (n, 2)."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return points


def _corners(model: mujoco.MjModel, geom: int) -> Array:
    """Corners of a shape in its own frame, shape (n, 3); none of a plane."""
    mesh = geom_mesh(model, geom)
    return np.empty((0, 3)) if mesh is None else np.asarray(mesh.vertices, float)


def _lines(model: mujoco.MjModel) -> list[Shape]:
    """A line from each body to each that it carries; that of the last leads to its centre of mass."""
    found: list[Shape] = []
    for body in range(1, model.nbody):
        ends = model.body_pos[model.body_parentid == body]
        ends = ends if len(ends) else model.body_ipos[[body]]
        found += [Shape(body, np.stack([np.zeros(3), end])) for end in ends]
    return found


def _outermost(points: Array) -> Array:
    """Return the corners that lie farthest out in any of _DIRECTIONS: they give the outline."""
    k = np.arange(_DIRECTIONS) + 0.5
    height, turn = 1 - 2 * k / _DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k  # evenly on a ball (Fibonacci)
    ring = np.sqrt(1 - height**2)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), height])
    return points[np.unique((points @ directions).argmax(axis=0))]
