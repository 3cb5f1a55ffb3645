"""What anybody would try before a model: each joint's speed follows its command, and
nothing else.

Three models of one joint, fitted to logs in about a second: it does not move; a table
of mean speeds with a delay; nine numbers: dead band, exponent, speed and lag of each
direction, and one delay. A model of the arm must predict better than they do, and can
start its own fit from them.

They are fitted to angles, not to innovations as a model of the arm is
(`posterior.error_model`). So simple a model errs far more than any noise, the error
model takes all of that for drift, and what is left is a fit of speeds from sample to
sample: it predicts 1 to 10 s worse (`make bench B=simple_models`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from hydroid.arrays import Array, Limits, record
from hydroid.log import Log

NAMES = ("standing still", "speed tables", "nine numbers")
"""of the baselines, the simplest first"""
CLEARLY = 0.9
"""part of another model's error on the fitted logs that a better one stays below"""
BINS = 24
"""of commands from -100 to 100 %, in a table of speeds"""
LONGEST_FITTED_DELAY = 1.0
"""between a command and its motion [s]"""
LOWER = (0.0, 0.0, 0.3, 0.3, -np.inf, -np.inf, 0.0, 0.0, 0.0)
UPPER = (90.0, 90.0, 5.0, 5.0, np.inf, np.inf, 1.5, 1.5, LONGEST_FITTED_DELAY)
SCALE = (10.0, 10.0, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 0.1)
"""bounds and scales of nine numbers: those of `Baseline.numbers`, row by row, and the
delay"""


@record
class Baseline:
    """A joint whose speed follows its command; it stands still on zero command.

    Attributes:
        joint: number, from 1.
        limits: its range [rad], where it stops, shape (2,).
        delay: [s].
        table: commands [%], ascending, and their speeds [rad/s], shape (N, 2); None: by
            the numbers.
        numbers: dead band [%], exponent of the command beyond it, speed at full command
            [rad/s], of either sign, and time constant of the speed [s], of positive and
            negative commands: shape (4, 2).
    """

    joint: int
    limits: Array
    delay: float = 0.0
    table: Array | None = None
    numbers: Array = field(default_factory=partial(np.zeros, (4, 2)))

    def predict(self, log: Log) -> Array:
        """Return the angle from the log's start pose under its commands alone [rad],
        shape (T,)."""
        command = log.command_of(self.joint)
        side = (command < 0).astype(int)
        if self.table is not None:
            commands, speeds = self.table.T
            target = np.interp(command, commands, speeds)
        else:
            dead, exponent, speed = self.numbers[:3, side]
            beyond = (np.abs(command) - dead) / (100.0 - dead)
            share = np.zeros_like(beyond)
            np.power(beyond, exponent, out=share, where=beyond > 0)
            target = speed * share
        return follow(
            target * log.period,
            side,
            self.delay / log.period,
            self.numbers[3] / log.period,
            log.start[self.joint - 1],
            log.start_speed[self.joint - 1] * log.period,
            self.limits,
        )

    def errors(self, logs: Sequence[Log]) -> Array:
        """Return measured minus predicted angles of all logs [rad]."""
        errors = list[Array]()
        for log in logs:
            measured = log.angle_of(self.joint)
            errors.append(measured - self.predict(log))
        return np.concatenate(errors)


@njit(cache=True)
def follow(
    target: Array,
    side: NDArray[np.int64],
    delay: float,
    lag: Array,
    start: float,
    begun: float,
    limits: Array,
) -> Array:
    """Return the angles of a joint whose speed follows `target` [rad/sample].

    It follows after a delay, and with a lag for either side [samples]. Where it has
    `begun` to move before the start, the first target has been held before.
    """
    whole = int(delay)
    part = delay - whole
    # what remains of a difference of speeds after a sample
    left = [np.exp(-1.0 / time) if time > 1e-6 else 0.0 for time in lag]
    angle = start
    speed = begun
    held = target[0] if begun != 0.0 else 0.0
    angles = np.empty(len(target))
    for k in range(len(target)):
        angles[k] = angle
        now = k - whole
        before = now - 1
        wanted = (1 - part) * (target[now] if now >= 0 else held)
        wanted += part * (target[before] if before >= 0 else held)
        way = side[max(now, 0)]
        # the integral of a speed that approaches the wanted one over this sample
        angle += wanted + (speed - wanted) * lag[way] * (1 - left[way])
        speed = wanted + (speed - wanted) * left[way]
        if angle < limits[0] or angle > limits[1]:
            angle = min(max(angle, limits[0]), limits[1])
            speed = 0.0
    return angles


