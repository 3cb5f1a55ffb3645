"""The arm in motion for a page: the simulated arm over the measured one, drawn from the side as outlines.

A page gets the corners of each link once, and for each moment how its rigid parts are turned and moved in the
picture. Its script (`moving_arm.js`) draws the outlines; no renderer is needed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report.arm_picture import corners, side_view, sticks

RATE = 10.0
"""moments in a second; the page draws what lies between them"""
MOST = 1200
"""moments of all logs of a page together"""
_CORNERS = 40
"""directions in which a link's outermost corners are kept"""
_MOVES = 1e-4
"""a joint that turns less stands still [rad]"""
_SIZE = 1000
"""longer side of the picture"""
_MARGIN = 30


@dataclass(frozen=True, eq=False)
class Movement:
    """What moved in one log: angles of all joints [rad], shape (T, J), at times [s], shape (T,).

    Attributes:
        log: its name.
        time: of the samples.
        measured: by the log; a joint that it does not measure stands in its start pose.
        simulated: the compared joints by the model, the others as measured.
        joints: numbers of those that are compared, from 1.
    """

    log: str
    time: Array
    measured: Array
    simulated: Array
    joints: tuple[int, ...]

    @classmethod
    def of(cls, name: str, log: Log, joints: Sequence[int], response: Array) -> "Movement":
        """Return that of a log and of a model's response of some joints, shape (T, K)."""
        simulated = log.angle.copy()
        simulated[:, [joint - 1 for joint in joints]] = response
        return cls(name, log.time, log.angle, simulated, tuple(joints))

    @property
    def error(self) -> Array:
        """Measured minus simulated angle of the compared joints [rad], shape (T, K)."""
        columns = [joint - 1 for joint in self.joints]
        return self.measured[:, columns] - self.simulated[:, columns]


@dataclass(frozen=True, eq=False)
class MovingArm:
    """An arm and how it moves, in units of the picture.

    Attributes:
        size: width and height of the picture.
        shapes: number of the rigid part that each belongs to, and its corners there, shape (n, 3).
        time: of the moments [s], shape (F,).
        poses: `measured` and `simulated`: how each part lies in the picture, rows of the 2 × 3 turn and of
            the place, shape (parts, F or 1, 8).
        errors: measured minus simulated angle by joint [deg], shape (F,).
    """

    size: tuple[int, int]
    shapes: tuple[tuple[int, Array], ...]
    time: Array
    poses: Mapping[str, tuple[Array, ...]]
    errors: Mapping[int, Array]

    def plain(self) -> dict[str, Any]:
        """Return the moving arm as JSON has it."""
        start = max(range(len(self.time)), key=lambda f: max(abs(e[f]) for e in self.errors.values()))
        return {
            "size": list(self.size),
            "shapes": [{"part": part, "corners": points.round(3).tolist()} for part, points in self.shapes],
            "time": self.time.round(3).tolist(),
            "poses": {
                name: [[[float(f"{v:.5g}") for v in pose] for pose in part] for part in parts]
                for name, parts in self.poses.items()
            },
            "errors": [[f"joint {j}", e.round(3).tolist()] for j, e in self.errors.items()],
            "start": start,
        }


