"""Tests of what a fit takes for granted: which way an angle counts, and which columns are whose.

Gravity slows what lifts and speeds up what lowers. So a joint's speed follows its command, late and
unevenly, times what its lever arm and the pump do, less a part in proportion to the load: the
torque that holds the arm in its pose. This law is linear in its unknowns, and needs no simulation.
Where the angle of a joint counts the wrong way, the loads are those of other poses. With n
independent samples, and sums of squares S and S' of what the laws of all joints leave,
the logs make a joint turned round more likely by (S / S')^(n/2).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

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
PERIOD, WINDOW, LATEST = 0.05, 0.2, 0.8
"""of the samples; over which speeds and commands are averaged;
from a command to its effect at most [s]"""
TAPS = (0.0, 0.1, 0.2, 0.3, 0.4)  # between the commands that a speed follows [s]
KNOTS = np.linspace(-100.0, 100.0, 11)  # of the piecewise linear effect of each of them [%]
FROM_STOPS, FROM_ZERO = 0.02, 3.0
"""angle from a stop [rad], and largest command [%], above which a sample counts"""
TINY = np.finfo(float).tiny


@record
class _Motion:
    """What logs show in short windows: speeds [rad/s] and angles [rad] of all joints, shape (n, J).

    joints: those that a log drives and all measure, 0-based. commands: means of each log's, shape
    (m, J) [%], over windows that begin `period` [s] after each other.
    """

    joints: list[int]
    period: float
    speed: Array
    angle: Array
    commands: Sequence[Array]

    def command(self, joint: int, earlier: int) -> Array:
        """A joint's commands some windows earlier, shape (n,)."""
        return np.concatenate(
            [np.pad(one[:, joint], (earlier, 0), "edge")[: len(one)] for one in self.commands]
        )

    def follows(self, joint: int, other: int) -> tuple[float, int]:
        """How a joint's speed correlates with a joint's command,
        and the windows after which it does most."""
        speed, found = self.speed[:, joint] - self.speed[:, joint].mean(), list[tuple[float, int]]()
        for late in range(round(LATEST / self.period) + 1):
            command = self.command(other, late)
            command -= command.mean()
            size = np.linalg.norm(command) * np.linalg.norm(speed)
            found.append((abs(command @ speed) / max(size, TINY), -late))
        best, late = max(found)
        return best, -late


def doubts(settings: FitSettings, logs: Sequence[Log]) -> dict[int, float]:
    """Return the joints (number, from 1) whose logged angle counts the wrong way,
    with the evidence for it.

    The clearest comes first. Stage 1 has no law of speed.
    """
    motion, laws = _motion(settings, logs), dict[int, Callable[[Array], Array]]()
    for joint in motion.joints:
        if settings.stage == "hyd" and joint + 1 in settings.outputs:
            laws |= _law(settings, motion, joint)
    model, numbers = load_model(settings.arm).compile(), np.arange(len(settings.arm.joints))
    data = mujoco.MjData(model)

    def left(turned: int | None = None) -> list[Array]:
        signs = np.where(numbers == turned, -1.0, 1.0)
        poses, loads = signs * motion.angle, np.empty_like(motion.angle)
        for pose, load in zip(poses, loads, strict=True):  # what holds the arm
            data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_rne(model, data, 0, load)
        loads *= signs
        return [law(loads[:, joint]) for joint, law in laws.items()]

    before, found = left(), dict[int, float]()
    samples = [float(independent_samples(one[:, None])[0]) for one in before]
    for joint in laws:
        sizes = np.array([[np.linalg.norm(one) for one in each] for each in (before, left(joint))])
        gains = np.log(sizes[0] / sizes[1])
        evidence = float(np.dot(samples, gains))
        if evidence >= ENOUGH and gains.mean() > -np.log(LOWER):
            found[joint + 1] = evidence
    return dict(sorted(found.items(), key=lambda one: -one[1]))


