"""Where the tip of an arm is: what it carries hangs there, and a path can lead it."""

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.settings.arm import Arm

AT_THE_PIN = 1e-3
"""distance of a link's centre of mass from its pin below which it points nowhere [m]"""


@record
class Tip:
    """A point of a body.

    Attributes:
        body: number in the compiled model.
        at: in the body's frame [m], shape (3,).
        what: it is, for a reader.
    """

    body: int
    at: Array
    what: str


def tip_of(model: mujoco.MjModel, arm: Arm) -> Tip:
    """Return the site that the arm's file names as `payload`, or else the end of the
    last link: from the last joint that turns, through the link's centre of mass, as far
    as its shapes reach with all joints at 0.

    Args:
        model: the compiled model of the whole arm.
        arm: its file.
    """
    if arm.payload is not None:
        site = model.site(arm.payload)
        body = int(site.bodyid[0])
        return Tip(body, model.site_pos[site.id].copy(), f"the site {arm.payload}")
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    last = int(model.jnt_bodyid[-1])
    pin = data.xanchor[_last_that_turns(model)]
    centre = data.subtree_com[last]
    length = float(np.linalg.norm(centre - pin))
    end = centre
    if length > AT_THE_PIN:
        along = (centre - pin) / length
        end = pin + _reach(model, data, pin, along) * along
    at = data.xmat[last].reshape(3, 3).T @ (end - data.xpos[last])
    link = model.body(last).name or f"the link of {arm.joint_names[-1]}"
    return Tip(last, at, f"the end of {link}")


def _last_that_turns(model: mujoco.MjModel) -> int:
    """Return the last joint that turns, 0-based; where all slide, the last."""
    turning = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    if len(turning):
        return int(turning[-1])
    return model.njnt - 1


def _reach(
    model: mujoco.MjModel, data: mujoco.MjData, pin: Array, along: Array
) -> float:
    """Return how far the shapes of the last link reach from a pin in a direction [m]:
    at least to its centre of mass."""
    last = int(model.jnt_bodyid[-1])
    farthest = float((data.subtree_com[last] - pin) @ along)
    of_link = np.flatnonzero(model.body_weldid[model.geom_bodyid] == last)
    for geom in of_link.tolist():
        turn = data.geom_xmat[geom].reshape(3, 3)
        place = data.geom_xpos[geom] - pin
        corners = place + _corners(model, geom) @ turn.T
        farthest = max(farthest, float((corners @ along).max()))
    return farthest


def _corners(model: mujoco.MjModel, geom: int) -> Array:
    """Return the corners of a shape in its frame [m], shape (n, 3): of a mesh its own,
    of any other those of the box around it."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(int(model.geom_dataid[geom]))
        first = int(mesh.vertadr[0])
        return model.mesh_vert[first : first + int(mesh.vertnum[0])].astype(float)
    middle = model.geom_aabb[geom, :3]
    half = model.geom_aabb[geom, 3:]
    ends = [-1, 1]
    signs = np.array(np.meshgrid(ends, ends, ends)).reshape(3, -1).T
    return middle + signs * half
