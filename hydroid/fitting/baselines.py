"""What anybody would try before a model: each joint's speed follows its command, and nothing else.

Three models of one joint, fitted to logs in about a second: it does not move; a table of mean
speeds with a delay; nine numbers: dead band, exponent, speed and lag of each direction, and one
delay. A model of the arm must predict better than they do, and can start its own fit from them.

They are fitted to angles, not to innovations as a model of the arm is (`posterior.error_model`). So
simple a model errs far more than any noise, the error model takes all of that for drift, and what
is left is a fit of speeds from sample to sample:
it predicts 1 to 10 s worse (`make bench B=simple_models`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hydroid.arrays import Array, record
from hydroid.log import Log

NAMES = ("standing still", "speed tables", "nine numbers")
"""of the baselines, the simplest first"""
LONGEST_DELAY = 1.0
"""between a command and its motion [s]"""
LOWER = (0.0, 0.0, 0.3, 0.3, -np.inf, -np.inf, 0.0, 0.0, 0.0)
UPPER = (90.0, 90.0, 5.0, 5.0, np.inf, np.inf, 1.5, 1.5, LONGEST_DELAY)
SCALE = (10.0, 10.0, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 0.1)
"""bounds and scales of nine numbers: those of `Baseline.numbers`, row by row, and the delay"""


@record
class Baseline:
    """A joint whose speed follows its command; it stands still on zero command.

    Attributes:
        joint: number, from 1.
        limits: its range [rad], where it stops, shape (2,).
        delay: [s].
        table: commands [%], ascending, and their speeds [rad/s], shape (N, 2); None: by the
            numbers.
        numbers: dead band [%], exponent of the command beyond it, speed at full command [rad/s], of
            either sign, and time constant of the speed [s], of positive and negative commands:
            shape (4, 2).
    """

    joint: int
    limits: Array
    delay: float = 0.0
    table: Array | None = None
    numbers: Array = field(default_factory=partial(np.zeros, (4, 2)))

    def predict(self, log: Log) -> Array:
        """Return the angle from the log's start pose under its commands alone [rad], shape (T,)."""
        command = log.command[:, self.joint - 1]
        side = (command < 0).astype(int)
        if self.table is not None:
            target = np.interp(command, *self.table.T)
        else:
            dead, exponent, speed = self.numbers[:3, side]
            beyond = (np.abs(command) - dead) / (100.0 - dead)
            target = speed * np.power(beyond, exponent, out=np.zeros_like(beyond), where=beyond > 0)
        late, lag, start = self.delay / log.period, self.numbers[3] / log.period, log.start[self.joint - 1]
        return _follow(target * log.period, side, late, lag, start, self.limits)

    def errors(self, logs: Sequence[Log]) -> Array:
        """Return measured minus predicted angles of all logs [rad]."""
        return np.concatenate([log.angle[:, self.joint - 1] - self.predict(log) for log in logs])


@njit(cache=True)
def _follow(
    target: Array,
    side: NDArray[np.int64],
    delay: float,
    lag: Array,
    start: float,
    limits: Array,
) -> Array:
    """Angles of a joint whose speed follows `target` [rad/sample] after a delay and a
    lag [samples]."""
    whole, part = int(delay), delay - int(delay)
    left = [np.exp(-1.0 / time) if time > 1e-6 else 0.0 for time in lag]
    angle, speed, angles = start, 0.0, np.empty(len(target))
    for k in range(len(target)):
        angles[k] = angle
        late, later = k - whole, k - whole - 1
        wanted = (1 - part) * target[late] if late >= 0 else 0.0
        wanted += part * target[later] if later >= 0 else 0.0
        way = side[max(late, 0)]
        angle += wanted + (speed - wanted) * lag[way] * (1 - left[way])
        speed = wanted + (speed - wanted) * left[way]
        if angle < limits[0] or angle > limits[1]:
            angle, speed = min(max(angle, limits[0]), limits[1]), 0.0
    return angles


def fit_baselines(logs: Sequence[Log], joint: int, limits: tuple[float, float]) -> dict[str, Baseline]:
    """Fit the baselines of a joint (number, from 1) to the logs that measure it;
    `limits` is its range [rad].

    They are by name, the simplest first. A joint that is never driven has only that.
    """
    measured = [log for log in logs if log.measured[joint - 1]]
    still = Baseline(joint, np.asarray(limits, float))
    if not any(log.driven[joint - 1] for log in measured):
        return {NAMES[0]: still}
    delays = np.arange(0, LONGEST_DELAY, max(0.02, measured[0].period))
    tables = (_mean_speeds(measured, still, delay) for delay in delays)
    table = min(tables, key=lambda model: np.mean(model.errors(measured) ** 2))
    # of the fits that start at the table of speeds with different exponents the best

    def made(x: Array) -> Baseline:
        return replace(table, table=None, delay=float(x[8]), numbers=x[:8].reshape(4, 2))

    fit = partial(least_squares, lambda x: made(x).errors(measured), bounds=(LOWER, UPPER), x_scale=SCALE)
    best = min((fit(start, max_nfev=10) for start in _starts(table)), key=lambda ended: ended.cost)
    numbers = made(fit(best.x, max_nfev=40).x)
    return dict(zip(NAMES, (still, table, numbers), strict=True))


def _mean_speeds(logs: Sequence[Log], still: Baseline, delay: float) -> Baseline:
    """Return the mean speed in each of 24 bins of a command that acts after a delay,
    but for zero command."""
    pairs = list[Array]()
    for log in logs:
        command, angle = log.command[:, still.joint - 1], log.angle[:, still.joint - 1]
        late, margin = round(delay / log.period), 0.01 * np.ptp(angle)
        step = np.diff(angle[late:]) / log.period
        command = command[: len(step)]
        # at an end of its range no command moves it
        free = (angle > still.limits[0] + margin) & (angle < still.limits[1] - margin)
        pairs.append(np.stack([command, step])[:, free[late:-1] & (command != 0)])
    command, speed = np.hstack(pairs)
    bins = np.floor(command / (200 / 24))
    filled = (bins == number for number in np.unique(bins))
    rows = sorted([(0.0, 0.0), *((command[one].mean(), speed[one].mean()) for one in filled)])
    return replace(still, delay=delay, table=np.array(rows))


def _starts(table: Baseline) -> Iterator[Array]:
    """Dead bands that end where the table begins to move, its last speeds, and three exponents."""
    assert table.table is not None
    commands, speeds = table.table.T
    dead, last, largest = np.zeros(2), np.zeros(2), np.full(2, 100.0)
    for side, sign in enumerate((1, -1)):
        if np.any(here := commands * sign > 0):
            size, speed = np.abs(commands[here]), speeds[here]
            dead[side] = 0.9 * size[np.abs(speed) > 0.05 * np.abs(speed).max()].min(initial=size.max())
            largest[side], last[side] = size.max(), speed[size.argmax()]
    for exponent in (1.0, 1.6, 2.5):
        full = last * ((100 - dead) / (largest - dead)) ** exponent
        yield np.array([*dead, exponent, exponent, *full, 0.1, 0.1, max(table.delay - 0.1, 0.01)])
