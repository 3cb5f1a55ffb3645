"""How a joint moves in a log: how far and fast, which way, how long after its command, and above which one.

The lag: for each one the joint's velocity is regressed on the command at that lag, the angle and a constant,
q̇(t) ≈ k u(t − lag) + s q(t) + c. The angle stands for springs and gravity's gradient, which turn a slow
velocity ahead of its command. All are smoothed by one Gaussian, which shifts nothing. Samples at which a
joint stands at the end of its travel, pushed further, do not count. The lag of the smallest residual is the
answer if it lies inside the range of lags and is clearly better than any lag of the opposite sign and than
the lags of a plain actuator: valve, oil and inertia alone delay the motion by a few hundredths of a second.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hydroid.log.log import Floats, Log

LAGS = (-0.5, 1.5)  # lags that clocks and transport delays may have [s]
LATEST = 0.8  # lag of a machine [s]
PLAIN = (0.0, 0.1)  # lags that need no transport delay [s]
ACAUSAL = -0.02  # lags below this are more than noise [s]
CLEARER = 0.5  # largest ratio of the best lag's residual to that of the best plain one
MAX_RESIDUAL = 0.5  # above it command and motion do not belong together
MAX_ACAUSAL_RESIDUAL = 0.25  # motion ahead of its command takes stronger evidence
SMOOTHING = 0.05  # standard deviation of the Gaussian [s]
SLOW_SMOOTHING = 0.25  # of that for travel and direction, which a sensor's noise must not fill [s]
STOP_ZONE = 0.02  # part of the logged travel, at each of its ends, in which a joint may stand at a stop
STANDING = 0.03  # part of the largest speed below which it stands there
STOPPED = 0.2  # how long it must [s]
FAST = 0.1  # part of the largest speed above which it moves
TOP = 95  # percentile of the speeds that counts as what the valves let through
STRONG = 30.0  # [%], past the dead band of a valve
STRONG_PART = 0.3  # of a joint's largest command, whose direction counts
RESPONSE = 0.25  # [s] of valve and oil, for the direction
LEAST_PATH = 3.0  # [deg] that tell a direction
AGAINST = 0.75  # of the path goes against the command: it is logged the other way around
STEP = 5.0  # width of a range of commands [%] in which a joint moves or does not
FEWEST = 5  # samples in such a range
_ROUNDING = 1e-9  # part of a sum of squares


@dataclass(frozen=True, eq=False)
class JointMotion:
    """What a log says of one measured joint (number, from 1)."""

    log: Log
    joint: int

    @property
    def command(self) -> Floats:
        """The joint's command [%], shape (T,)."""
        return self.log.command[:, self.joint - 1]

    @property
    def angle(self) -> Floats:
        """Its angle [rad], shape (T,)."""
        return self.log.angle[:, self.joint - 1]

    @cached_property
    def travel(self) -> float:
        """Range of its angle but for the noise [deg]."""
        return float(np.rad2deg(np.ptp(smooth(self.angle, SLOW_SMOOTHING / self.log.period))))

    @cached_property
    def speed(self) -> float:
        """At which it moves when it moves [rad/s]."""
        return float(np.percentile(np.abs(self._speed), TOP))

    @cached_property
    def push(self) -> float:
        """Time integral of its strong commands [% s]."""
        size = np.abs(self.command)
        return float(np.where(size > STRONG, size, 0.0).sum() * self.log.period)

    @cached_property
    def path(self) -> float:
        """Length of its way back and forth [deg]."""
        return float(np.rad2deg(np.abs(self._slow_speed).sum() * self.log.period))

    @cached_property
    def directed(self) -> tuple[float, float]:
        """Its way under strong commands [deg], and the share of this against them; 0 if it is too short."""
        late = round(RESPONSE / self.log.period)
        command = smooth(self.command, SLOW_SMOOTHING / self.log.period)[: len(self.command) - late]
        steps = np.rad2deg(self._slow_speed[late:]) * self.log.period
        strong = np.abs(command) > STRONG_PART * np.abs(self.command).max()
        path = float(np.abs(steps[strong]).sum())
        against = float(np.abs(steps[strong & (steps * command < 0)]).sum())
        return (path, against / path) if path >= LEAST_PATH else (path, 0.0)

    @property
    def turned(self) -> bool:
        """Whether a positive command turns it to negative angles: one is logged the other way around."""
        return self.directed[1] > AGAINST

    @property
    def straight(self) -> bool:
        """Whether it clearly moves with its command."""
        path, against = self.directed
        return path >= LEAST_PATH and against < 1 - AGAINST

    @cached_property
    def lag(self) -> float | None:
        """Of the motion behind its command [s]; None where the log does not tell."""
        lag, residual, sign = self._regress()
        best = int(residual.argmin())
        allowed = MAX_RESIDUAL if lag[best] > ACAUSAL else MAX_ACAUSAL_RESIDUAL
        half = self.log.period / 2
        plain = (lag > PLAIN[0] - half) & (lag < PLAIN[1] + half)
        rivals = residual[(sign != sign[best]) | (plain & ~plain[best])]
        unclear = bool(rivals.size) and residual[best] >= CLEARER * rivals.min()
        return None if best in (0, len(lag) - 1) or residual[best] > allowed or unclear else float(lag[best])

    @property
    def shifted(self) -> bool:
        """Whether its lag is none that an actuator has by itself."""
        return self.lag is not None and not ACAUSAL <= self.lag <= PLAIN[1] + self.log.period / 2

    def follows(self, joint: int) -> tuple[float, float]:
        """Return the largest correlation of its speed with a joint's command, and at which lag that is [s].

        Unlike `lag` this answers always, also in a log of one movement: good enough for a first guess.
        """
        command, speed = self.log.command[:, joint - 1], self._speed
        correlation = [0.0]
        for late in range(min(round(LATEST / self.log.period), len(speed) // 2)):
            pair = command[: len(command) - late], speed[late:]
            scale = float(np.std(pair[0]) * np.std(pair[1]))
            correlation.append(abs(float(np.cov(*pair, bias=True)[0, 1])) / scale if scale > 0 else 0.0)
        best = int(np.argmax(correlation))
        return correlation[best], max(best - 1, 0) * self.log.period

    @cached_property
    def dead_band(self) -> float:
        """Command up to which it stands, most of the time, about [%]."""
        late = round(self.follows(self.joint)[1] / self.log.period)
        size, speed, dead = np.abs(self.command[: len(self.command) - late]), np.abs(self._speed[late:]), 0.0
        for low in np.arange(0.0, 100.0, STEP):
            there = speed[(size >= low) & (size < low + STEP)]
            if len(there) >= FEWEST:
                if np.median(there) > FAST * self.speed:
                    break
                dead = low + STEP
        return float(dead)

    @cached_property
    def stopped(self) -> float:
        """How long it is pushed on at an end of its travel [s].

        By a command that is larger than most of those that move it: a joint also stands while its command is
        in the dead band.
        """
        command, speed = np.abs(self._command), np.abs(self._speed)
        moving = speed > FAST * speed.max()
        enough = np.median(command[moving]) if moving.any() else np.inf
        return float((self._at_stop & (command > 0.99 * enough)).sum() * self.log.period)

    @cached_property
    def _speed(self) -> Floats:
        return smooth(self.angle, SMOOTHING / self.log.period, derivative=True) / self.log.period

    @cached_property
    def _slow_speed(self) -> Floats:
        return smooth(self.angle, SLOW_SMOOTHING / self.log.period, derivative=True) / self.log.period

    @cached_property
    def _command(self) -> Floats:
        return smooth(self.command, SMOOTHING / self.log.period)

    @cached_property
    def _at_stop(self) -> NDArray[np.bool_]:
        """Where it stands at an end of its travel while it is pushed further, shape (T,)."""
        command, angle, speed = self._command, smooth(self.angle, SMOOTHING / self.log.period), self._speed
        zone = STOP_ZONE * np.ptp(angle)
        push = command * np.sign(command @ speed)
        ends = ((angle > angle.max() - zone) & (push > 0)) | ((angle < angle.min() + zone) & (push < 0))
        standing = ends & (np.abs(speed) < STANDING * np.abs(speed).max())
        stopped = np.zeros_like(standing)
        margin = round(2 * SMOOTHING / self.log.period)
        for begin, end in np.flatnonzero(np.diff(standing, prepend=False, append=False)).reshape(-1, 2):
            if (end - begin) * self.log.period >= STOPPED:
                stopped[max(begin - margin, 0) : end + margin] = True
        return stopped

    def _regress(self) -> tuple[Floats, Floats, Floats]:
        """Regress the speed on a constant, the angle, and the command shifted by each lag.

        Returns the lags [s], the share of the speed's variance that each leaves, and the sign of the
        command's effect. A log that is too short, or in which nothing changes, leaves all of it.
        """
        first, last = (round(lag / self.log.period) for lag in LAGS)
        lag: Floats = np.arange(first, last + 1).astype(np.float64) * self.log.period
        command, used = self._command, slice(last, len(self.angle) + first)
        counts = ~self._at_stop[used]
        if counts.sum() < last or np.ptp(self.command) == 0 or not np.ptp(self.angle) > 0:
            return lag, np.ones(len(lag)), np.zeros(len(lag))
        angle = smooth(self.angle, SMOOTHING / self.log.period)[used]
        basis = np.linalg.qr(counts[:, None] * np.stack([np.ones_like(angle), angle], axis=1))[0]
        wanted = counts * self._speed[used]
        wanted = wanted - basis @ (basis.T @ wanted)
        power = np.correlate(command**2, counts.astype(float), "valid")
        own = power - sum(np.correlate(command, column, "valid") ** 2 for column in basis.T)
        product, total = np.correlate(command, wanted, "valid"), wanted @ wanted
        enough = (own > _ROUNDING * power) & (total > 0)
        explained: Floats = np.divide(product**2, own * total, out=np.zeros_like(product), where=enough)
        return lag, (1 - explained)[::-1], np.sign(product)[::-1]


@lru_cache(maxsize=64)
def motion_of(log: Log, joint: int) -> JointMotion:
    """Return the motion of a measured joint (number, from 1); all that ask share what it has computed."""
    return JointMotion(log, joint)


def smooth(signal: Floats, width: float, *, derivative: bool = False) -> Floats:
    """Smooth a signal by a Gaussian of `width` samples, or return the derivative of that per sample."""
    reach = int(4 * width + 0.5)
    at = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (at / width) ** 2)
    kernel /= kernel.sum()
    kernel = -at / width**2 * kernel if derivative else kernel
    return np.convolve(np.pad(signal, reach, "symmetric"), kernel, "valid").astype(np.float64)
