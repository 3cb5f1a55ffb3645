"""The arm as outlines, without a renderer: the corners of its links, and where they are
in poses."""

import mujoco
import numpy as np
import trimesh

from hydroid.arrays import Array, record
from hydroid.cad.source import SHOWN


@record
class Shape:
    """A shape of a body: its outermost corners in the body's frame [m], shape (n,
    3)."""

    body: int
    corners: Array

    def placed(self, poses: Array) -> Array:
        """Return the corners in poses of all bodies, (..., nbody, d, 4) -> (..., n,
        d)."""
        return placed(self.corners, poses[..., self.body, :, :])


def placed(corners: Array, pose: Array) -> Array:
    """Return corners, shape (n, 3), turned and moved, (..., d, 4) -> (..., n, d)."""
    rotation = pose[..., :3].swapaxes(-1, -2)
    position = pose[..., None, :, 3]
    return corners @ rotation + position


def shapes(model: mujoco.MjModel) -> list[Shape]:
    """Return the shapes of all bodies; of an arm without any, lines from body to
    body."""
    directions = trimesh.creation.icosphere(subdivisions=1).vertices.T
    outlines = list[Shape]()
    for geom in np.flatnonzero(model.geom_group <= SHOWN).tolist():
        points = _points(model, geom)
        if points is None:
            continue
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        # the corners that lie farthest out in any direction give the outline
        outermost = points[np.unique((points @ directions).argmax(axis=0))]
        pose = np.column_stack([turn.reshape(3, 3), model.geom_pos[geom]])
        body = int(model.geom_bodyid[geom])
        outlines.append(Shape(body, placed(outermost, pose)))
    return outlines or _lines(model)


def body_poses(model: mujoco.MjModel, angles: Array) -> Array:
    """Return turn and place [m] of all bodies at angles of all joints [rad], (F, nq) ->
    (F, nbody, 3, 4).
    """
    data = mujoco.MjData(model)
    poses = np.empty((len(angles), model.nbody, 3, 4))
    for pose, angle in zip(poses, angles, strict=True):
        data.qpos[:] = angle
        mujoco.mj_kinematics(model, data)
        pose[..., :3] = data.xmat.reshape(-1, 3, 3)
        pose[..., 3] = data.xpos
    return poses


def sight(azimuth: float, elevation: float) -> Array:
    """Return to the right, up and ahead for a camera that looks to these angles [deg],
    rows of (3, 3).
    """
    around, upwards = np.radians([azimuth, elevation])
    level = np.array([np.cos(around), np.sin(around)])
    ahead = np.array([*(np.cos(upwards) * level), np.sin(upwards)])
    right = np.array([level[1], -level[0], 0.0])
    return np.stack([right, np.cross(right, ahead), ahead])


def _lines(model: mujoco.MjModel) -> list[Shape]:
    """Return a line from each body to each that it carries.

    That of the last leads to its centre of mass.
    """
    lines = list[Shape]()
    for body in range(1, model.nbody):
        ends = model.body_pos[model.body_parentid == body]
        if not len(ends):
            ends = model.body_ipos[[body]]
        lines += [Shape(body, np.stack([np.zeros(3), end])) for end in ends]
    return lines


def _points(model: mujoco.MjModel, geom: int) -> Array | None:
    """Return points of a shape's surface in its own frame [m], shape (n, 3).

    None: it is no solid.
    """
    kinds = mujoco.mjtGeom
    make = trimesh.creation
    size = model.geom_size[geom]
    match kinds(int(model.geom_type[geom])):
        case kinds.mjGEOM_MESH:
            mesh = model.mesh(int(model.geom_dataid[geom]))
            return model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]].astype(float)
        case kinds.mjGEOM_BOX:
            return make.box(extents=2 * size).vertices
        case kinds.mjGEOM_SPHERE | kinds.mjGEOM_ELLIPSOID:
            return make.icosphere(subdivisions=2).vertices * model.geom_aabb[geom, 3:]
        case kinds.mjGEOM_CYLINDER:
            return make.cylinder(
                radius=size[0], height=2 * size[1], sections=24
            ).vertices
        case kinds.mjGEOM_CAPSULE:
            return make.capsule(
                radius=size[0], height=2 * size[1], count=[16, 16]
            ).vertices
        case _:
            return None
