"""The arm in motion for a page: the simulated arm over the measured one, drawn from the side as outlines.

A page gets the corners of each link once, and for each moment how its rigid parts are turned and moved in the
picture. Its script (`moving_arm.js`) draws the outlines; no renderer is needed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.reporting.outlines import poses, shapes
from hydroid.reporting.page import Plot, Section, Tab
from hydroid.settings.arm import Arm

MOTION = "The arm in motion"
"""title of the section"""
MOST, FEWEST = 1200, 100
"""moments of all logs of a page together, and of each at least"""
RATE = 10.0
"""moments in a second; the page draws what lies between them"""
VIEW = np.radians([-68.0, 16.0])
"""azimuth and elevation from which the arm is seen"""
_SIZE, _MARGIN = 1000, 30
"""longer side of the picture, and what stays free around the arm"""
_MOVES = 1e-4
"""a joint that turns less stands still [rad]"""
_CAPTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where they differ "
    "most. Joints that are not compared follow the log."
)


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


@dataclass(frozen=True, eq=False)
class MovingArm:
    """An arm and how it moves, in units of the picture.

    Attributes:
        size: width and height of the picture.
        shapes: number of the rigid part that each belongs to, and its corners there, shape (n, 3).
        time: of the moments [s], shape (F,).
        poses: `measured` and `simulated`: how each part lies in the picture, rows of the 2 × 3 turn and of
            the place, shape (parts, F, 8), or (1, 8) for one that stands still.
        errors: measured minus simulated angle by the joint's name [deg], shape (F,).
    """

    size: tuple[int, int]
    shapes: tuple[tuple[int, Array], ...]
    time: Array
    poses: Mapping[str, tuple[Array, ...]]
    errors: Mapping[str, Array]

    def plain(self) -> dict[str, Any]:
        """Return the moving arm as JSON has it."""
        return {
            "size": list(self.size),
            "shapes": [{"part": part, "corners": points.round(3).tolist()} for part, points in self.shapes],
            "time": self.time.round(3).tolist(),
            "poses": {
                name: [[[float(f"{v:.5g}") for v in pose] for pose in part] for part in parts]
                for name, parts in self.poses.items()
            },
            "errors": [[name, error.round(3).tolist()] for name, error in self.errors.items()],
            "start": int(np.abs(list(self.errors.values())).max(axis=0).argmax()),
        }


def motion_section(
    arm: Arm, movements: Sequence[Movement], notes: Mapping[str, str] | None = None
) -> tuple[Section, ...]:
    """Return the section with one tab per log; `notes` are of logs by name. A log that diverged has none."""
    shown = [movement for movement in movements if np.isfinite(movement.simulated).all()]
    if not shown:
        return ()
    model, most = load_model(arm).compile(), max(FEWEST, MOST // len(shown))
    tabs: list[Tab] = []
    for i, movement in enumerate(shown):
        moving = moving_arm(model, arm.joint_names, movement, most)
        plot = Plot(f"motion_{i + 1}", f"{movement.log}. {_CAPTION}", lambda moving=moving: moving)
        tabs.append(Tab(movement.log, (plot,), (notes or {}).get(movement.log, "")))
    return (Section(MOTION, tabs=tuple(tabs)),)


def moving_arm(
    model: mujoco.MjModel, names: Sequence[str], movement: Movement, most: int = MOST
) -> MovingArm:
    """Return how an arm with joints of these names moves, at `most` moments or fewer."""
    count = int(np.clip(RATE * np.ptp(movement.time) + 1, 2, most))
    moments = np.unique(np.linspace(0, len(movement.time) - 1, count).round().astype(int))
    series = {"measured": movement.measured, "simulated": movement.simulated}
    error = movement.measured - movement.simulated
    moves = np.ptp(movement.measured, axis=0) + np.abs(error).max(axis=0) > _MOVES
    moving = {int(model.joint(n).bodyid[0]) for n, turns in zip(names, moves, strict=True) if turns}
    roots: list[int] = []  # the body that each one turns with: itself, or one that carries it
    for body, parent in enumerate(model.body_parentid.tolist()):
        roots.append(body if body in moving | {0} else roots[parent])
    parts = sorted(set(roots))
    placed = {name: poses(model, names, angle[moments]) for name, angle in series.items()}
    start = placed["simulated"][0]
    drawn: list[tuple[float, int, Array]] = []
    for shape in shapes(model):
        turn, place = start[roots[shape.body]][:, :3], start[roots[shape.body]][:, 3]
        world = shape.corners @ start[shape.body][:, :3].T + start[shape.body][:, 3]
        depth = float((world @ side_view()[2]).mean())
        drawn.append((depth, parts.index(roots[shape.body]), (world - place) @ turn))
    outlines = tuple((part, corners) for _, part, corners in sorted(drawn, key=lambda one: one[0]))
    size, fitted = _fitted(outlines, {name: (side_view()[:2] @ p)[:, parts] for name, p in placed.items()})
    errors = {names[joint - 1]: np.degrees(error[moments, joint - 1]) for joint in movement.joints}
    return MovingArm(size, outlines, movement.time[moments], fitted, errors)


def side_view() -> Array:
    """Rows: to the right, up, and towards the viewer, in the world's frame."""
    a, e = VIEW
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _fitted(
    outlines: Sequence[tuple[int, Array]], seen: Mapping[str, Array]
) -> tuple[tuple[int, int], dict[str, tuple[Array, ...]]]:
    """Return the picture's size, and poses (F, parts, 2, 4) in its units, with the arm always inside."""
    places = np.concatenate(
        [
            (pose[:, part, :, :3] @ corners.T + pose[:, part, :, 3:]).swapaxes(1, 2).reshape(-1, 2)
            for pose in seen.values()
            for part, corners in outlines
        ]
    )
    low, high = places.min(axis=0), places.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / float(max(high - low))
    width, height = (scale * (high - low) + 2 * _MARGIN).round().astype(int).tolist()
    fitted: dict[str, tuple[Array, ...]] = {}
    for name, pose in seen.items():
        flipped = scale * pose * np.array([1, -1])[:, None]  # y points down in a picture
        flipped[..., 3] += np.array([_MARGIN - scale * low[0], height - _MARGIN + scale * low[1]])
        still, *parts = flipped.reshape(*pose.shape[:2], 8).swapaxes(0, 1)
        fitted[name] = (still[:1], *parts)
    return (width, height), fitted
