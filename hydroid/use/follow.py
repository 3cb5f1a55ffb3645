"""Commands that lead an arm along angles over time: a feed-forward by inversion,
looking ahead.

The wished speeds go through the inverse of the settled speeds (`plant.steady`), earlier
by each joint's delay and lags. What valves and oil do on the way besides is learnt from
the model itself: the commands are simulated, and the speeds that are missing are added
to the wish, without the frequencies that the lags keep from being followed (iterative
learning control; D. A. Bristow, M. Tharayil, A. G. Alleyne, *A survey of iterative
learning control*, 2006). No measurement is needed for that: a model errs the same way
every time.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hydroid.arrays import Array, Index, Mask, record, rms
from hydroid.errors import LogError, SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.plant.steady import LEAST_SPEED, Limit
from hydroid.posterior.band import prediction_bands

MOST_TURNS = 15
"""simulations in which commands are learnt"""
GAINED = 0.02
"""part by which an error must fall for another turn to be worth it"""
TURNS_WITHOUT = 3
"""turns in a row without such a gain before learning ends"""
PASSED = 0.25
"""of the speeds that are missing, what is slower than so much over a joint's lags is
learnt [cycles]"""
FASTEST = 0.2
"""cutoff of what is learnt, at most [cycles per sample]"""
CATCH_UP = 0.5
"""time in which a joint that fell behind its path makes up for it, once it can [s]"""
CAUGHT_UP = 1e-4
"""distance from its path at which it has [rad]"""
QUIET = 0.005
"""part of a joint's largest wished speed below which it stands: no valve should chatter
on its dead band"""
AWAY = 0.02
"""part of its largest wished speed by which a joint must miss a wish for a span to be
named"""
AWAY_SLOW = 0.1
"""the same for wishes that are slow, which every path has where it turns round"""


@record
class Missed:
    """A span in which a joint cannot have its wished speeds, and why.

    `wished` and `had` are the speeds [rad/s], of joints that slide [m/s], where they
    differ most.
    """

    joint: int  # 0-based
    limit: Limit
    from_s: float
    to_s: float
    wished: float
    had: float


@record
class Followed:
    """Commands along a path, and what the model makes of them, over T samples of J
    joints.

    Attributes:
        log: the commands [%], with the wished angles; it may begin with a rest of
            `lead_s`. A simulation of it starts where the path begins.
        angle: that the commands give [rad], shape (T, J).
        half: of the 95 % band of this angle [rad], shape (T,), by joint (number, from
            1).
        missed: where a wish cannot be had.
        lead_s: time by which the path begins later than asked, so that commands can
            come before it [s].
        joints: that take commands, numbered from 1.
        turns: simulations in which commands were learnt.
    """

    log: Log
    angle: Array
    half: Mapping[int, Array]
    missed: tuple[Missed, ...]
    lead_s: float
    joints: tuple[int, ...]
    turns: int

    @property
    def recording(self) -> Log:
        """The log as a file has it: until the first command the joints stand where the
        path begins.

        A file's start pose is the mean of its angles before the first command; a path
        that begins slowly is already on its way by then.
        """
        angle = self.log.angle.copy()
        angle[: self.log.first_command + 1] = angle[0]
        return replace(self.log, angle=angle)

    def error(self, joint: int) -> Array:
        """Return wished minus predicted angle of a joint (number, from 1) [rad], shape
        (T,)."""
        return self.log.angle_of(joint) - self.angle[:, joint - 1]

    def rms(self, joint: int) -> tuple[float, float]:
        """Return the predicted rms error of a joint (number, from 1) [rad], and that
        within its band."""
        error = self.error(joint)
        half = self.half.get(joint)
        wide = np.inf
        if half is not None:
            wide = float(np.sqrt(np.mean(error**2 + half**2)))
        return float(rms(error)), wide


def follow(model: IdentifiedModel, path: Log, *, payload: float = 0.0) -> Followed:
    """Return commands that lead the joints along angles.

    Args:
        model: of stage 2.
        path: angles over time [rad]; joints that it does not hold rest in its `pose`.
        payload: mass at the tip [kg].

    Raises:
        LogError: a joint that takes no commands should move, or an angle is missing.
        SettingsError: a model of stage 1.
        RunError: the simulation diverged.
    """
    plant = Plant(model, payload=payload)
    if model.settings.stage != "hyd":
        raise SettingsError(
            "a gain gives torques, not speeds", model.source, "name a fit of stage 2"
        )
    _refuse_unmoved(plant, path)
    lags = joint_lags(plant)
    rested = _with_rest(path, float(lags.max(initial=0.0)))
    wished, missed = _within_range(plant, rested)
    tracker = _Tracker(plant, wished, lags)
    too_fast = tracker.missed()
    missed += too_fast
    behind = {one.joint for one in too_fast if one.limit in (Limit.FULL, Limit.PUMP)}
    if behind:
        reachable = tracker.reachable(sorted(behind))
        tracker = _Tracker(plant, replace(wished, angle=reachable), lags)
    command, angle, turns = tracker.learn()
    log = replace(wished, command=command, rest=0)
    outputs = [joint - 1 for joint in model.settings.outputs]
    bands = prediction_bands(model, log, angle[:, outputs])
    half = {joint: band.half for joint, band in bands.items() if joint in plant.joints}
    lead = (len(log.time) - len(path.time)) * path.period
    return Followed(log, angle, half, tuple(missed), lead, plant.joints, turns)


def joint_lags(plant: Plant) -> Array:
    """Return by how much joints are late [s], shape (J,): delay and lags, the mean of
    both sides."""
    actuators = plant.actuators

    def mean(quantity: str) -> Array:
        """Return the mean of both sides of a quantity, by joint."""
        return 0.5 * (actuators[f"{quantity}_a"] + actuators[f"{quantity}_b"])

    behind = actuators["opening_lag"] + mean("delay")
    behind = behind + mean("pilot_lag")
    # at half its stroke the solenoid adds as much stiffness as the spring has
    behind = behind + 0.5 * mean("plunger_damping") / actuators["plunger_stiffness"]
    # a slow motion is late behind an oscillator by twice the damping per frequency that
    # acts on the joint
    frequency = 2.0 * np.pi * actuators["oil_frequency"]
    held_back = actuators["oil_damping"] * (1.0 - actuators["oil_damping_share"])
    behind = behind + 2.0 * held_back / frequency
    lags = np.zeros(len(plant.names))
    driven = [joint - 1 for joint in plant.joints]
    lags[driven] = behind[driven]
    return lags


def _refuse_unmoved(plant: Plant, path: Log) -> None:
    """Refuse a path that moves joints without commands, or that has too few samples to
    be one."""
    if len(path.time) < 3:
        raise LogError("holds no path", path.source, "give three samples at least")
    still = np.ptp(path.posed, axis=0) < LEAST_SPEED
    for joint in np.flatnonzero(~still).tolist():
        if joint + 1 not in plant.joints:
            driven = ", ".join(plant.names[number - 1] for number in plant.joints)
            name = plant.names[joint]
            what = (
                f"joint {name} should move, but the fit gives commands to {driven} only"
            )
            hint = "leave its column out, or fit a log that drives it"
            raise LogError(what, path.source, hint)


def _with_rest(path: Log, lag: float) -> Log:
    """Return a path whose first motion leaves time for commands that come before it."""
    angle = path.posed
    period = path.period
    moves = np.flatnonzero(np.any(np.abs(angle - angle[0]) > LEAST_SPEED, axis=1))
    rests = int(moves[0]) - 1 if len(moves) else len(angle)
    more = max(int(np.ceil(lag / period)) + 1 - rests, 0)
    angle = np.concatenate([np.repeat(angle[:1], more, axis=0), angle])
    time = np.arange(len(angle), dtype=float) * period
    return Log(path.source, time, np.zeros_like(angle), angle, period)


def _within_range(plant: Plant, path: Log) -> tuple[Log, list[Missed]]:
    """Return a path clipped to the joints' ranges, and the spans that were."""
    arm = plant.identified.settings.arm
    clipped = path.angle.clip(arm.lower, arm.upper)
    missed = list[Missed]()
    for joint in range(path.joints):
        beyond = np.abs(path.angle[:, joint] - clipped[:, joint])
        if joint + 1 in plant.joints and beyond.max() > LEAST_SPEED:
            at = np.flatnonzero(beyond > LEAST_SPEED)
            wished = float(np.gradient(path.angle[:, joint], path.period)[at[0]])
            times = float(path.time[at[0]]), float(path.time[at[-1]])
            missed.append(Missed(joint, Limit.STOP, *times, wished, 0.0))
    return replace(path, angle=clipped), missed


