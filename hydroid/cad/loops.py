"""Loops that an MJCF closes by points of two bodies, but draws apart: the pose in which
they meet.

A constraint between two sites holds wherever they are drawn; a simulator pulls them
together. Where the pins of a cylinder are is known only then.
"""

from collections.abc import Iterator

import mujoco
import numpy as np
from scipy.optimize import least_squares

from hydroid.arrays import Array, Index
from hydroid.cad.source import Notes

SAME = 0.002
"""distance up to which two pins are one [m]"""
NEAR = 1e-4
"""weight of the distance from the drawn pose, beside that between ends [m/rad, m/m]"""
SMALLEST = 0.01
"""change of a joint [rad, m] that is named"""


def close_loops(model: mujoco.MjModel, data: mujoco.MjData, notes: Notes) -> None:
    """Pose a robot so that the ends of its loops meet, near the drawn pose.

    Loops whose ends can meet in no pose stay open.
    """
    drawn = data.qpos.copy()
    loops = [
        number
        for number in range(model.neq)
        if model.eq_type[number] == mujoco.mjtEq.mjEQ_CONNECT
    ]
    if not loops or max(_widths(model, data, loops)) <= SAME:
        return
    while loops:
        _close(model, data, loops, drawn)
        widths = _widths(model, data, loops)
        if max(widths) <= SAME:
            break
        del loops[int(np.argmax(widths))]
    else:
        data.qpos[:] = drawn
        mujoco.mj_kinematics(model, data)
    names = list[str]()
    for joint, place in _moved(model):
        if abs(data.qpos[place] - drawn[place]) > SMALLEST:
            names.append(model.joint(joint).name)
    if names:
        notes.add(
            "drawn where the file's loops are open: moved until they close", *names
        )


def _close(
    model: mujoco.MjModel, data: mujoco.MjData, loops: list[int], drawn: Array
) -> None:
    """Pose a robot where the ends of some loops are nearest to each other."""
    moved = [*_moved(model)]
    joints: Index = np.array([joint for joint, _ in moved])
    places: Index = np.array([place for _, place in moved])
    low, high = _limits(model, joints)
    # limits may be equal, which the search does not take
    high = np.maximum(high, low + 1e-9)
    start = drawn[places].clip(low, high)

    def gaps(position: Array) -> Array:
        data.qpos[places] = position
        mujoco.mj_kinematics(model, data)
        apart = [_gap(model, data, number) for number in loops]
        return np.concatenate([*apart, NEAR * (position - start)])

    gaps(least_squares(gaps, start, bounds=(low, high)).x)


def _moved(model: mujoco.MjModel) -> Iterator[tuple[int, int]]:
    """Yield hinges and slides, and the places of their positions in a pose."""
    kinds = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    for joint in range(model.njnt):
        if model.jnt_type[joint] in kinds:
            yield joint, int(model.jnt_qposadr[joint])


def _limits(model: mujoco.MjModel, joints: Index) -> tuple[Array, Array]:
    """Return the least and largest positions of joints, infinite where they have no
    limits."""
    is_limited = model.jnt_limited[joints].astype(bool)
    low = np.where(is_limited, model.jnt_range[joints, 0], -np.inf)
    high = np.where(is_limited, model.jnt_range[joints, 1], np.inf)
    return low, high


def _widths(
    model: mujoco.MjModel, data: mujoco.MjData, loops: list[int]
) -> list[float]:
    """Return how far the ends of loops are apart [m]."""
    widths = list[float]()
    for number in loops:
        gap = _gap(model, data, number)
        widths.append(float(np.linalg.norm(gap)))
    return widths


def _gap(model: mujoco.MjModel, data: mujoco.MjData, number: int) -> Array:
    """Return the way from one end of a constraint to the other [m], shape (3,)."""
    ends = (int(model.eq_obj1id[number]), int(model.eq_obj2id[number]))
    if model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
        first, second = (data.site_xpos[end] for end in ends)
        return second - first
    anchors = model.eq_data[number].reshape(-1)[:6].reshape(2, 3)
    first, second = (
        data.xpos[end] + data.xmat[end].reshape(3, 3) @ anchor
        for end, anchor in zip(ends, anchors, strict=True)
    )
    return second - first
