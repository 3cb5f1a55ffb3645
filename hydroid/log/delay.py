"""Whether a command is shifted in time against the angle that it moves.

For each lag the joint's velocity is regressed on the command at that lag, the angle and a constant:
q̇(t) ≈ k u(t − lag) + s q(t) + c. The angle stands for springs and gravity's gradient, which turn a slow
velocity ahead of its command. All are smoothed by one Gaussian, which shifts nothing. Samples at which a
joint stands at the end of its travel, pushed further, do not count. The lag of the smallest residual is the
answer if it lies inside the range of lags and is clearly better than any lag of the opposite sign and than
the lags of a plain actuator: valve, oil and inertia alone delay the motion by a few hundredths of a second.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.log.log import Finding, Floats, Log, numbered

EARLIEST, LATEST = -0.5, 1.5  # lags tried [s]
PLAIN = (0.0, 0.1)  # lags that need no transport delay [s]
ACAUSAL = -0.02  # lags below this are more than noise [s]
SMOOTHING = 0.05  # standard deviation of the Gaussian [s]
CLEARER = 0.5  # largest ratio of the best lag's residual to that of the best plain one
MAX_RESIDUAL = 0.5  # above it command and motion do not belong together
MAX_ACAUSAL_RESIDUAL = 0.25  # motion ahead of its command takes stronger evidence
STOP_ZONE = 0.02  # part of the logged travel, at each of its ends, in which a joint may stand at a stop
STANDING = 0.03  # part of the largest speed below which it stands
FAST = 0.1  # part of the largest speed above which it moves
STOPPED = 0.2  # how long it must stand there [s]
_ROUNDING = 1e-9  # part of a sum of squares


@dataclass(frozen=True)
class Delay:
    """How a joint's motion follows its command: the lag behind it [s], and −1 if it moves against it."""

    lag: float
    sign: int


def suggest_delay(log: Log, joint: int) -> Delay | None:
    """Return the lag of a joint (number, from 1) behind its command; None where the log does not tell."""
    u, q = log.command[:, joint - 1], log.angle[:, joint - 1]
    first, last = round(EARLIEST / log.period), round(LATEST / log.period)
    used = slice(last, len(u) + first)
    if used.stop - used.start < last or np.isnan(q).any() or (u == u[0]).all() or (q == q[0]).all():
        return None
    width = SMOOTHING / log.period
    command, angle = smooth(u, width), smooth(q, width)
    speed = smooth(q, width, derivative=True)
    counts = ~_at_stop(command, angle, speed, log.period)[used]
    if counts.sum() < last:
        return None
    residual, sign = _regress(command, angle[used], speed[used], counts)
    lag = np.arange(first, last + 1) * log.period
    best = int(residual.argmin())
    allowed = MAX_RESIDUAL if lag[best] > ACAUSAL else MAX_ACAUSAL_RESIDUAL
    plain = (lag > PLAIN[0] - log.period / 2) & (lag < PLAIN[1] + log.period / 2)
    rivals = residual[(sign != sign[best]) | (plain & ~plain[best])]
    unclear = bool(rivals.size) and residual[best] >= CLEARER * rivals.min()
    if best in (0, len(lag) - 1) or residual[best] > allowed or unclear:
        return None
    return Delay(float(lag[best]), int(sign[best]))


def stands_at_stop(log: Log, joint: int) -> NDArray[np.bool_]:
    """Return where a measured joint (number, from 1) stands at an end of its travel, shape (T,).

    It must be pushed on by a command that is larger than most of those that move it: a joint also stands
    while its command is in the dead band.
    """
    width = SMOOTHING / log.period
    q = log.angle[:, joint - 1]
    command, angle = smooth(log.command[:, joint - 1], width), smooth(q, width)
    speed = smooth(q, width, derivative=True)
    moving = np.abs(speed) > FAST * np.abs(speed).max()
    enough = np.median(np.abs(command[moving])) if moving.any() else np.inf
    return _at_stop(command, angle, speed, log.period) & (np.abs(command) > 0.99 * enough)


def delay_findings(log: Log, delay_s: float, column: Callable[[int], str]) -> list[Finding]:
    """Report commands that look early or late; `column` names a joint's."""
    joints = (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    delays = {joint: delay for joint in joints if (delay := suggest_delay(log, joint))}
    early = [j for j, d in delays.items() if d.lag > PLAIN[1] + log.period / 2]
    late = [j for j, d in delays.items() if d.lag < ACAUSAL]
    findings = list[Finding]()
    if early:
        lag = float(np.median([delays[j].lag for j in early]))
        what = f"command of {numbered(early)} looks {lag:.2f} s early against the angle"
        hint = f"set log.delay_s: {delay_s + lag:.2f} if the machine has that transport delay"
        findings.append(Finding("note", what, log.source, hint, column=column(early[0]), kind="early"))
    if late:
        lag = float(np.median([delays[j].lag for j in late]))
        what = f"angle of {numbered(late)} moves {-lag:.2f} s before the command, as no machine does"
        hint = f"the log's clocks differ: mend the log, or set log.delay_s: {delay_s + lag:.2f}"
        findings.append(Finding("warning", what, log.source, hint, column=column(late[0]), kind="late"))
    return findings


def _regress(
    command: Floats, angle: Floats, speed: Floats, counts: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Regress the speed, shape (N,), on the angle, a constant and the command, (T,), shifted by each lag.

    Only samples that count enter. Returns the share of the speed's variance that is left, and the sign of the
    command's effect, by increasing lag, shape (T - N + 1,).
    """
    basis = np.linalg.qr(counts[:, None] * np.stack([np.ones_like(angle), angle], axis=1))[0]
    wanted = counts * speed
    wanted = wanted - basis @ (basis.T @ wanted)
    power = np.correlate(command**2, counts.astype(float), "valid")
    explained = sum(np.correlate(command, column, "valid") ** 2 for column in basis.T)
    own = power - explained  # of the command, what angle and constant do not explain
    product = np.correlate(command, wanted, "valid")
    enough = own > _ROUNDING * power
    match = np.zeros_like(product)
    np.divide(product**2, own * (wanted @ wanted), out=match, where=enough & (wanted @ wanted > 0))
    return 1 - match[::-1], np.sign(product)[::-1]


def _at_stop(command: Floats, angle: Floats, speed: Floats, period: float) -> NDArray[np.bool_]:
    """Where the joint stands at an end of its travel while it is pushed further, shape (T,)."""
    low, high = angle.min(), angle.max()
    zone = STOP_ZONE * (high - low)
    push = command * np.sign(command @ speed)
    ends = ((angle > high - zone) & (push > 0)) | ((angle < low + zone) & (push < 0))
    standing = ends & (np.abs(speed) < STANDING * np.abs(speed).max())
    edges = np.flatnonzero(np.diff(standing, prepend=False, append=False))
    stopped = np.zeros_like(standing)
    margin = round(2 * SMOOTHING / period)
    for begin, end in edges.reshape(-1, 2):
        if (end - begin) * period >= STOPPED:
            stopped[max(begin - margin, 0) : end + margin] = True
    return stopped


def smooth(signal: Floats, width: float, *, derivative: bool = False) -> Floats:
    """Smooth a signal by a Gaussian of `width` samples, or return the derivative of that per sample."""
    reach = int(4 * width + 0.5)
    at = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (at / width) ** 2)
    kernel /= kernel.sum()
    kernel = -at / width**2 * kernel if derivative else kernel
    return np.convolve(np.pad(signal, reach, "symmetric"), kernel, "valid").astype(np.float64)
