"""Tests of what a fit takes for granted: which way an angle counts, and which columns
are whose.

Gravity slows what lifts and speeds up what lowers. So a joint's speed follows its
command, late and unevenly, times what its lever arm and the pump do, less a part in
proportion to the load: the torque that holds the arm in its pose. This law is linear in
its unknowns, and needs no simulation. Where the angle of a joint counts the wrong way,
the loads are those of other poses. With n independent samples, and sums of squares S
and S' of what the laws of all joints leave, the logs make a joint turned round more
likely by (S / S')^(n/2).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations

import mujoco
import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, independent_samples, record
from hydroid.findings import Finding
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

ENOUGH = 6.0  # evidence that names a joint: turned round is 400 times as likely
LOWER = 0.99
"""part of the laws' rms error, on geometric average,
that turning a joint round must leave at most"""
FOLLOWED = 0.2
"""by how much a joint's speed must correlate better with another joint's command than
with its own"""
PERIOD = 0.05  # between samples [s]
WINDOW = 0.2  # over which speeds and commands are averaged [s]
LATEST = 0.8  # from a command to its effect at most [s]
TAPS = (0.0, 0.1, 0.2, 0.3, 0.4)  # between the commands that a speed follows [s]
# of the piecewise linear effect of each of them [%]
KNOTS = np.linspace(-100.0, 100.0, 11)
FROM_STOPS = 0.02  # angle from a stop above which a sample counts [rad]
FROM_ZERO = 3.0  # largest command above which a sample counts [%]
TINY = np.finfo(float).tiny


@record
class _Motion:
    """What logs show in n short windows.

    Attributes:
        joints: those that a log drives and all measure, 0-based.
        period: from the beginning of a window to that of the next one [s].
        speed: of all joints [rad/s], shape (n, J).
        angle: of all joints [rad], shape (n, J).
        commands: of each log, the means over its m windows [%], shape (m, J).
    """

    joints: list[int]
    period: float
    speed: Array
    angle: Array
    commands: Sequence[Array]

    def command(self, joint: int, earlier: int) -> Array:
        """Return a joint's commands some windows earlier, shape (n,)."""
        delayed = list[Array]()
        for commands in self.commands:
            padded = np.pad(commands[:, joint], (earlier, 0), "edge")
            delayed.append(padded[: len(commands)])
        return np.concatenate(delayed)

    def follows(self, joint: int, other: int) -> tuple[float, int]:
        """Return how a joint's speed correlates with a joint's command, and after how
        many windows it does most."""
        # about their means: where both drift, neither follows the other
        own = self.speed[:, joint]
        speed = own - own.mean()
        correlations = list[tuple[float, int]]()
        for lag in range(round(LATEST / self.period) + 1):
            command = self.command(other, lag)
            command -= command.mean()
            size = np.linalg.norm(command) * np.linalg.norm(speed)
            # of equal ones the earliest
            correlations.append((abs(command @ speed) / max(size, TINY), -lag))
        best, negative_lag = max(correlations)
        return best, -negative_lag


def doubts(settings: FitSettings, logs: Sequence[Log]) -> dict[int, float]:
    """Return the joints (number, from 1) whose logged angle counts the wrong way,
    with the evidence for it.

    The clearest comes first. Stage 1 has no law of speed.
    """
    motion = _motion(settings, logs)
    laws = dict[int, Law]()
    for joint in motion.joints:
        if settings.stage == "hyd" and joint + 1 in settings.outputs:
            law = _law(settings, motion, joint)
            if law is not None:
                laws[joint] = law
    loads_of = _Loads(settings, motion.angle)

    def left(turned: int | None = None) -> list[Array]:
        """Return what each law leaves of its joint's speeds, with one joint turned
        round."""
        loads = loads_of(turned)
        return [law(loads[:, joint]) for joint, law in laws.items()]

    before = left()
    sizes_before = _sizes(before)
    samples = [float(independent_samples(rest[:, None])[0]) for rest in before]
    doubted = dict[int, float]()
    for joint in laws:
        gains = np.log(sizes_before / _sizes(left(joint)))
        evidence = float(np.dot(samples, gains))
        if evidence >= ENOUGH and gains.mean() > -np.log(LOWER):
            doubted[joint + 1] = evidence
    return dict(sorted(doubted.items(), key=lambda entry: -entry[1]))


def _sizes(rows: Sequence[Array]) -> Array:
    """Return the lengths of rows, shape (n,)."""
    return np.array([float(np.linalg.norm(row)) for row in rows])


class _Loads:
    """The torques that hold an arm in the poses of a motion, shape (n, J) [N·m]."""

    def __init__(self, settings: FitSettings, angle: Array) -> None:
        self._model = load_model(settings.arm).compile()
        self._data = mujoco.MjData(self._model)
        self._numbers = np.arange(len(settings.arm.joints))
        self._angle = angle

    def __call__(self, turned: int | None) -> Array:
        """Return the torques where the angle of one joint (0-based) counts the wrong
        way."""
        signs = np.where(self._numbers == turned, -1.0, 1.0)
        poses = signs * self._angle
        loads = np.empty_like(self._angle)
        for pose, load in zip(poses, loads, strict=True):
            self._data.qpos[:] = pose
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_rne(self._model, self._data, 0, load)
        loads *= signs
        return loads


