"""How a joint moves in a log: how far and fast, which way, how long after its command, above which one."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hydroid.log.log import Floats, Log

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
        """At which its speed correlates best with its command [s], from 0 to 0.8."""
        command, speed = self._logged, self._quick[2]
        lags, n = range(min(round(0.8 / self.log.period), len(speed) // 2)), len(speed)
        with np.errstate(invalid="ignore", divide="ignore"):
            correlation = [np.corrcoef(command[: n - lag], speed[lag:])[0, 1] for lag in lags]
        return float(np.nan_to_num(np.abs(correlation)).argmax() * self.log.period)

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
        command, angle, speed = self._quick
        if not speed.any():
            return 0.0
        push, fast = command * np.sign(command @ speed), np.abs(speed) / np.abs(speed).max()
        at = (angle - angle.min()) / np.ptp(angle)
        ends = ((at > 0.98) & (push > 0)) | ((at < 0.02) & (push < 0))
        enough = 0.99 * np.median(np.abs(command[fast > 0.1]))
        return float((ends & (fast < 0.03) & (np.abs(command) > enough)).sum() * self.log.period)

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
        from scipy.ndimage import gaussian_filter1d  # costs 0.1 s, which no other command needs

        width, angle = seconds / self.log.period, self.log.angle[:, self.joint - 1]
        speed = gaussian_filter1d(angle, width, order=1) / self.log.period
        return gaussian_filter1d(self._logged, width), gaussian_filter1d(angle, width), speed


@lru_cache(maxsize=64)
def motion_of(log: Log, joint: int) -> JointMotion:
    """Return the motion of a measured joint (number, from 1); all that ask share what it has computed."""
    return JointMotion(log, joint)


def driven_joints(log: Log) -> dict[int, JointMotion]:
    """Return the motions of the joints that are driven and measured, by number."""
    return {j: motion_of(log, j) for j in (np.flatnonzero(log.driven & log.measured) + 1).tolist()}
