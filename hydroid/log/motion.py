"""How a joint moves in a log: how far and fast, which way, how long after its command,
above which one."""

from functools import cached_property, lru_cache

import numpy as np

from hydroid.arrays import Array, record
from hydroid.log.log import Log

# standard deviations of the Gaussians [s]; the slow one leaves no sensor noise
QUICK, SLOW = 0.05, 0.25
LEAST_PATH = 3.0  # [deg] that tell a direction
# of the path goes against the command: it is logged the other way around
AGAINST = 0.75
END = 0.02  # part of a joint's travel that counts as its end
MOVING = 0.2  # part of a joint's speed above which it moves
UNASKED_AFTER = 1.5
"""how long after a command a joint may still move by it [s]"""
TARGET, VALVE, TARGET_WITHIN = 0.98, 0.7, 1.0
"""least correlation of a target with the angle, largest one with its speed, and by how
much it leads [s]"""
LEAST_PUSH, LEAST_FROZEN = 20.0, 0.75
"""command [%], and how long it must last [s], that would move a joint whose angle does
not change"""


@record
class JointMotion:
    """What a log says of one measured joint (number, from 1)."""

    log: Log
    joint: int

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Its least and largest angle but for the noise [rad]."""
        return self._slow[1].min(), self._slow[1].max()

    @cached_property
    def travel(self) -> float:
        """Range of its angle but for the noise [deg]."""
        return np.rad2deg(np.ptp(self._slow[1]))

    @cached_property
    def speed(self) -> float:
        """At which it moves when it moves [rad/s]: what its valves let through."""
        return np.percentile(np.abs(self._quick[2]), 95)

    @cached_property
    def push(self) -> float:
        """Time integral of its strong commands, past the dead band of a valve [% s]."""
        size = np.abs(self._logged)
        return np.where(size > 30, size, 0.0).sum() * self.log.period

    @cached_property
    def directed(self) -> tuple[float, float]:
        """Its way under strong commands [deg], and the share of this against them; 0 if
        it is too short."""
        late = round(0.25 / self.log.period)  # of valve and oil
        command, _, speed = self._slow
        command, steps = (
            command[: len(command) - late],
            np.rad2deg(speed[late:]) * self.log.period,
        )
        strong = np.abs(command) > 0.3 * np.abs(self._logged).max()
        path = np.abs(steps[strong]).sum()
        against = np.abs(steps[strong & (steps * command < 0)]).sum()
        return (path, against / path) if path >= LEAST_PATH else (path, 0.0)

    def contradicts(self, *, backward: bool) -> bool:
        """Whether it clearly moves against the direction that the arm gives to a
        positive command.

        That is to negative angles of a joint that is `backward`, and else to positive
        ones.
        """
        path, against = self.directed
        if backward:
            return path >= LEAST_PATH and against < 1 - AGAINST
        return against > AGAINST

    @cached_property
    def likely_lag(self) -> float:
        """At which its speed correlates best with its command [s], from 0 to 0.8."""
        return self._following.argmax() * self.log.period

    @cached_property
    def ahead(self) -> float:
        """How long it moves before its command, up to 0.5 s; 0 where the log does not
        tell.

        The speed must follow the later command clearly, and any command before it
        clearly less.
        """
        if self.log.duration < 5:
            return 0.0
        period = self.log.period
        before = _correlations(self._quick[2], self._logged, round(0.5 / period) + 1)
        best, most = before.argmax() * period, before.max()
        clear = most > 0.8 and 1 - most**2 < 0.75 * (1 - self._following.max() ** 2)
        return best if clear and 0.02 < best < 0.5 - period / 2 else 0.0

    @cached_property
    def dead_band(self) -> float:
        """Command that best parts the samples in which it stands from those in which it
        moves, about [%].

        Every 5 % more must explain a thousandth of the samples, else few of them
        decide.
        """
        late = round(self.likely_lag / self.log.period)
        size, moves = np.abs(self._logged), np.abs(self._quick[2]) > 0.1 * self.speed
        size, moves = size[: len(size) - late], moves[late:]
        cost = [np.mean(moves == (size < 5 * k)) + 0.001 * k for k in range(20)]
        return 5.0 * int(np.argmin(cost))

    def held(self, sign: int) -> Array:
        """Angle [rad] and command [%], (2, n), of the samples in which it stands,
        pushed up (1) or down (-1).

        By a command that is larger than most of those that move it: a joint also stands
        while its command is in the dead band. Less than a second of it may be lateness.
        """
        command, angle, speed = self._slow
        push, fast = sign * command * np.sign(command @ speed), np.abs(speed)
        enough = 0.99 * np.median(np.abs(command[fast >= 0.1 * fast.max()]))
        return np.stack([angle, command])[
            :, (fast < 0.03 * fast.max()) & (push > enough)
        ]

    @cached_property
    def frozen(self) -> tuple[float, float] | None:
        """From when to when its angle stands to the last digit although it is driven
        [s]; None: it does not.

        By commands that else move it, and not at an end of its travel, unless they push
        it off there too; for much longer than its sensor gives the same reading
        elsewhere.
        """
        angle, command, period = (
            self.log.angle[:, self.joint - 1],
            self._logged,
            self.log.period,
        )
        steps = np.abs(np.diff(angle))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], steps == 0, [0]])))
        begins, ends = edges[::2], edges[1::2]
        moves = np.abs(command[:-1])[steps > MOVING * np.percentile(steps, 95)]
        if not len(begins) or not len(moves):
            return None
        enough = max(LEAST_PUSH, np.percentile(moves, 25))
        longest = int(np.argmax(ends - begins))
        begin, end = int(begins[longest]), int(ends[longest])
        other = np.delete(ends - begins, longest).max(initial=0)
        pushes = command[begin:end][np.abs(command[begin:end]) >= enough]
        place = (angle[begin] - angle.min()) / np.ptp(angle)
        at_end = not END < place < 1 - END and np.all(
            np.sign(pushes) == np.sign(pushes[:1])
        )
        if at_end or len(pushes) * period < LEAST_FROZEN or end - begin < 3 * other:
            return None
        return begin * period, end * period

    @cached_property
    def unasked(self) -> tuple[float, float]:
        """Its way upwards and downwards while no command has been given for a while
        [deg].

        Only what is as quick as a valve moves it: an arm that leaks sinks slowly.
        """
        period = self.log.period
        given = np.flatnonzero(self._logged)
        if not len(given):
            return 0.0, 0.0
        samples = np.arange(len(self._logged))
        last = given[np.searchsorted(given, samples, side="right") - 1]
        idle = (samples < given[0]) | (samples - last > UNASKED_AFTER / period)
        speed = self._slow[2]
        moves = np.flatnonzero(idle & (np.abs(speed) > MOVING * self.speed))
        steps = np.rad2deg(speed[moves]) * period
        return float(steps.clip(0).sum()), float(-steps.clip(None, 0).sum())

    @cached_property
    def is_target(self) -> bool:
        """Whether its command is where it shall be, which its angle follows, and no
        opening of a valve."""
        if (
            self.log.duration < 5
            or not np.ptp(self._logged)
            or self.travel < LEAST_PATH
        ):
            return False
        lags = min(round(TARGET_WITHIN / self.log.period), len(self._logged) // 2)
        follows = _correlations(self._logged, self._slow[1], lags)
        return (
            follows.max(initial=0.0) > TARGET
            and self._following.max(initial=0.0) < VALVE
        )

    @property
    def _logged(self) -> Array:
        return self.log.command[:, self.joint - 1]

    @cached_property
    def _following(self) -> Array:
        return _correlations(self._logged, self._quick[2], round(0.8 / self.log.period))

    @property
    def _quick(self) -> tuple[Array, ...]:
        return _smoothed(self.log, self.joint, QUICK)

    @property
    def _slow(self) -> tuple[Array, ...]:
        return _smoothed(self.log, self.joint, SLOW)


@lru_cache(maxsize=2)  # a long log's signals are large
def _smoothed(log: Log, joint: int, seconds: float) -> tuple[Array, ...]:
    """Return command [%], angle [rad] and speed [rad/s], each (T,), behind a
    Gaussian."""
    width = seconds / log.period
    command, angle = log.command[:, joint - 1], log.angle[:, joint - 1]
    reach = int(4 * width + 0.5)
    at = np.arange(-reach, reach + 1)
    bell = np.exp(-0.5 * (at / width) ** 2)
    bell /= bell.sum()
    slope = -at / width**2 * bell / log.period
    return tuple(
        np.convolve(np.pad(signal, reach, "symmetric"), by, "valid").astype(np.float64)
        for signal, by in ((command, bell), (angle, bell), (angle, slope))
    )


def _correlations(leading: Array, following: Array, most: int) -> Array:
    """Return the size of the correlation of a signal with an earlier one, by lag below
    `most` samples."""
    n = len(leading)
    with np.errstate(all="ignore"):
        pairs = (
            (leading[: n - lag], following[lag:]) for lag in range(min(most, n // 2))
        )
        return np.nan_to_num(np.abs([np.corrcoef(*pair)[0, 1] for pair in pairs]))


motion_of = lru_cache(maxsize=64)(JointMotion)
"""returns the motion of a measured joint (number, from 1); all that ask share what it
has computed"""


def driven_joints(log: Log) -> dict[int, JointMotion]:
    """Return the motions of the joints that are driven and measured, by number."""
    return {
        j: motion_of(log, j)
        for j in (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    }
