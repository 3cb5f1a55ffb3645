"""Where a fit of a joint's valve begins: delay, lag, dead bands, exponents, curves and
speeds.

`valve_start` gives the numbers of a direction that has the speeds of a `SpeedCurve`.
`fitted_valve` then lets the joint follow both directions through its logs, with a delay
and a lag, and improves all numbers. What counts of an error e is what it has not been
for a while, r_k = (1 - K) r_{k-1} + e_k - e_{k-1}: an error of the speed stays in the
angle, and would count for as long as the log lasts. No load slows the joint, and no
pump.

The numbers of a side, in the vector x of its search: dead band [%], logarithms of the
exponent, of the factors and of the speed at full command, relative to that in its
`SpeedCurve`. The vector of a joint has those of both sides, delay and lag [s].
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import lfilter

from hydroid.arrays import Array, Mask, record
from hydroid.fitting.baselines import Baseline, follow
from hydroid.fitting.speed_curve import SpeedCurve, inside, measured_speeds
from hydroid.hydraulics.valve import KNOTS, bent_opening
from hydroid.log import Log

STILL = 0.02
"""part of the speed that a direction reaches below which a joint seems to stand: where
a valve begins to open too late, it has no effect on what the log shows before, and a
fit sees no reason to let it open earlier"""
GRID = 40
"""commands at which a valve is compared with the speeds"""
SURE = 10.0
"""samples between two of these commands from which a speed is known there"""
UNLIKE = 0.5
"""scatter of the logarithms of neighbouring factors of a curve"""
EXPONENT = 1.4
"""usual exponent of an opening"""
EXPONENT_SD = 0.4
"""scatter of its logarithm"""
FIRST_EXPONENTS = (0.6, 1.4, 2.2)
"""at which the search for a valve begins"""
LEAST = (0.0, np.log(0.4), *[-5.0] * len(KNOTS), -1.0)
MOST = (90.0, np.log(3.0), *[5.0] * len(KNOTS), 4.0)
SCALE = (5.0, 0.3, *[0.5] * len(KNOTS), 0.3)
"""bounds and scales of a side's numbers"""
FLAT = 3.0
"""command beyond the dead band over which a curve must be flat for the dead band to be
in doubt [%]"""
MEMORY = 1.5
"""for how long an error counts [s]"""
LAG_BESIDE_DELAY = 0.1
"""of a valve and its oil without any delay [s]"""
ROUNDS = 2
"""searches for a valve that a joint follows, each with the noise that the one before
leaves"""
STEPS = 25
"""evaluations of each of them, without those for slopes"""
POINTS = 401
"""of a table of one direction"""
FREE = np.array([-np.inf, np.inf])
"""range of a joint without stops: its logs may have reached none"""
DEAD_SD = 20.0
"""scatter of a dead band around the command from which a joint seems to move [%]"""
LEAST_ERROR = 0.01
"""error of a measured speed at least, as a part of what the direction reaches"""
SPEED_ERROR = 0.04
"""error of a measured speed besides, as a part of it"""


@record
class ValveStart:
    """A valve in one direction.

    Attributes:
        dead_band: command below which nothing moves [%].
        exponent: of the opening.
        factors: of its curve, shape (4,).
        speed: at full command [rad/s].
        one_size: its commands tell no curve: only the speed is measured.
    """

    dead_band: float
    exponent: float
    factors: tuple[float, ...]
    speed: float
    one_size: bool


