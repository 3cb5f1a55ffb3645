"""Where a fit of a joint's valve begins: delay, lag, dead bands, exponents, curves and
speeds.

`valve_start` gives the numbers of a direction that has the speeds of a `SpeedCurve`.
`fitted_valve` then lets the joint follow both directions through its logs, with a delay
and a lag, and improves all numbers. What counts of an error e is what it has not been
for a while, r_k = (1 - K) r_{k-1} + e_k - e_{k-1}: an error of the speed stays in the
angle, and would count for as long as the log lasts. No load slows the joint, and no
pump.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import lfilter

from hydroid.arrays import Array, record
from hydroid.fitting.baselines import Baseline, follow
from hydroid.fitting.speed_curve import SpeedCurve, inside, measured_speeds
from hydroid.hydraulics.valve import KNOTS, bent_opening
from hydroid.log import Log

STILL = 0.02
"""part of the speed that a direction reaches below which a joint seems to stand: where
a valve begins to open too late, it has no effect on what the log shows before, and a
fit sees no reason to let it open earlier"""
GRID = 40  # commands at which a valve is compared with the speeds
UNLIKE = 0.5  # scatter of the logarithms of neighbouring factors of a curve
EXPONENT, EXPONENT_SD = 1.4, 0.4  # usual exponent, and scatter of its logarithm
BEGUN = 0.6, 1.4, 2.2  # exponents at which the search for a valve begins
LEAST = (0.0, np.log(0.4), *[-5.0] * len(KNOTS), -1.0)
MOST = (90.0, np.log(3.0), *[5.0] * len(KNOTS), 4.0)
SCALE = (5.0, 0.3, *[0.5] * len(KNOTS), 0.3)
"""bounds and scales of a side's numbers: dead band [%], logarithms of exponent, factors
and relative speed"""
FLAT = 3.0
"""command beyond the dead band over which a curve must be flat for the dead band to be
in doubt [%]"""
MEMORY = 1.5
"""for how long an error counts [s]"""
USUAL_LAG = 0.1
"""of a valve and its oil without any delay [s]"""
# of the search for a valve that a joint follows, with the noise that is left
ROUNDS, STEPS = 2, 25
POINTS = 401  # of a table of one direction
# a joint without stops: its logs may have reached none
FREE = np.array([-np.inf, np.inf])
# scatter of a dead band around the command from which a joint seems to move [%]
DEAD_SD = 20.0
LEAST_ERROR, SPEED_ERROR = 0.01, 0.04
"""error of a measured speed: a part of what the direction reaches, and one of the speed
itself"""


@record
class ValveStart:
    """Numbers of a direction of a valve.

    dead_band: command below which nothing moves [%]. exponent: of the opening. factors:
    of its curve, (4,). speed: at full command [rad/s]. one_size: its commands tell no
    curve: only the speed is measured.
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
    top = side.top
    flat = (1.0,) * len(KNOTS)
    dead = _dead_band(side)
    if side.one_size:
        dead = min(dead, 0.5 * float(side.command[0]))  # nobody knows
        full = top / max(_share(float(np.median(side.command)), dead), 0.05) ** EXPONENT
        return ValveStart(dead, EXPONENT, flat, full, one_size=True)
    at = np.linspace(side.command[0], side.command[-1], GRID)
    wanted = np.interp(at, side.command, side.speed) / top
    count = np.histogram(
        side.command, np.linspace(at[0], at[-1], GRID + 1), weights=side.weight
    )[0]
    # no sample between two commands: nothing is known there
    known = np.minimum(count / 10.0, 1.0)
    weight = np.sqrt(known) / (LEAST_ERROR + SPEED_ERROR * wanted)

    def rows(x: Array) -> Array:
        return np.concatenate(
            [weight * (_relative_speed(at, x) - wanted), _unusual(x, dead)]
        )

    tried = list[OptimizeResult]()
    for begun, band in product(BEGUN, (dead, 0.5 * dead)):
        level = np.zeros(len(KNOTS))
        begin = np.array([min(band, 89.0), np.log(begun), *level, 0.05])
        tried.append(
            least_squares(rows, begin, bounds=(LEAST, MOST), x_scale=SCALE, max_nfev=60)
        )
    ended = min(tried, key=lambda one: one.cost)
    band, exponent, factors, full = _numbers(ended.x)
    return ValveStart(band, exponent, factors, full * top, one_size=False)


