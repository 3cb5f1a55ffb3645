"""Joint angles along a path of the tip: MuJoCo's kinematics inverted, sample by sample.

Each sample starts from the pose before it and takes damped least-squares steps (C. W.
Wampler, *Manipulator inverse kinematic solutions based on vector formulations and
damped least-squares methods*, 1986). Of several poses that reach a point it so finds
one near the pose before: the joints move no more than the path asks for.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.arm.tip import tip_of
from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.log import Log
from hydroid.log.table import Signal, Table
from hydroid.settings.arm import Arm
from hydroid.settings.log import LogSettings
from hydroid.units import UNITS

COLUMNS = ("x_m", "y_m", "z_m")
"""columns of a file that hold the tip's position [m], in the axes of the arm's model"""
FROM_START = ("dx_m", "dy_m", "dz_m")
"""the same, from where the tip starts"""
TIME = "time_s"
"""column of times [s] that a path may have instead of that of the logs"""
REACHED = 1e-6
"""distance from a point at which the tip counts as there [m]"""
UNREACHED = 1e-3
"""distance from a point from which a path is refused [m]: a valve leads no tip that
closely"""
MOST_SAMPLES = 200_000
"""of a path: half an hour of them, which take minutes to compute"""
MOST_STEPS = 300
"""steps for a sample; a path's first point, far from the start pose, takes the most"""
DAMPING = 1e-3
"""of a step, beside the lengths of the arm [m]; it shrinks as the tip comes close"""
LARGEST_TURN = 0.2
"""of a joint in one step [rad], of one that slides [m]"""


class TipKinematics:
    """The tip of an arm, and the joints that lead it (`arm.tip`).

    Args:
        arm: whose MJCF is read.
        joints: that may move, numbered from 1; the others keep their angle.

    Attributes:
        tip: which point of the arm it is.
    """

    def __init__(self, arm: Arm, joints: Sequence[int]) -> None:
        self._model = load_model(arm).compile()
        self._data = mujoco.MjData(self._model)
        self.tip = tip_of(self._model, arm)
        self._moving = np.array(joints) - 1
        self._low = arm.lower
        self._high = arm.upper

    def place(self, angle: Array) -> Array:
        """Return where the tip is [m], shape (3,), at angles of all joints [rad], shape
        (J,)."""
        data = self._data
        tip = self.tip
        data.qpos[:] = angle
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        turned = data.xmat[tip.body].reshape(3, 3)
        return data.xpos[tip.body] + turned @ tip.at

    def angles(self, points: Array, start: Array) -> tuple[Array, Array]:
        """Return angles [rad], shape (T, J), and how far the tip stays off [m], shape
        (T,).

        Args:
            points: of the tip [m], shape (T, 3).
            start: pose before the first point [rad], shape (J,).
        """
        angle = np.empty((len(points), len(start)))
        off = np.empty(len(points))
        pose = start
        for k, point in enumerate(points):
            pose, off[k] = self._reach(point, pose)
            angle[k] = pose
        return angle, off

    def _reach(self, point: Array, pose: Array) -> tuple[Array, float]:
        """Return the pose near another that brings the tip closest to a point, and the
        distance [m]."""
        missing = point - self.place(pose)
        off = float(np.linalg.norm(missing))
        damping = DAMPING
        for _ in range(MOST_STEPS):
            if off < REACHED or damping > 1e3:
                break
            tried = self._step(missing, pose, damping)
            still_missing = point - self.place(tried)
            distance = float(np.linalg.norm(still_missing))
            if distance < off:
                pose = tried
                missing = still_missing
                off = distance
                damping = max(0.3 * damping, 1e-9)
            else:
                damping *= 4.0
        return pose, off

    def _step(self, missing: Array, pose: Array, damping: float) -> Array:
        """Return the pose after a step towards a point; joints at an end of their range
        stay within."""
        slopes = np.empty((3, self._model.nv))
        at = self.place(pose)
        mujoco.mj_jac(self._model, self._data, slopes, None, at, self.tip.body)
        free = self._moving
        next_pose = pose.copy()
        for _ in range(len(self._moving)):
            near = slopes[:, free]
            damped = near @ near.T + damping * np.eye(3)
            step = near.T @ np.linalg.solve(damped, missing)
            largest = float(np.abs(step).max())
            step *= min(1.0, LARGEST_TURN / max(largest, LARGEST_TURN))
            before = pose[free]
            after = before + step
            low = self._low[free]
            high = self._high[free]
            beyond = (after > high) | (after < low)
            beyond &= (before >= high) | (before <= low)
            next_pose[:] = pose
            next_pose[free] = after
            if not beyond.any() or beyond.all():
                break
            # a joint at its end cannot help: the others take its part
            free = free[~beyond]
        return next_pose.clip(self._low, self._high)