def valve_start(side: SpeedCurve) -> ValveStart | None:
    """Return the valve whose speeds are nearest to those of a side (`SpeedCurve.side`).

    Where the commands of the side tell nothing, it is a power law with the usual
    exponent. None where the side has no commands, or nothing moves.
    """
    if len(side.command) == 0 or not side.top > 0.0:
        return None
    dead = _dead_band(side)
    if side.one_size:
        return _usual_valve(side, dead)
    at = np.linspace(side.command[0], side.command[-1], GRID)
    wanted = np.interp(at, side.command, side.speed) / side.top
    edges = np.linspace(at[0], at[-1], GRID + 1)
    count, _ = np.histogram(side.command, edges, weights=side.weight)
    # no sample between two commands: nothing is known there
    known = np.minimum(count / SURE, 1.0)
    weight = np.sqrt(known) / (LEAST_ERROR + SPEED_ERROR * wanted)

    def rows(x: Array) -> Array:
        errors = weight * (_relative_speed(at, x) - wanted)
        return np.concatenate([errors, _unusual(x, dead)])

    tried = list[OptimizeResult]()
    for exponent, band in product(FIRST_EXPONENTS, (dead, 0.5 * dead)):
        flat = np.zeros(len(KNOTS))
        begin = np.array([min(band, 89.0), np.log(exponent), *flat, 0.05])
        result = least_squares(
            rows, begin, bounds=(LEAST, MOST), x_scale=SCALE, max_nfev=60
        )
        tried.append(result)
    best = min(tried, key=lambda result: result.cost)
    band, exponent, factors, full = _numbers(best.x)
    return ValveStart(band, exponent, factors, full * side.top, one_size=False)


def _usual_valve(side: SpeedCurve, dead: float) -> ValveStart:
    """Return a power law with the usual exponent that has the speed of a side at its
    usual command; `dead` is its dead band [%]."""
    # nobody knows where the valve opens, but it has opened at the smallest command
    dead = min(dead, 0.5 * float(side.command[0]))
    usual = float(np.median(side.command))
    share = max(_share(usual, dead), 0.05)
    flat = (1.0,) * len(KNOTS)
    return ValveStart(dead, EXPONENT, flat, side.top / share**EXPONENT, one_size=True)


@record
class JointStart:
    """Where a fit of a joint's valve begins.

    Attributes:
        sides: of positive and of negative commands.
        delay: of the commands [s].
        lag: of the speed behind the valve [s].
        direction: 1 where a positive command moves the joint to larger angles, else -1.
    """

    sides: tuple[ValveStart, ValveStart]
    delay: float
    lag: float
    direction: float

    @property
    def turned(self) -> "JointStart":
        """The same for commands of the other sign."""
        return replace(self, sides=self.sides[::-1], direction=-self.direction)

    def baseline(self, joint: int, limits: tuple[float, float]) -> Baseline:
        """Return a joint (number, from 1) with these speeds and no load; `limits` are
        its range [rad].

        It is a table of speeds, with a lag.
        """
        at = np.linspace(0.0, 100.0, POINTS)
        forth, back = (
            side.speed * _relative_speed(at, _begin(side)) for side in self.sides
        )
        # from the largest negative command to the largest positive one
        commands = np.concatenate([-at[:0:-1], at])
        speeds = self.direction * np.concatenate([-back[:0:-1], forth])
        table = np.stack([commands, speeds], axis=1)
        numbers = np.zeros((4, 2))
        numbers[3] = self.lag
        return Baseline(joint, np.asarray(limits, float), self.delay, table, numbers)


def fitted_valve(logs: Sequence[Log], joint: int) -> JointStart | None:
    """Return the valve by which a joint (number, from 1) follows its commands best,
    without load or pump.

    None where the logs do not show how it moves in both directions.
    """
    curve = measured_speeds(logs, joint)
    if curve is None:
        return None
    forth = valve_start(curve.side(1))
    back = valve_start(curve.side(-1))
    if forth is None or back is None:
        return None
    following = _Following(logs, joint, curve.direction, (forth, back))
    return following.fitted(curve.delay)


