"""How a joint moves in a log: how far and fast, which way, how long after its command,
above which one."""

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np

from hydroid.arrays import Array, Limits, Mask, record
from hydroid.log.log import LEAST_COMMAND, Log

QUICK = 0.05
"""standard deviation of the Gaussian behind which speeds are read [s]"""
SLOW = 0.25
"""standard deviation of the Gaussian that leaves no sensor noise [s]"""
LEAST_PATH = 3.0
"""[deg] that tell a direction"""
AGAINST = 0.75
"""part of the path against the command from which it is logged the other way around"""
END = 0.02
"""part of a joint's travel that counts as its end"""
MOVING = 0.2
"""part of a joint's speed above which it moves"""
USUAL_LATENESS = 0.25
"""how much later than its command a joint moves, by valve and oil [s]"""
LONGEST_LAG = 0.8
"""that is looked for [s]"""
LONGEST_LEAD = 0.5
"""of an angle before its command that is looked for [s]"""
SHORTEST_LOG = 5.0
"""[s] in which a correlation says something"""
UNASKED_AFTER = 1.5
"""how long after a command a joint may still move by it [s]"""
TARGET = 0.98
"""least correlation of a target with the angle"""
VALVE = 0.7
"""largest correlation of a target with the angle's speed"""
TARGET_WITHIN = 1.0
"""by how much a target leads the angle at most [s]"""
USUAL_WAY = 0.7
"""part of a joint's way that it covers at its usual speed or slower"""
LEAST_PUSH = 20.0
"""command that would move a joint whose angle does not change [%]"""
LEAST_FROZEN = 0.75
"""how long such a command must last [s]"""