def exchanged(settings: FitSettings, logs: Sequence[Log]) -> tuple[tuple[int, int], ...]:
    """Return pairs of joints (numbers, from 1) each of which follows the other's command,
    not its own."""
    motion = _motion(settings, logs)
    follows = {(j, k): motion.follows(j, k)[0] for j in motion.joints for k in motion.joints}
    prefers = {(j, k) for (j, k), size in follows.items() if size > follows[j, j] + FOLLOWED}
    return tuple((j + 1, k + 1) for j, k in sorted(prefers) if j < k and (k, j) in prefers)


def assumption_findings(
    settings: FitSettings, logs: Sequence[Log], doubted: Mapping[int, float]
) -> Iterator[Finding]:
    """Yield what the logs contradict, by the joints' names; `doubted`: what `doubts` returns."""
    names = settings.arm.joint_names
    for j, k in exchanged(settings, logs):
        yield Finding("columns exchanged", "warning", (names[j - 1], names[k - 1]))
    for joint, evidence in doubted.items():
        yield Finding("sign doubted", "warning", (names[joint - 1],), {"evidence": evidence})


def _motion(settings: FitSettings, logs: Sequence[Log]) -> _Motion:
    """The motion in all logs that are long enough and show the pose;
    what is not driven may be unmeasured."""
    step = max(round(PERIOD / logs[0].period), 1)
    period, pose = step * logs[0].period, settings.arm.pose(settings.start_pose)
    width, windows = step * max(round(WINDOW / period), 1), list[tuple[Array, ...]]()
    logs = [log for log in logs if log.duration > 2 * LATEST + WINDOW and log.measured[log.driven].all()]
    for log in logs:
        angle = np.where(log.measured, log.angle, pose)
        begin, end = angle[:-width:step], angle[width::step]
        total = np.cumsum(np.pad(log.command, ((1, 0), (0, 0))), axis=0)
        command = (total[width:-1:step] - total[: -width - 1 : step]) / width
        windows.append(((end - begin) / (width * log.period), (end + begin) / 2, command))
    if not windows:
        return _Motion([], period, pose[None], pose[None], ())
    driven, measured = (np.array([getattr(log, what) for log in logs]) for what in ("driven", "measured"))
    speed, angle, commands = zip(*windows, strict=True)
    joints = np.flatnonzero(driven.any(axis=0) & measured.all(axis=0)).tolist()
    return _Motion(joints, period, np.concatenate(speed), np.concatenate(angle), commands)


def _law(settings: FitSettings, motion: _Motion, joint: int) -> dict[int, Callable[[Array], Array]]:
    """What a joint's law leaves of its speeds, by loads, shape (n,);
    nothing where it moves too little."""
    taps = [round(tap / motion.period) for tap in TAPS]
    first = max(motion.follows(joint, joint)[1] - taps[-1] // 2, 0)
    commands = np.stack([motion.command(joint, first + tap) for tap in taps], axis=1)
    angle, (low, high) = motion.angle[:, joint], settings.arm.joints[joint].limits
    used = (angle > low + FROM_STOPS) & (angle < high - FROM_STOPS)
    used &= np.abs(commands).max(axis=1) > FROM_ZERO
    angle, speeds = angle[used], motion.speed[used]
    hats = np.maximum(1 - np.abs(commands[used, :, None] - KNOTS) / (KNOTS[1] - KNOTS[0]), 0)
    rows = hats.reshape(len(hats), -1)
    rows = rows[:, rows.sum(axis=0) > 3]
    if len(rows) < 2 * rows.shape[1] or not speeds[:, joint].any():
        return {}
    speed = rows @ np.linalg.lstsq(rows, speeds[:, joint])[0]
    off, others = angle - angle.mean(), speeds[:, [k for k in motion.joints if k != joint]]
    factors = np.column_stack([off, off**2, np.maximum(others, 0), np.minimum(others, 0)])
    basis, sizes, _ = np.linalg.svd(np.hstack([rows, speed[:, None] * factors]), full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    rest = speeds[:, joint] - basis @ (basis.T @ speeds[:, joint])

    def left(load: Array) -> Array:
        """A load slows what lifts it; it cannot do the contrary."""
        effect = -np.abs(speed) * load[used]
        effect -= basis @ (basis.T @ effect)
        return rest - max(effect @ rest, 0.0) / max(effect @ effect, TINY) * effect

    return {joint: left}