class _Following:
    """A joint that follows the valve of the numbers x of a joint through its logs."""

    def __init__(
        self,
        logs: Sequence[Log],
        joint: int,
        direction: float,
        sides: tuple[ValveStart, ValveStart],
    ) -> None:
        column = joint - 1
        self._column = column
        self._direction = direction
        self._sides = sides
        self._logs = [
            log for log in logs if log.driven[column] and log.has_angle[column]
        ]
        angles = [log.angle[:, column] for log in self._logs]
        every = np.concatenate(angles)
        reach = (float(every.min()), float(every.max()))
        self._used = [inside(angle, reach) for angle in angles]
        # to find where a log rests takes as long as to follow it
        self._starts = [float(log.start[column]) for log in self._logs]
        # [rad/sample]
        self._speeds_at_start = [
            float(log.start_speed[column] * log.period) for log in self._logs
        ]
        self._noise = 1.0

    def fitted(self, delay: float) -> JointStart:
        """Return the most likely one; it begins at the sides, and at a delay that has
        the lag in it [s]."""
        forth, back = self._sides
        sooner = max(delay - LAG_BESIDE_DELAY, 0.0)
        begin = np.array([*_begin(forth), *_begin(back), sooner, LAG_BESIDE_DELAY])
        least = np.array([*LEAST, *LEAST, 0.0, 0.0])
        most = np.array([*MOST, *MOST, 1.0, 0.6])
        scale = np.array([*SCALE, *SCALE, 0.05, 0.05])
        x = np.clip(begin, least, most)
        for _ in range(ROUNDS):
            self._noise = self._noise_at(x)
            begins = [x]
            raised = np.concatenate([*map(_raised, self._of_sides(x)), x[-2:]])
            if not np.array_equal(raised, x):
                begins.append(np.clip(raised, least, most))
            search = partial(
                least_squares,
                self._rows,
                bounds=(least, most),
                x_scale=scale,
                max_nfev=STEPS,
            )
            x = min(map(search, begins), key=lambda result: result.cost).x
        of_forth, of_back = self._of_sides(x)
        return JointStart(
            sides=(_ended(of_forth, forth), _ended(of_back, back)),
            delay=float(x[-2]),
            lag=float(x[-1]),
            direction=self._direction,
        )

    def _of_sides(self, x: Array) -> tuple[Array, Array]:
        """Return the numbers of both sides."""
        return x[: len(SCALE)], x[len(SCALE) : -2]

    def _noise_at(self, x: Array) -> float:
        """Return the standard deviation of an error that counts by itself [rad]."""
        # errors within MEMORY are about one
        alike = max(MEMORY / self._logs[0].period, 1.0)
        square = alike * np.mean(self._errors(x) ** 2)
        return max(float(np.sqrt(square)), 1e-6)

    def _rows(self, x: Array) -> Array:
        rows = [self._errors(x) / self._noise]
        for numbers, side in zip(self._of_sides(x), self._sides, strict=True):
            rows.append(_unusual(numbers, side.dead_band))
        return np.concatenate(rows)

    def _errors(self, x: Array) -> Array:
        """Return what has changed of the errors within MEMORY [rad], but near the ends
        of the travel, shape (T,)."""
        errors = list[Array]()
        every = zip(
            self._logs, self._used, self._starts, self._speeds_at_start, strict=True
        )
        for log, used, start, begun in every:
            command = log.command[:, self._column]
            is_back = command < 0
            # in samples
            delay = x[-2] / log.period
            lag = np.full(2, x[-1] / log.period)
            way = self._speeds(x, command, is_back) * log.period
            angle = follow(way, is_back.astype(int), delay, lag, start, begun, FREE)
            error = log.angle[:, self._column] - angle
            kept = np.exp(-log.period / MEMORY)
            change = np.where(used, np.diff(error, prepend=error[0]), 0.0)
            remembered = lfilter([1.0], [1.0, -kept], change)
            errors.append(np.asarray(remembered, dtype=float))
        return np.concatenate(errors)

    def _speeds(self, x: Array, command: Array, is_back: Mask) -> Array:
        """Return the speeds [rad/s] at commands [%], (T,), of which some are of the
        negative side."""
        forth, back = self._sides
        of_forth, of_back = self._of_sides(x)
        speed = np.zeros(len(command))
        top = self._direction * forth.speed
        speed[~is_back] = top * _relative_speed(command[~is_back], of_forth)
        top = -self._direction * back.speed
        speed[is_back] = top * _relative_speed(-command[is_back], of_back)
        return speed


