"""The torques that hold an arm against gravity, in any pose.

Each joint has a frame with its anchor at the origin and its axis along z, so that the
joint turns x and y, or slides along z. Gravity g is turned outwards from frame to frame,
and the mass M that a joint carries is gathered inwards with its moment h = Σ m r:

    g_b = R_bᵀ g_a,      M_a = m_a + Σ M_b,      h_a = m_a r_a + Σ (M_b o_b + R_b h_b)

of the frames b that a joint's frame a carries, at o_b and turned by R_b. A joint that
turns is held by −(h × g)_z, one that slides by −M g_z.

They are those of MuJoCo's `mj_rne` at rest, up to rounding, for a third of the time:
nothing else is placed in the world.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import mujoco
import numpy as np

from hydroid.arrays import Array, Structs
from hydroid.hydraulics.elementwise import compilable

LINK = np.dtype(
    [
        ("parent", np.int64),
        ("slides", np.bool_),
        # angle, or way, at which the body stands as the model's file has it
        ("zero", np.float64),
        # of the joint's frame in its body: where, and its axes in columns
        ("anchor", np.float64, 3),
        ("axes", np.float64, (3, 3)),
        # of the joint's frame at `zero` in that of the parent: where, and its turn
        ("place", np.float64, 3),
        ("turn", np.float64, (3, 3)),
        # of the pose: angle [rad], its cosine and sine, and way along the axis [m]
        ("angle", np.float64),
        ("cosine", np.float64),
        ("sine", np.float64),
        ("way", np.float64),
        # gravity [m/s²] in the joint's frame
        ("down", np.float64, 3),
        # of the body alone: mass [kg] and its moment [kg·m]
        ("own_mass", np.float64),
        ("own_moment", np.float64, 3),
        # with all that it carries
        ("mass", np.float64),
        ("moment", np.float64, 3),
    ]
)
"""a body of a chain, its only joint, and scratch space; the world, without either, is
its own parent"""


def make_links(model: mujoco.MjModel) -> Structs:
    """Return the bodies of a model of which each but the world has one joint, (B,) of
    LINK."""
    links = np.zeros(model.nbody, LINK)
    links["axes"][0] = np.eye(3)
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        links["down"][0] = model.opt.gravity
    for body in range(1, model.nbody):
        joint = model.joint(int(model.body_jntadr[body]))
        link = links[body]
        above = links[model.body_parentid[body]]
        link["parent"] = model.body_parentid[body]
        link["slides"] = joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE
        link["zero"] = joint.qpos0[0]
        link["anchor"] = joint.pos
        link["axes"] = _axes(joint.axis)
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.body_quat[body])
        frame = turn.reshape(3, 3)
        away = model.body_pos[body] + frame @ joint.pos - above["anchor"]
        link["place"] = above["axes"].T @ away
        link["turn"] = above["axes"].T @ frame @ link["axes"]
    return links


def _axes(axis: Array) -> Array:
    """Return right-handed unit vectors, in columns, of which the last is an axis, (3,);
    exactly those of the frame, in another order, where it is one of them."""
    # the one that is most square to it
    nearest = np.eye(3)[np.argmin(np.abs(axis))]
    square = nearest - (nearest @ axis) * axis
    first: Array = square / np.linalg.norm(square)
    second: Array = np.cross(axis, first)
    return np.column_stack([first, second, axis])


@compilable
def load_links(links, mass, centre) -> None:
    """Give bodies their masses [kg], (B,), with their centres [m], (B, 3), and no
    pose."""
    for i in range(1, links.size):
        b = links[i]
        b.angle = np.nan
        b.own_mass = mass[i]
        for k in range(3):
            moment = 0.0
            for m in range(3):
                moment += b.axes[m, k] * (centre[i, m] - b.anchor[m])
            b.own_moment[k] = mass[i] * moment


@compilable
def pose_link(b, angle: float) -> None:
    """Turn or shift a body to an angle [rad], or a way [m]."""
    b.angle = angle
    b.cosine = 1.0
    b.sine = 0.0
    b.way = 0.0
    if b.slides:
        b.way = angle - b.zero
    else:
        b.cosine = np.cos(angle - b.zero)
        b.sine = np.sin(angle - b.zero)


@compilable
def hold(links, angle, torque) -> None:
    """Write what holds joints at angles [rad] against gravity [N·m], (V,) both; of those
    that slide in m and N."""
    for i in range(1, links.size):
        b = links[i]
        # most joints stand still most of the time
        if b.angle != angle[i - 1]:
            pose_link(b, angle[i - 1])
        down = links[b.parent].down
        x = b.turn[0, 0] * down[0] + b.turn[1, 0] * down[1] + b.turn[2, 0] * down[2]
        y = b.turn[0, 1] * down[0] + b.turn[1, 1] * down[1] + b.turn[2, 1] * down[2]
        z = b.turn[0, 2] * down[0] + b.turn[1, 2] * down[1] + b.turn[2, 2] * down[2]
        b.down[0] = b.cosine * x + b.sine * y
        b.down[1] = b.cosine * y - b.sine * x
        b.down[2] = z
        b.mass = b.own_mass
        for k in range(3):
            b.moment[k] = b.own_moment[k]
    for i in range(links.size - 1, 0, -1):
        b = links[i]
        if b.slides:
            torque[i - 1] = -b.mass * b.down[2]
        else:
            torque[i - 1] = b.moment[1] * b.down[0] - b.moment[0] * b.down[1]
        x = b.cosine * b.moment[0] - b.sine * b.moment[1]
        y = b.sine * b.moment[0] + b.cosine * b.moment[1]
        z = b.moment[2] + b.mass * b.way
        above = links[b.parent]
        above.mass += b.mass
        for k in range(3):
            turned = b.turn[k, 0] * x + b.turn[k, 1] * y + b.turn[k, 2] * z
            above.moment[k] += b.mass * b.place[k] + turned