@record
class JointStart:
    """Where a fit of a joint's valve begins.

    sides: of positive and of negative commands. delay: of the commands [s]. lag: of the
    speed behind the valve [s]. direction: 1 where a positive command moves the joint to
    larger angles, else -1.
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
        a, b = (side.speed * _relative_speed(at, _begin(side)) for side in self.sides)
        speeds = self.direction * np.concatenate([-b[:0:-1], a])
        table = np.stack([np.concatenate([-at[:0:-1], at]), speeds], axis=1)
        numbers = np.zeros((4, 2))
        numbers[3] = self.lag
        return Baseline(joint, np.asarray(limits, float), self.delay, table, numbers)


def fitted_valve(logs: Sequence[Log], joint: int) -> JointStart | None:
    """Return the valve by which a joint (number, from 1) follows its commands best,
    without load or pump.

    None where the logs do not show how it moves in both directions.
    """
    curve = measured_speeds(logs, joint)
    sides = [valve_start(curve.side(sign)) for sign in (1, -1)] if curve else []
    shown = [side for side in sides if side is not None]
    if curve is None or len(shown) < 2:
        return None
    return _Following(logs, joint, curve.direction, shown).fitted(curve.delay)


class _Following:
    """A joint that follows the valve of numbers x through its logs: those of both
    sides, delay, and lag."""

    def __init__(
        self,
        logs: Sequence[Log],
        joint: int,
        direction: float,
        sides: Sequence[ValveStart],
    ) -> None:
        self._logs = [
            log for log in logs if log.driven[joint - 1] and log.has_angle[joint - 1]
        ]
        self._joint, self._direction, self._sides = joint - 1, direction, sides
        angles = np.concatenate([log.angle[:, joint - 1] for log in self._logs])
        reach = float(angles.min()), float(angles.max())
        self._used = [inside(log.angle[:, joint - 1], reach) for log in self._logs]
        self._noise = 1.0

    def fitted(self, delay: float) -> JointStart:
        """Return the most likely one; it begins at the sides, and at a delay that has
        the lag in it [s]."""
        ends = [_begin(side) for side in self._sides]
        sooner = max(delay - USUAL_LAG, 0.0)
        begin = np.array([*ends[0], *ends[1], sooner, USUAL_LAG])
        least, most = (
            np.array([*LEAST, *LEAST, 0.0, 0.0]),
            np.array([*MOST, *MOST, 1.0, 0.6]),
        )
        scale = np.array([*SCALE, *SCALE, 0.05, 0.05])
        x = np.clip(begin, least, most)
        for _ in range(ROUNDS):
            # errors within MEMORY are about one
            alike = max(MEMORY / self._logs[0].period, 1.0)
            self._noise = max(
                float(np.sqrt(alike * np.mean(self._errors(x) ** 2))), 1e-6
            )
            raised = np.concatenate([*map(_raised, self._parts(x)), x[-2:]])
            begun = (
                [x] if np.array_equal(raised, x) else [x, np.clip(raised, least, most)]
            )
            search = partial(
                least_squares,
                self._rows,
                bounds=(least, most),
                x_scale=scale,
                max_nfev=STEPS,
            )
            x = min(map(search, begun), key=lambda ended: ended.cost).x
        a, b = (
            _ended(part, side)
            for part, side in zip(self._parts(x), self._sides, strict=True)
        )
        return JointStart((a, b), float(x[-2]), float(x[-1]), self._direction)

    def _parts(self, x: Array) -> tuple[Array, Array]:
        """The numbers of both sides."""
        return x[: len(SCALE)], x[len(SCALE) : -2]

    def _rows(self, x: Array) -> Array:
        unusual = [
            _unusual(part, side.dead_band)
            for part, side in zip(self._parts(x), self._sides, strict=True)
        ]
        return np.concatenate([self._errors(x) / self._noise, *unusual])

    def _errors(self, x: Array) -> Array:
        """What has changed of the errors within MEMORY [rad], but near the ends of the
        travel, shape (T,)."""
        errors = list[Array]()
        for log, used in zip(self._logs, self._used, strict=True):
            command = log.command[:, self._joint]
            side = (command < 0).astype(int)
            speed = np.zeros(len(command))
            for place, (part, sign) in enumerate(
                zip(self._parts(x), (1.0, -1.0), strict=True)
            ):
                own = side == place
                top = self._sides[place].speed
                speed[own] = (
                    sign
                    * self._direction
                    * top
                    * _relative_speed(np.abs(command[own]), part)
                )
            late, lag = x[-2] / log.period, np.full(2, x[-1] / log.period)
            start = float(log.start[self._joint])
            angle = follow(speed * log.period, side, late, lag, start, FREE)
            error = log.angle[:, self._joint] - angle
            kept = np.exp(-log.period / MEMORY)
            change = np.where(used, np.diff(error, prepend=error[0]), 0.0)
            errors.append(np.asarray(lfilter([1.0], [1.0, -kept], change), dtype=float))
        return np.concatenate(errors)


def _begin(side: ValveStart) -> Array:
    """Return the numbers of a side: dead band, logarithms of exponent, factors and
    relative speed."""
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
    wanted = opening / opening[-1]
    share = np.maximum(at - opens, 0.0) / (100.0 - opens)
    heights = np.interp(KNOTS, share[at >= opens], wanted[at >= opens])
    steps = np.diff([0.0, *heights, 1.0]) / np.diff(
        [0.0, *np.power(KNOTS, EXPONENT), 1.0]
    )
    factors = np.log(np.clip(steps[:-1] / steps[-1], 0.01, 100.0))
    return np.array([opens, np.log(EXPONENT), *factors, x[-1]])


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
    return full * bent_opening(
        share**exponent, factors, tuple(knot**exponent for knot in KNOTS)
    )


def _unusual(x: Array, dead: float) -> Array:
    """How far numbers of a side are from usual ones, in standard deviations."""
    bends = np.diff([*x[2:-1], 0.0]) / UNLIKE
    off = [
        (x[1] - np.log(EXPONENT)) / EXPONENT_SD,
        (x[0] - dead) / DEAD_SD,
        0.1 * x[-1],
    ]
    return np.concatenate([bends, off])


def _numbers(x: Array) -> tuple[float, float, tuple[float, ...], float]:
    """Dead band [%], exponent, factors of the curve, and speed at full command over the
    largest measured."""
    values = x.tolist()
    return (
        values[0],
        float(np.exp(values[1])),
        tuple(np.exp(values[2:-1]).tolist()),
        float(np.exp(values[-1])),
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
    return max(last, first - 5.0) if first - last > 10.0 else 0.5 * (first + last)
