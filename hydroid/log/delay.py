"""Is a command shifted in time against the angle that it moves?

For each lag the joint's velocity is regressed on the command at that lag, the angle and a constant:
q̇(t) ≈ k u(t − lag) + s q(t) + c. The angle stands for springs and gravity's gradient, which turn a slow
velocity ahead of its command; without it a sine would look acausal. All are smoothed by one Gaussian, which
is symmetric and so shifts nothing. The lag of the smallest residual is the answer, if it is clearly smaller
than what lags of a plain actuator leave: valve, oil and inertia alone lag by a few hundredths of a second.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from hydroid.log.finding import Finding
from hydroid.log.log import Floats, Log
from hydroid.settings.log import LogSettings

EARLIEST, LATEST = -0.5, 1.5  # lags tried [s]
PLAIN = (0.0, 0.1)  # lags that need no transport delay [s]
ACAUSAL = -0.02  # earlier than noise makes it [s]
SMOOTHING = 0.05  # standard deviation of the Gaussian [s]
CLEARER = 0.5  # residual of the best lag over that of the best plain one
MOST = 0.5  # residual above which command and motion do not belong together
_REST = 1e-12  # [% rad], a product of norms this small is rounding


@dataclass(frozen=True)
class Delay:
    """How a joint's motion follows its command.

    Attributes:
        lag: of the motion behind the command [s].
        strength: share of the velocity's variance that the command explains there, 0.5 to 1.
        sign: −1 if the joint moves against its command.
    """

    lag: float
    strength: float
    sign: int


def suggest_delay(log: Log, joint: int) -> Delay | None:
    """Return the lag of a joint (number, from 1) behind its command; None where the log does not tell.

    It does not if it is short, if command and motion do not belong together, or if a lag within a plain
    actuator's explains the motion about as well as the best (the command is one sine, say).
    """
    u, q = log.command[:, joint - 1], log.angle[:, joint - 1]
    first, last = round(EARLIEST / log.period), round(LATEST / log.period)
    used = slice(last, len(u) + first)
    if used.stop - used.start < last or np.isnan(q).any() or (u == u[0]).all() or (q == q[0]).all():
        return None
    width = SMOOTHING / log.period
    smooth = gaussian_filter1d(u, width)
    basis = np.linalg.qr(np.stack([np.ones(len(u)), gaussian_filter1d(q, width)], axis=1)[used])[0]
    velocity = _beyond(gaussian_filter1d(q, width, order=1)[used], basis)
    lags = np.arange(first, last + 1)
    match = np.array([_match(smooth[used.start - k : used.stop - k], basis, velocity) for k in lags])
    residual, lag = 1 - match**2, lags * log.period
    best = int(residual.argmin())
    plain = (lag > PLAIN[0] - log.period / 2) & (lag < PLAIN[1] + log.period / 2)
    if residual[best] > MOST or not (plain[best] or residual[best] < CLEARER * residual[plain].min()):
        return None
    return Delay(float(lag[best]), float(1 - residual[best]), int(np.sign(match[best])))


def delay_findings(log: Log, settings: LogSettings, column: Callable[[int], str]) -> list[Finding]:
    """Mention commands that look early, late, or of the wrong sign against the angle."""
    joints = (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    delays = {joint: delay for joint in joints if (delay := suggest_delay(log, joint))}
    early = {j: d.lag for j, d in delays.items() if d.lag > PLAIN[1] + log.period / 2}
    late = {j: d.lag for j, d in delays.items() if d.lag < ACAUSAL}
    against = [j for j, d in delays.items() if d.sign < 0]
    findings = list[Finding]()
    if early:
        lag = float(np.median(list(early.values())))
        what = f"{_named('command', list(early))} looks {lag:.2f} s early against the angle"
        hint = f"set log.delay_s: {settings.delay_s + lag:.2f} if the machine has that transport delay"
        findings.append(Finding("note", what, log.source, hint, column=column(min(early))))
    if late:
        lag = float(np.median(list(late.values())))
        what = f"{_named('angle', list(late))} moves {-lag:.2f} s before the command, as no machine does"
        hint = f"the log's clocks differ: mend the log, or set log.delay_s: {settings.delay_s + lag:.2f}"
        findings.append(Finding("warning", what, log.source, hint, column=column(min(late))))
    if against:
        what = f"{_named('angle', against)} moves against the command"
        hint = (
            "give log.command or log.angle a negative scale if the axis or the valve is logged the other way"
        )
        findings.append(Finding("warning", what, log.source, hint, column=column(min(against))))
    return findings


def _beyond(signal: Floats, basis: Floats) -> Floats:
    """What of a signal the basis does not explain."""
    return signal - basis @ (basis.T @ signal)


def _match(command: Floats, basis: Floats, velocity: Floats) -> float:
    """Partial correlation of command and velocity, -1 to 1; 0 where either is at rest."""
    rest = _beyond(command, basis)
    size = float(np.linalg.norm(rest) * np.linalg.norm(velocity))
    return float(rest @ velocity) / size if size > _REST * len(rest) else 0.0


def _named(kind: str, joints: Sequence[int]) -> str:
    numbers = ", ".join(str(joint) for joint in joints)
    return f"{kind} of joint{'' if len(joints) == 1 else 's'} {numbers}"