def fit_baselines(
    logs: Sequence[Log], joint: int, limits: Limits
) -> dict[str, Baseline]:
    """Fit the baselines of a joint (number, from 1) to the logs that measure it.

    `limits` is its range [rad]. They are by name, the simplest first. A joint that is
    never driven has only that.
    """
    measured = [log for log in logs if log.measures(joint)]
    # the simplest guess: it stays where it starts
    still = Baseline(joint, np.asarray(limits, float))
    if not any(log.drives(joint) for log in measured):
        return {NAMES[0]: still}
    # the table has no delay of its own to be fitted: the best of all that are tried is
    # taken
    delays = np.arange(0, LONGEST_FITTED_DELAY, max(0.02, measured[0].period))
    tables = (_mean_speeds(measured, still, delay) for delay in delays)
    table = min(tables, key=lambda model: np.mean(model.errors(measured) ** 2))
    numbers = _fit_numbers(measured, table)
    return dict(zip(NAMES, (still, table, numbers), strict=True))


def _fit_numbers(logs: Sequence[Log], table: Baseline) -> Baseline:
    """Fit nine numbers: the best of short fits from the table's speeds goes on to its
    end."""

    def made(x: Array) -> Baseline:
        numbers = x[:8].reshape(4, 2)
        return replace(table, table=None, delay=float(x[8]), numbers=numbers)

    def fit(start: Array, evaluations: int) -> OptimizeResult:
        return least_squares(
            lambda x: made(x).errors(logs),
            start,
            bounds=(LOWER, UPPER),
            x_scale=SCALE,
            max_nfev=evaluations,
        )

    # a few evaluations tell which start leads on: only the best is worth more
    short_fits = (fit(start, 10) for start in _starts(table))
    best = min(short_fits, key=lambda fitted: fitted.cost)
    return made(fit(best.x, 40).x)


def _mean_speeds(logs: Sequence[Log], still: Baseline, delay: float) -> Baseline:
    """Return the mean speed in each of BINS of a command that acts after a delay, but
    for zero command."""
    pairs = list[Array]()
    for log in logs:
        command = log.command_of(still.joint)
        angle = log.angle_of(still.joint)
        lag = round(delay / log.period)
        speed = np.diff(angle[lag:]) / log.period
        command = command[: len(speed)]
        # at an end of its range no command moves it
        margin = 0.01 * np.ptp(angle)
        low, high = still.limits
        free = (angle > low + margin) & (angle < high - margin)
        counts = free[lag:-1] & (command != 0)
        pairs.append(np.stack([command, speed])[:, counts])
    command, speed = np.hstack(pairs)
    bins = np.floor(command / (200 / BINS))
    rows = [(0.0, 0.0)]
    for number in np.unique(bins):
        inside = bins == number
        rows.append((command[inside].mean(), speed[inside].mean()))
    return replace(still, delay=delay, table=np.array(sorted(rows)))


def _starts(table: Baseline) -> Iterator[Array]:
    """Yield starts of nine numbers: dead bands that end where the table begins to move,
    its last speeds, and three exponents."""
    assert table.table is not None
    commands, speeds = table.table.T
    dead = np.zeros(2)
    last = np.zeros(2)
    largest = np.full(2, 100.0)
    for side, sign in enumerate((1, -1)):
        here = commands * sign > 0
        if not np.any(here):
            continue
        size = np.abs(commands[here])
        speed = speeds[here]
        moves = np.abs(speed) > 0.05 * np.abs(speed).max()
        dead[side] = 0.9 * size[moves].min(initial=size.max())
        largest[side] = size.max()
        last[side] = speed[size.argmax()]
    # the lag of 0.1 s takes the rest
    delay = max(table.delay - 0.1, 0.01)
    for exponent in (1.0, 1.6, 2.5):
        full = last * ((100 - dead) / (largest - dead)) ** exponent
        yield np.array([*dead, exponent, exponent, *full, 0.1, 0.1, delay])