@record
class JointMotion:
    """What a log says of one measured joint (number, from 1)."""

    log: Log
    joint: int

    @cached_property
    def reach(self) -> Limits:
        """Its least and largest angle but for the noise [rad]."""
        return self._slow[1].min(), self._slow[1].max()

    @cached_property
    def travel(self) -> float:
        """Range of its angle but for the noise [deg]."""
        return np.rad2deg(np.ptp(self._slow[1]))

    @cached_property
    def speed(self) -> float:
        """At which it moves when it moves [rad/s]: it covers USUAL_WAY of its way no
        faster. How long it rests does not matter."""
        speeds = np.sort(np.abs(self._quick[2]))
        way = np.cumsum(speeds)
        return float(speeds[np.searchsorted(way, USUAL_WAY * way[-1])])

    @cached_property
    def push(self) -> float:
        """Time integral of its strong commands, past the dead band of a valve [% s]."""
        size = np.abs(self._logged)
        strong = np.where(size > 30, size, 0.0)
        return strong.sum() * self.log.period

    @cached_property
    def directed(self) -> tuple[float, float]:
        """Its way under strong commands [deg], and the share of this against them; 0 if
        it is too short."""
        lag = round(USUAL_LATENESS / self.log.period)
        smooth_command, _, speed = self._slow
        command = smooth_command[: len(smooth_command) - lag]
        steps = np.rad2deg(speed[lag:]) * self.log.period
        strong = np.abs(command) > 0.3 * np.abs(self._logged).max()
        path = np.abs(steps[strong]).sum()
        if path < LEAST_PATH:
            return path, 0.0
        against = np.abs(steps[strong & (steps * command < 0)]).sum()
        return path, against / path

    def contradicts(self, *, backward: bool) -> bool:
        """Return whether it clearly moves against the direction that the arm gives to a
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
        if self.log.duration < SHORTEST_LOG:
            return 0.0
        period = self.log.period
        _, _, speed = self._quick
        leads = round(LONGEST_LEAD / period) + 1
        leading = _correlations(speed, self._logged, leads)
        if leading.max() <= 0.8:
            return 0.0
        # parts of the variance that the command before and after does not explain
        left = 1 - leading.max() ** 2
        left_following = 1 - self._following.max() ** 2
        if left >= 0.75 * left_following:
            return 0.0
        best = leading.argmax() * period
        # at the longest lead the correlation may rise on
        if 0.02 < best < LONGEST_LEAD - period / 2:
            return best
        return 0.0

    @cached_property
    def dead_band(self) -> float:
        """Command that best parts the samples in which it stands from those in which it
        moves, about [%].

        Every 5 % more must explain a thousandth of the samples, else few of them
        decide.
        """
        lag = round(self.likely_lag / self.log.period)
        _, _, speed = self._quick
        moves = np.abs(speed[lag:]) > 0.1 * self.speed
        size = np.abs(self._logged[: len(self._logged) - lag])
        costs = list[float]()
        for step in range(20):
            wrong = np.mean(moves == (size < 5 * step))
            costs.append(wrong + 0.001 * step)
        return 5.0 * int(np.argmin(costs))

    def held(self, sign: int) -> Array:
        """Angle [rad] and command [%], (2, n), of the samples in which it stands,
        pushed up (1) or down (-1).

        By a command that is larger than most of those that move it: a joint also stands
        while its command is in the dead band. Less than a second of it may be lateness.
        """
        command, angle, signed_speed = self._slow
        # upwards, whichever way the command is logged
        push = sign * command * np.sign(command @ signed_speed)
        speed = np.abs(signed_speed)
        moving = speed >= 0.1 * speed.max()
        enough = 0.99 * np.median(np.abs(command[moving]))
        stands = (speed < 0.03 * speed.max()) & (push > enough)
        return np.stack([angle, command])[:, stands]

    @cached_property
    def frozen(self) -> tuple[float, float] | None:
        """From when to when its angle stands to the last digit although it is driven
        [s]; None: it does not.

        By commands that else move it, and not at an end of its travel, unless they push
        it off there too; for much longer than its sensor gives the same reading
        elsewhere.
        """
        angle = self.log.angle_of(self.joint)
        command = self._logged
        period = self.log.period
        steps = np.abs(np.diff(angle))
        # stretches of equal readings begin and end where this changes
        stands = np.concatenate([[0], steps == 0, [0]])
        edges = np.flatnonzero(np.diff(stands))
        begins = edges[::2]
        lengths = edges[1::2] - begins
        moves = steps > MOVING * np.percentile(steps, 95)
        moving = np.abs(command[:-1])[moves]
        if not len(begins) or not len(moving):
            return None
        longest = int(np.argmax(lengths))
        begin = int(begins[longest])
        end = begin + int(lengths[longest])
        second_longest = np.delete(lengths, longest).max(initial=0)
        # a coarse sensor gives the same reading for long, too
        if end - begin < 3 * second_longest:
            return None
        enough = max(LEAST_PUSH, np.percentile(moving, 25))
        given = command[begin:end]
        pushes = given[np.abs(given) >= enough]
        if len(pushes) * period < LEAST_FROZEN:
            return None
        part = (angle[begin] - angle.min()) / np.ptp(angle)
        is_at_end = not END < part < 1 - END
        # a command back from the end would move it
        signs = np.sign(pushes)
        one_way = np.all(signs == signs[:1])
        if is_at_end and one_way:
            return None
        return begin * period, end * period

    @cached_property
    def unasked(self) -> tuple[float, float]:
        """Its way upwards and downwards while no command has been given for a while
        [deg].

        Only what is as quick as a valve moves it: an arm that leaks sinks slowly.
        """
        given = np.abs(self._logged) >= LEAST_COMMAND
        if not given.any():
            return 0.0, 0.0
        speed = self._slow[2]
        idle = self._without(given, UNASKED_AFTER)
        moves = idle & (np.abs(speed) > MOVING * self.speed)
        steps = np.rad2deg(speed[moves]) * self.log.period
        upwards = steps.clip(0).sum()
        downwards = -steps.clip(None, 0).sum()
        return float(upwards), float(downwards)

    @cached_property
    def sinking(self) -> tuple[float, float]:
        """Its slow way while no joint of the machine is driven [deg], and for how long
        that is [s]."""
        given: Mask = np.any(np.abs(self.log.command) >= LEAST_COMMAND, axis=1)
        idle = self._without(given, UNASKED_AFTER)
        # the speed is smoothed over a part of the next motion, too
        idle &= self._without(given[::-1], 4 * SLOW)[::-1]
        speed = self._slow[2]
        slow = idle & (np.abs(speed) <= MOVING * self.speed)
        way = np.rad2deg(speed[slow].sum()) * self.log.period
        return float(way), float(slow.sum() * self.log.period)

    def _without(self, given: Mask, seconds: float) -> Mask:
        """Return which samples have none of those `given` so many seconds before them,
        (T,)."""
        places = np.flatnonzero(given)
        samples = np.arange(len(given))
        earlier = np.searchsorted(places, samples, side="right")
        last = np.append(places, -np.inf)[earlier - 1]
        return samples - last > seconds / self.log.period

    @cached_property
    def is_target(self) -> bool:
        """Whether its command is where it shall be, which its angle follows, and no
        opening of a valve."""
        if self.log.duration < SHORTEST_LOG or self.travel < LEAST_PATH:
            return False
        if not np.ptp(self._logged):
            return False
        longest = round(TARGET_WITHIN / self.log.period)
        lags = min(longest, len(self._logged) // 2)
        _, angle, _ = self._slow
        with_angle = _correlations(self._logged, angle, lags).max(initial=0.0)
        # that with the speed takes as long again, and rarely matters
        if with_angle <= TARGET:
            return False
        with_speed = self._following.max(initial=0.0)
        return bool(with_speed < VALVE)

    def following(self, joint: int) -> float:
        """Return the correlation of its speed with an earlier command of a joint
        (number, from 1)."""
        if joint == self.joint:
            return float(self._following.max(initial=0.0))
        _, _, speed = self._quick
        lags = round(LONGEST_LAG / self.log.period)
        command = self.log.command_of(joint)
        return float(_correlations(command, speed, lags).max(initial=0.0))

    @property
    def _logged(self) -> Array:
        """Its command as logged [%]."""
        return self.log.command_of(self.joint)

    @cached_property
    def _following(self) -> Array:
        """Correlation of its speed with an earlier command, by lag."""
        _, _, speed = self._quick
        lags = round(LONGEST_LAG / self.log.period)
        return _correlations(self._logged, speed, lags)

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
    reach = int(4 * width + 0.5)
    samples = np.arange(-reach, reach + 1)
    bell = np.exp(-0.5 * (samples / width) ** 2)
    bell /= bell.sum()
    # a filter by the bell's derivative gives that of the smooth angle
    slope = -samples / width**2 * bell / log.period
    command = np.pad(log.command_of(joint), reach, "symmetric")
    angle = np.pad(log.angle_of(joint), reach, "symmetric")
    return (
        np.convolve(command, bell, "valid").astype(np.float64),
        np.convolve(angle, bell, "valid").astype(np.float64),
        np.convolve(angle, slope, "valid").astype(np.float64),
    )


def _correlations(leading: Array, following: Array, most: int) -> Array:
    """Return the size of the correlation of a signal with an earlier one, by lag below
    `most` samples."""
    samples = len(leading)
    correlations = list[float]()
    # a signal that does not change has none
    with np.errstate(all="ignore"):
        for lag in range(min(most, samples // 2)):
            pair = np.corrcoef(leading[: samples - lag], following[lag:])
            correlations.append(pair[0, 1])
        return np.nan_to_num(np.abs(correlations))


motion_of = lru_cache(maxsize=64)(JointMotion)
"""returns the motion of a measured joint (number, from 1); all that ask share what it
has computed"""


def driven_joints(log: Log) -> dict[int, JointMotion]:
    """Return the motions of the joints that are driven and measured, by number."""
    joints = (np.flatnonzero(log.driven & log.has_angle) + 1).tolist()
    return {joint: motion_of(log, joint) for joint in joints}


def stands_still(logs: Sequence[Log], joint: int) -> bool:
    """Return whether a joint (number, from 1) is driven, by commands that would move
    it, and its angle is the same to the last digit in all samples of each log."""
    if any(np.ptp(log.angle_of(joint)) != 0 for log in logs):
        return False
    pushed = [
        log.period * np.sum(np.abs(log.command_of(joint)) >= LEAST_PUSH) for log in logs
    ]
    return bool(sum(pushed) >= LEAST_FROZEN)