def holds_tip(table: Table) -> bool:
    """Return whether a file holds positions of the tip, in `COLUMNS` or `FROM_START`.

    Raises LogError: it holds some of these columns only, or has them without a unit.
    """
    bare = [name.removesuffix("_m") for name in FROM_START]
    if {*bare} <= {*table.names}:
        hint = f"a path of the tip takes {', '.join(FROM_START)}, in m"
        raise LogError(f"column {bare[0]} has no unit", table.source, hint)
    for columns in (COLUMNS, FROM_START):
        missing = [name for name in columns if name not in table.names]
        if not missing:
            return True
        if len(missing) < len(columns):
            hint = f"a path of the tip takes {', '.join(columns)}"
            raise LogError(f"column {missing[0]} is missing", table.source, hint)
    return False


def tip_path(table: Table, logs: LogSettings, tip: TipKinematics, start: Array) -> Log:
    """Return the joint angles along a path of the tip, without commands.

    Args:
        table: with `COLUMNS` or `FROM_START`, and times in `TIME` or as the logs have
            them.
        logs: how the logs of the arm have their times, and the period of the samples;
            the tip moves on a line between two rows.
        tip: of the arm.
        start: pose from which the first point is sought [rad], shape (J,).

    Raises:
        LogError: a column of times is missing, a cell holds no number, times do not
            increase, the path has more than MOST_SAMPLES, or a point cannot be reached.
    """
    first = tip.place(start)
    absolute = COLUMNS[0] in table.names
    positions = COLUMNS if absolute else FROM_START
    since, values = _rows(table, logs, positions)
    period = logs.period_s
    times = since - since[0]
    # a whole number of periods may be one less by rounding
    samples = int(np.floor(times[-1] / period + 1e-6)) + 1
    at = np.arange(samples, dtype=float) * period
    points = np.empty((samples, 3))
    for axis in range(3):
        points[:, axis] = np.interp(at, times, values[:, axis])
    if not absolute:
        points += first
    angle, off = tip.angles(points, start)
    if off.max() > UNREACHED:
        raise _unreached(table.source, at + since[0], points, off, first)
    return Log(str(table.source), at, np.zeros_like(angle), angle, period)


def _rows(
    table: Table, logs: LogSettings, positions: Sequence[str]
) -> tuple[Array, Array]:
    """Return the times of a path [s], shape (n,), and its positions [m], shape (n,
    3)."""
    time = TIME
    factor = 1.0
    if TIME not in table.names:
        time = logs.time.column
        factor = UNITS[logs.time.unit].factor
    if time not in table.names:
        hint = "a path of the tip takes times [s]"
        raise LogError(f"column {TIME} is missing", table.source, hint)
    signals = [Signal(time, "time", gain=factor)]
    signals += [Signal(name, "position") for name in positions]
    recording = table.read(signals)
    values = recording.values
    lines = np.arange(len(values)) + 1 if table.lines is None else table.lines
    lines = np.asarray(lines)[recording.rows]
    word = "line" if table.header else "row"
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0].tolist()
        where = f"{table.source}, {word} {lines[row]}, column {signals[column].name}"
        raise LogError("holds no number", where, "give times in s and positions in m")
    back = np.flatnonzero(np.diff(recording.time) <= 0)
    if len(back):
        where = f"{table.source}, {word} {lines[back[0] + 1]}, column {time}"
        hint = "each row must be later than the row before"
        raise LogError("times do not increase", where, hint)
    if len(values) < 2:
        raise LogError("holds no path", table.source, "give two rows at least")
    where = f"{table.source}, {word} {lines[-1]}, column {time}"
    _refuse_long(recording.time, logs.period_s, where)
    return recording.time, values[:, 1:]


def _refuse_long(time: Array, period: float, where: str) -> None:
    """Raise a LogError where a path, (n,) [s], has too many samples of a period."""
    duration = float(time[-1] - time[0])
    if duration / period > MOST_SAMPLES:
        what = (
            f"the path lasts {duration:.4g} s, {duration / period:.3g} samples of {period:g} s; "
            f"at most {MOST_SAMPLES:,} are computed"
        )
        hint = "check the unit of the times, cut the path, or raise log.period_s"
        raise LogError(what, where, hint)


def spelt(point: Array) -> str:
    """Return a point [m], (3,), as messages have it."""
    x, y, z = point.tolist()
    return f"x {x:.3f}, y {y:.3f}, z {z:.3f} m"


def _unreached(
    source: str, time: Array, points: Array, off: Array, first: Array
) -> LogError:
    """Return the error of a path that the tip cannot follow: its worst point, and where
    the tip starts."""
    worst = int(np.argmax(off))
    missed = int(np.sum(off > UNREACHED))
    what = (
        f"the tip cannot reach {spelt(points[worst])} at {time[worst]:.4g} s: "
        f"it stays {off[worst]:.3g} m away, the worst of {missed} samples out of reach"
    )
    hint = f"only joints with commands move; the tip starts at {spelt(first)}"
    return LogError(what, source, hint)