def _begin(side: ValveStart) -> Array:
    """Return the numbers of a side."""
    factors = np.log(side.factors)
    return np.array([side.dead_band, np.log(side.exponent), *factors, 0.0])


def _raised(x: Array) -> Array:
    """Return numbers of a side whose dead band ends where the valve really opens.

    A curve may be flat up to there, so that nothing moves, and no change of the dead
    band then does any good.
    """
    at = np.linspace(0.0, 100.0, 1001)
    opening = _relative_speed(at, x)
    opens = float(at[np.argmax(opening > STILL * opening[-1])])
    if opens < x[0] + FLAT:
        return x
    # the same opening as parts of a curve that begins there
    beyond = at >= opens
    wanted = opening[beyond] / opening[-1]
    share = (at[beyond] - opens) / (100.0 - opens)
    heights = np.interp(KNOTS, share, wanted)
    rises = np.diff([0.0, *heights, 1.0])
    usual = np.diff([0.0, *np.power(KNOTS, EXPONENT), 1.0])
    steepness = rises / usual
    # the last part of a curve has the factor 1
    factors = np.clip(steepness[:-1] / steepness[-1], 0.01, 100.0)
    return np.array([opens, np.log(EXPONENT), *np.log(factors), x[-1]])


def _ended(x: Array, before: ValveStart) -> ValveStart:
    """Return the side of numbers; one whose commands tell no curve keeps the one that
    it has."""
    band, exponent, factors, full = _numbers(x)
    if before.one_size:
        return replace(before, speed=before.speed * full)
    return ValveStart(band, exponent, factors, before.speed * full, one_size=False)


def _relative_speed(command: Array, x: Array) -> Array:
    """Speeds at commands [%], (n,), over that which numbers of a side relate to."""
    band, exponent, factors, full = _numbers(x)
    share = np.maximum(command - band, 0.0) / (100.0 - band)
    knots = tuple(knot**exponent for knot in KNOTS)
    return full * bent_opening(share**exponent, factors, knots)


def _unusual(x: Array, dead: float) -> Array:
    """Return how far numbers of a side are from usual ones, in standard deviations."""
    # the last part of a curve has the factor 1, whose logarithm is 0
    bends = np.diff([*x[2:-1], 0.0]) / UNLIKE
    others = [
        (x[1] - np.log(EXPONENT)) / EXPONENT_SD,
        (x[0] - dead) / DEAD_SD,
        0.1 * x[-1],
    ]
    return np.concatenate([bends, others])


def _numbers(x: Array) -> tuple[float, float, tuple[float, ...], float]:
    """Dead band [%], exponent, factors of the curve, and speed at full command over the
    largest measured."""
    band, exponent, *factors, speed = x.tolist()
    return (
        band,
        float(np.exp(exponent)),
        tuple(np.exp(factors).tolist()),
        float(np.exp(speed)),
    )


def _share(command: float, dead: float) -> float:
    """Part of the command beyond the dead band."""
    return max(command - dead, 0.0) / (100.0 - dead)


def _dead_band(side: SpeedCurve) -> float:
    """Return the command between the last one that moves nothing and the first one that
    does [%].

    Where these are far apart, nobody knows: a little below the first one.
    """
    moves = side.speed > STILL * side.top
    first = float(side.command[moves][0])
    still = side.command[~moves]
    last = float(still[-1]) if len(still) else 0.0
    if first - last > 10.0:
        return max(last, first - 5.0)
    return 0.5 * (first + last)
