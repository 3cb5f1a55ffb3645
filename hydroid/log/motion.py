"""How a joint moves in a log: how far and fast, which way, how long after its command, and above which one.

The lag: for each one the joint's velocity is regressed on the command at that lag, the angle and a constant,
q̇(t) ≈ k u(t − lag) + s q(t) + c. The angle stands for springs and gravity's gradient, which turn a slow
velocity ahead of its command. All are smoothed by one Gaussian, which shifts nothing. Samples at which a
joint stands at the end of its travel, pushed further, do not count. The lag of the smallest residual is
certain if it lies inside the range of lags and is clearly better than any lag of the opposite sign and than
the lags of a plain actuator: valve, oil and inertia alone delay the motion by a few hundredths of a second.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hydroid.log.log import Floats, Log

LAGS = (-0.5, 1.5)  # lags that clocks and transport delays may have [s]
PLAIN = 0.1  # longest lag that needs no transport delay [s]
ACAUSAL = -0.02  # lags below this are more than noise [s]
QUICK, SLOW = 0.05, 0.25  # standard deviations of the Gaussians [s]; the slow one leaves no sensor noise
LEAST_PATH = 3.0  # [deg] that tell a direction
AGAINST = 0.75  # of the path goes against the command: it is logged the other way around


@dataclass(frozen=True, eq=False)
class JointMotion:
    """What a log says of one measured joint (number, from 1)."""

    log: Log
    joint: int

    @cached_property
    def travel(self) -> float:
        """Range of its angle but for the noise [deg]."""
        return float(np.rad2deg(np.ptp(self._slow[1])))

    @cached_property
    def speed(self) -> float:
        """At which it moves when it moves [rad/s]: what its valves let through."""
        return float(np.percentile(np.abs(self._quick[2]), 95))

    @cached_property
    def push(self) -> float:
        """Time integral of its strong commands, past the dead band of a valve [% s]."""
        size = np.abs(self._logged)
        return float(np.where(size > 30, size, 0.0).sum() * self.log.period)

    @cached_property
    def directed(self) -> tuple[float, float]:
        """Its way under strong commands [deg], and the share of this against them; 0 if it is too short."""
        late = round(0.25 / self.log.period)  # of valve and oil
        command, _, speed = self._slow
        command, steps = command[: len(command) - late], np.rad2deg(speed[late:]) * self.log.period
        strong = np.abs(command) > 0.3 * np.abs(self._logged).max()
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
    def likely_lag(self) -> float:
        """At which its speed correlates best with its command [s], at least 0.

        Unlike `lag` this answers always, also in a log of one movement: good enough for a first guess.
        """
        command, speed = self._logged, self._quick[2]
        lags = range(min(round(0.8 / self.log.period), len(speed) // 2))
        with np.errstate(invalid="ignore", divide="ignore"):
            pairs = ((command[: len(command) - late], speed[late:]) for late in lags)
            correlation = np.nan_to_num(np.abs([np.corrcoef(*pair)[0, 1] for pair in pairs]))
        return int(np.argmax(correlation)) * self.log.period

    @cached_property
    def lag(self) -> float | None:
        """Of the motion behind its command [s]; None where the log does not tell."""
        lags, residual, sign = self._regressed
        best = int(residual.argmin())
        # motion ahead of its command takes stronger evidence
        allowed = 0.5 if lags[best] > ACAUSAL else 0.25
        plain = np.abs(lags - PLAIN / 2) < (PLAIN + self.log.period) / 2
        rivals = residual[(sign != sign[best]) | (plain & ~plain[best])]
        clear = residual[best] <= allowed and residual[best] < 0.5 * rivals.min(initial=np.inf)
        return float(lags[best]) if clear and 0 < best < len(lags) - 1 else None

    @property
    def shifted(self) -> bool:
        """Whether its lag is none that an actuator has by itself."""
        return self.lag is not None and not ACAUSAL <= self.lag <= PLAIN + self.log.period / 2

    @cached_property
    def dead_band(self) -> float:
        """Command that best parts the samples in which it stands from those in which it moves, about [%].

        Every 5 % more must explain a thousandth of the samples, else few of them decide.
        """
        late = round(self.likely_lag / self.log.period)
        size, moves = np.abs(self._logged), np.abs(self._quick[2]) > 0.1 * self.speed
        size, moves = size[: len(size) - late], moves[late:]
        cost = [np.mean(moves == (size < 5 * k)) + 0.001 * k for k in range(20)]
        return 5.0 * int(np.argmin(cost))

    @cached_property
    def stopped(self) -> float:
        """How long it is pushed on at an end of its travel [s].

        By a command that is larger than most of those that move it: a joint also stands while its command is
        in the dead band.
        """
        command, speed = np.abs(self._quick[0]), np.abs(self._quick[2])
        moving = speed > 0.1 * speed.max()
        enough = np.median(command[moving]) if moving.any() else np.inf
        return float((self._at_stop & (command > 0.99 * enough)).sum() * self.log.period)

    @property
    def _logged(self) -> Floats:
        """The joint's command [%], shape (T,)."""
        return self.log.command[:, self.joint - 1]

    @cached_property
    def _quick(self) -> tuple[Floats, Floats, Floats]:
        return self._smoothed(QUICK)

    @cached_property
    def _slow(self) -> tuple[Floats, Floats, Floats]:
        return self._smoothed(SLOW)

    def _smoothed(self, seconds: float) -> tuple[Floats, Floats, Floats]:
        """Return command [%], angle [rad] and speed [rad/s] behind a Gaussian."""
        width, angle = seconds / self.log.period, self.log.angle[:, self.joint - 1]
        reach = int(4 * width + 0.5)
        at = np.arange(-reach, reach + 1)
        kernel = np.exp(-0.5 * (at / width) ** 2)
        kernel /= kernel.sum()
        slope = -at / width**2 * kernel / self.log.period
        pairs = ((self._logged, kernel), (angle, kernel), (angle, slope))
        padded = ((np.pad(x, reach, "symmetric"), k) for x, k in pairs)
        command, angle, speed = (np.convolve(*pair, "valid").astype(np.float64) for pair in padded)
        return command, angle, speed

    @cached_property
    def _at_stop(self) -> NDArray[np.bool_]:
        """Where it stands at an end of its travel while it is pushed further, shape (T,)."""
        command, angle, speed = self._quick
        zone = 0.02 * np.ptp(angle)
        push = command * np.sign(command @ speed)
        ends = ((angle > angle.max() - zone) & (push > 0)) | ((angle < angle.min() + zone) & (push < 0))
        standing = ends & (np.abs(speed) < 0.03 * np.abs(speed).max())
        stopped = np.zeros_like(standing)
        margin = round(2 * QUICK / self.log.period)
        for begin, end in np.flatnonzero(np.diff(standing, prepend=False, append=False)).reshape(-1, 2):
            if (end - begin) * self.log.period >= 0.2:
                stopped[max(begin - margin, 0) : end + margin] = True
        return stopped

    @cached_property
    def _regressed(self) -> tuple[Floats, Floats, Floats]:
        """Lags [s], the share of the speed's variance that each leaves, and the sign of the command's effect.

        A log that is too short, or in which nothing changes, leaves all of it.
        """
        first, last = (round(lag / self.log.period) for lag in LAGS)
        lags: Floats = np.arange(first, last + 1, dtype=np.float64) * self.log.period
        (command, angle, speed), used = self._quick, slice(last, len(self._logged) + first)
        counts = (~self._at_stop[used]).astype(float)
        if counts.sum() < last or not np.ptp(self._logged) * np.ptp(self.log.angle[:, self.joint - 1]) > 0:
            return lags, np.ones(len(lags)), np.zeros(len(lags))
        basis = np.linalg.qr(counts[:, None] * np.stack([np.ones(len(counts)), angle[used]], axis=1))[0]
        wanted = counts * speed[used]
        wanted = wanted - basis @ (basis.T @ wanted)
        power = np.correlate(command**2, counts, "valid")
        own = power - sum(np.correlate(command, column, "valid") ** 2 for column in basis.T)
        product, total = np.correlate(command, wanted, "valid"), wanted @ wanted
        enough = (own > 1e-9 * power) & (total > 0)
        explained: Floats = np.divide(product**2, own * total, out=np.zeros_like(product), where=enough)
        return lags, (1 - explained)[::-1], np.sign(product)[::-1]


@lru_cache(maxsize=64)
def motion_of(log: Log, joint: int) -> JointMotion:
    """Return the motion of a measured joint (number, from 1); all that ask share what it has computed."""
    return JointMotion(log, joint)


def driven_joints(log: Log) -> dict[int, JointMotion]:
    """Return the motions of the joints that are driven and measured, by number."""
    return {j: motion_of(log, j) for j in (np.flatnonzero(log.driven & log.measured) + 1).tolist()}