def _named(limit: Limit | None, away: float) -> bool:
    """Return whether a reason is named where a joint misses its wish by a part of its
    largest one."""
    if limit is None:
        return False
    return away > (AWAY_SLOW if limit in (Limit.SLOWEST, Limit.LEAKS) else AWAY)


def _rates(values: Array, period: float) -> Array:
    """Return the rates of values, (T, J), until the next sample; 0 after the last."""
    last = np.zeros((1, values.shape[1]))
    return np.concatenate([np.diff(values, axis=0), last]) / period


def _runs(rows: Index) -> Iterator[Index]:
    """Yield the runs of rows that follow each other."""
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        if len(run):
            yield run


class _Tracker:
    """Learns commands along a path of one plant."""

    def __init__(self, plant: Plant, path: Log, lags: Array) -> None:
        self._plant = plant
        self._path = path
        self._lags = lags
        plant.reset(path.angle[0])
        self._steady = plant.steady()
        angle = path.angle
        # that of a command is in the middle of its step; after the last no step follows
        middle = 0.5 * (angle[1:] + angle[:-1])
        self._pose = np.concatenate([middle, angle[-1:]])
        self._speed = _rates(angle, path.period)
        self._load = self._steady.weighing.loads(self._pose)
        self._driven: Index = np.array(plant.joints) - 1
        self._waiting = self._rests_before_motion()

    def missed(self) -> list[Missed]:
        """Return the spans in which the wished speeds cannot be had as settled ones."""
        speed = self._speed
        pose = self._pose
        time = self._path.time
        command, reached = self._steady.commands(speed, pose, self._load)
        misses = np.abs(reached - speed) > self._quiet()
        rows = np.flatnonzero(np.any(misses, axis=1))
        limits = self._steady.limits(
            speed[rows], reached[rows], command[rows], pose[rows]
        )
        by_row = dict(zip(rows.tolist(), limits, strict=True))
        missed = list[Missed]()
        for joint in self._driven.tolist():
            largest = max(float(np.abs(speed[:, joint]).max()), LEAST_SPEED)
            away = np.abs(reached - speed)[:, joint] / largest
            named = [row for row in by_row if _named(by_row[row].get(joint), away[row])]
            for span in _runs(np.array(named, int)):
                worst = int(span[np.argmax(away[span])])
                missed.append(
                    Missed(
                        joint,
                        by_row[worst][joint],
                        from_s=float(time[span[0]]),
                        to_s=float(time[span[-1]]),
                        wished=float(speed[worst, joint]),
                        had=float(reached[worst, joint]),
                    )
                )
        return missed

    def reachable(self, joints: Sequence[int]) -> Array:
        """Return the path [rad], (T, J), with what joints (0-based) can reach of it
        that fall behind where their speed cannot be had.

        Later they catch up. To learn what a saturated valve misses would only repeat
        the path beside itself: the error would last until its end.
        """
        path = self._path
        angle = path.angle.copy()
        _, possible = self._steady.commands(self._speed, self._pose, self._load)
        limited = np.any(np.abs(possible - self._speed) > self._quiet(), axis=1)
        for k in range(len(angle) - 1):
            away = np.zeros(path.joints)
            away[joints] = (path.angle[k] - angle[k])[joints]
            if not limited[k] and np.abs(away).max() < CAUGHT_UP:
                continue
            wish = self._speed[k] + away / CATCH_UP
            _, reached = self._steady.commands(wish[None], angle[k][None])
            after = angle[k] + path.period * reached[0]
            angle[k + 1, joints] = after[joints]
        return angle

    def learn(self) -> tuple[Array, Array, int]:
        """Return commands [%] and the angles that they give [rad], (T, J), and the
        simulations it took."""
        wish = self._speed.copy()
        command = self._commands(wish)
        angle = self._simulate(command)
        best = (command, angle)
        least = self._size(angle)
        turns = 1
        without = 0
        while turns < MOST_TURNS and without < TURNS_WITHOUT:
            wish = wish + self._learnable(self._path.angle - angle)
            wish[self._waiting] = 0.0
            command = self._commands(wish)
            angle = self._simulate(command)
            size = self._size(angle)
            turns += 1
            without = 0 if size < (1.0 - GAINED) * least else without + 1
            if size < least:
                best = (command, angle)
                least = size
        return *best, turns

    def _rests_before_motion(self) -> Mask:
        """Return where joints stand and nothing is left to be learnt but what comes,
        (T, J).

        That is the rest before the first motion, and the second half of any other one.
        A filter without phase would otherwise begin commands earlier than the lags ask
        for, even against the motion. Joints that sag are not among them.
        """
        still = np.abs(self._speed) <= self._quiet()
        first = self._pose[:1]
        _, sag = self._steady.commands(np.zeros_like(first), first)
        waiting = np.zeros_like(still)
        for joint in self._driven.tolist():
            if np.abs(sag[0, joint]) > LEAST_SPEED:
                continue
            for rest in _runs(np.flatnonzero(still[:, joint])):
                if rest[-1] + 1 == len(still):
                    continue
                begin = 0 if rest[0] == 0 else len(rest) // 2
                waiting[rest[begin:], joint] = True
        return waiting

    def _size(self, angle: Array) -> float:
        """Rms error of the driven joints [rad]."""
        return float(rms((self._path.angle - angle)[:, self._driven]))

    def _quiet(self) -> Array:
        """Speeds of joints that count as standing [rad/s], shape (J,)."""
        return np.maximum(QUIET * np.abs(self._speed).max(axis=0), LEAST_SPEED)

    def _commands(self, wish: Array) -> Array:
        """Commands [%] for wished speeds [rad/s], (T, J), earlier by the joints'
        lags."""
        time = self._path.time
        period = self._path.period
        last = len(time) - 1
        early = np.zeros_like(wish)
        pose = self._pose.copy()
        load = self._load.copy()
        for joint in self._driven.tolist():
            lag = float(self._lags[joint])
            early[:, joint] = np.interp(time + lag, time, wish[:, joint], right=0.0)
            # the command acts when the joint is where it will be then
            acts = np.arange(len(time)) + round(lag / period)
            acts = np.minimum(acts, last)
            pose[:, joint] = self._pose[acts, joint]
            load[:, joint] = self._load[acts, joint]
        early[np.abs(early) < self._quiet()] = 0.0
        return self._steady.commands(early, pose, load)[0]

    def _simulate(self, command: Array) -> Array:
        angle = np.empty_like(command)
        angle[0] = self._plant.reset(self._path.angle[0])
        for k, given in enumerate(command[:-1]):
            angle[k + 1] = self._plant.step(given)
        return angle

    def _learnable(self, error: Array) -> Array:
        """Speeds that are missing [rad/s] where angles err [rad], both (T, J), as far
        as lags let them."""
        period = self._path.period
        missing = _rates(error, period)
        slow = np.zeros_like(missing)
        for joint in self._driven.tolist():
            lag = max(float(self._lags[joint]), period)
            cutoff = min(PASSED / lag, FASTEST / period)
            sections = butter(2, 2.0 * cutoff * period, output="sos")
            pad = min(len(missing) - 1, round(3.0 / (cutoff * period)))
            slow[:, joint] = sosfiltfilt(
                sections, missing[:, joint], padlen=pad, padtype="constant"
            )
        return slow