def exchanged(
    settings: FitSettings, logs: Sequence[Log]
) -> tuple[tuple[int, int], ...]:
    """Return pairs of joints (numbers, from 1) each of which follows the other's
    command, not its own."""
    motion = _motion(settings, logs)

    def prefers(joint: int, other: int) -> bool:
        own, _ = motion.follows(joint, joint)
        others, _ = motion.follows(joint, other)
        return others > own + FOLLOWED

    pairs = list[tuple[int, int]]()
    for first, second in combinations(motion.joints, 2):
        if prefers(first, second) and prefers(second, first):
            pairs.append((first + 1, second + 1))
    return tuple(pairs)


def assumption_findings(
    settings: FitSettings, logs: Sequence[Log], doubted: Mapping[int, float]
) -> Iterator[Finding]:
    """Yield what the logs contradict, by the joints' names; `doubted`: what `doubts`
    returns."""
    names = settings.arm.joint_names
    for j, k in exchanged(settings, logs):
        yield Finding("columns exchanged", "warning", (names[j - 1], names[k - 1]))
    for joint, evidence in doubted.items():
        yield Finding(
            "sign doubted", "warning", (names[joint - 1],), {"evidence": evidence}
        )


def _motion(settings: FitSettings, logs: Sequence[Log]) -> _Motion:
    """Return the motion in all logs that are long enough and show the pose;
    what is not driven may be unmeasured."""
    sample = logs[0].period
    step = max(round(PERIOD / sample), 1)
    period = step * sample
    width = step * max(round(WINDOW / period), 1)
    pose = settings.arm.pose(settings.start_pose)
    longest = 2 * LATEST + WINDOW
    usable = [
        log
        for log in logs
        if log.duration > longest and log.has_angle[log.driven].all()
    ]
    if not usable:
        return _Motion([], period, pose[None], pose[None], ())
    speeds = list[Array]()
    angles = list[Array]()
    commands = list[Array]()
    for log in usable:
        angle = np.where(log.has_angle, log.angle, pose)
        begin = angle[:-width:step]
        end = angle[width::step]
        speeds.append((end - begin) / (width * log.period))
        angles.append((end + begin) / 2)
        # means over windows, by the differences of a running sum
        from_zero = np.pad(log.command, ((1, 0), (0, 0)))
        total = np.cumsum(from_zero, axis=0)
        at_end = total[width:-1:step]
        at_begin = total[: -width - 1 : step]
        commands.append((at_end - at_begin) / width)
    driven = np.any([log.driven for log in usable], axis=0)
    measured = np.all([log.has_angle for log in usable], axis=0)
    joints = np.flatnonzero(driven & measured).tolist()
    return _Motion(
        joints, period, np.concatenate(speeds), np.concatenate(angles), tuple(commands)
    )


Law = Callable[[Array], Array]
"""what a joint's law leaves of its speeds, (m,), by the loads in all windows, (n,)"""


def _law(settings: FitSettings, motion: _Motion, joint: int) -> Law | None:
    """Fit a joint's law of speed; None where it moves too little."""
    commands = _late_commands(motion, joint)
    # infinite where a joint turns on: its angles count on, too
    low, high = settings.arm.stops(joint + 1)
    angle = motion.angle[:, joint]
    used = (angle > low + FROM_STOPS) & (angle < high - FROM_STOPS)
    used &= np.abs(commands).max(axis=1) > FROM_ZERO
    if not used.any():
        return None
    angle = angle[used]
    speeds = motion.speed[used]
    rows = _by_command(commands[used])
    own = speeds[:, joint]
    windows, unknown = rows.shape
    if windows < 2 * unknown or not own.any():
        return None
    # the speed by the commands alone; lever arm and pump then change it by a factor
    by_commands = np.linalg.lstsq(rows, own)[0]
    speed = rows @ by_commands
    off_centre = angle - angle.mean()
    others = speeds[:, [k for k in motion.joints if k != joint]]
    # the pump gives the others oil whichever way they move, but not the same amount
    rising = np.maximum(others, 0)
    falling = np.minimum(others, 0)
    factors = np.column_stack([off_centre, off_centre**2, rising, falling])
    unknowns = np.hstack([rows, speed[:, None] * factors])
    basis, sizes, _ = np.linalg.svd(unknowns, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    rest = own - basis @ (basis.T @ own)

    def left(load: Array) -> Array:
        """A load slows what lifts it; it cannot do the contrary."""
        effect = -np.abs(speed) * load[used]
        # what commands, lever and pump explain is not the load's
        effect -= basis @ (basis.T @ effect)
        agreeing = max(effect @ rest, 0.0)
        factor = agreeing / max(effect @ effect, TINY)
        return rest - factor * effect

    return left


def _late_commands(motion: _Motion, joint: int) -> Array:
    """Return a joint's commands TAPS before each window, about the delay that fits
    best, (n, TAPS)."""
    taps = [round(tap / motion.period) for tap in TAPS]
    _, delay = motion.follows(joint, joint)
    first = max(delay - taps[-1] // 2, 0)
    commands = [motion.command(joint, first + tap) for tap in taps]
    return np.stack(commands, axis=1)


def _by_command(commands: Array) -> Array:
    """Return what each of KNOTS contributes to a speed that is piecewise linear in
    commands, (n, k).

    Knots that few windows are near to are left out.
    """
    apart = KNOTS[1] - KNOTS[0]
    distance = np.abs(commands[:, :, None] - KNOTS) / apart
    # hats: 1 at a knot, 0 from its neighbours on
    rows = np.maximum(1 - distance, 0).reshape(len(commands), -1)
    near = rows.sum(axis=0) > 3
    return rows[:, near]