def moving_arm(
    model: mujoco.MjModel, names: Sequence[str], movement: Movement, most: int = MOST
) -> MovingArm:
    """Return how an arm with joints of these names moves, at `most` moments or fewer."""
    seconds = float(movement.time[-1] - movement.time[0])
    count = int(np.clip(RATE * seconds + 1, 2, most))
    moments = np.unique(np.linspace(0, len(movement.time) - 1, count).round().astype(int))
    joints = [model.joint(name) for name in names]
    series = {"measured": movement.measured, "simulated": movement.simulated}
    moves = np.max([np.ptp(angle, axis=0) for angle in series.values()], axis=0) > _MOVES
    moves |= np.abs(movement.measured - movement.simulated).max(axis=0) > _MOVES
    moving = {int(joint.bodyid[0]) for joint, turns in zip(joints, moves, strict=True) if turns}
    roots = [_root(model, body, moving) for body in range(model.nbody)]
    parts = sorted(set(roots))
    view, data = side_view(), mujoco.MjData(model)
    address = [int(joint.qposadr[0]) for joint in joints]
    seen = {
        name: _seen(model, data, (address, angle[moments]), (parts, view)) for name, angle in series.items()
    }
    # `data` stands at the last moment: there each shape's corners are brought to the frame of its part
    shapes: list[tuple[float, int, Array]] = []
    for geom in range(model.ngeom):
        points = corners(model, geom)
        if len(points):
            root = roots[int(model.geom_bodyid[geom])]
            world = data.geom_xpos[geom] + _outermost(points) @ data.geom_xmat[geom].reshape(3, 3).T
            own = (world - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
            shapes.append((float((world @ view[2]).mean()), parts.index(root), own))
    for body, points in () if shapes else sticks(model):
        root = roots[body]
        world = data.xpos[body] + points @ data.xmat[body].reshape(3, 3).T
        own = (world - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
        shapes.append((float((world @ view[2]).mean()), parts.index(root), own))
    drawn = tuple((part, points) for _, part, points in sorted(shapes, key=lambda shape: shape[0]))
    size, placed = _fitted(drawn, seen)
    errors = np.degrees(movement.error[moments])
    return MovingArm(
        size, drawn, movement.time[moments], placed, dict(zip(movement.joints, errors.T, strict=True))
    )


def _root(model: mujoco.MjModel, body: int, moving: set[int]) -> int:
    """Return the body that turns where this one does: the nearest whose joint moves, or the world."""
    while body and body not in moving:
        body = int(model.body_parentid[body])
    return body


def _seen(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    angles: tuple[Sequence[int], Array],
    seen: tuple[Sequence[int], Array],
) -> Array:
    """Return turn and place of some bodies in a view [m], shape (parts, F, 2, 4)."""
    (address, moments), (parts, view) = angles, seen
    poses = np.empty((len(parts), len(moments), 2, 4))
    for k, angle in enumerate(moments):
        data.qpos[address] = angle
        mujoco.mj_kinematics(model, data)
        poses[:, k, :, :3] = view[:2] @ data.xmat[parts].reshape(-1, 3, 3)
        poses[:, k, :, 3] = data.xpos[parts] @ view[:2].T
    return poses


def _outermost(points: Array) -> Array:
    """Return the corners that lie farthest out in any of _CORNERS directions: they give the outline."""
    k = np.arange(_CORNERS) + 0.5
    height, turn = 1 - 2 * k / _CORNERS, np.pi * (1 + np.sqrt(5)) * k  # evenly on a ball (Fibonacci)
    ring = np.sqrt(1 - height**2)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), height])
    return points[np.unique((points @ directions).argmax(axis=0))]


def _fitted(
    shapes: Sequence[tuple[int, Array]], seen: Mapping[str, Array]
) -> tuple[tuple[int, int], dict[str, tuple[Array, ...]]]:
    """Return the picture's size, and the poses in its units: the arm is inside at all moments."""
    places = np.concatenate(
        [
            (poses[part, :, :, :3] @ points.T + poses[part, :, :, 3:]).transpose(0, 2, 1).reshape(-1, 2)
            for poses in seen.values()
            for part, points in shapes
        ]
    )
    low, high = places.min(axis=0), places.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / float(max(high - low))
    width, height = (int(v) for v in (scale * (high - low) + 2 * _MARGIN).round())
    placed: dict[str, tuple[Array, ...]] = {}
    for name, poses in seen.items():
        flipped = scale * poses * np.array([1, -1])[:, None]  # y points down in a picture
        flipped[..., 3] += np.array([_MARGIN - scale * low[0], height - _MARGIN + scale * low[1]])
        placed[name] = tuple(_still(part.reshape(len(part), 8)) for part in flipped)
    return (width, height), placed


def _still(poses: Array) -> Array:
    """Return the first pose alone of a part that stands still, shape (1, 8)."""
    return poses[:1] if float(np.ptp(poses, axis=0).max(initial=0.0)) < 1e-3 else poses
