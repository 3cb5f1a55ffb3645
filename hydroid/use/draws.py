"""Machines that the logs do not rule out: draws of all parameters together, and of the
errors of the model.

The posterior is Gaussian about relative changes of the parameters
(`posterior.posterior`), cut off at their bounds. Draws of it are exact (A. Pakman, L.
Paninski, *Exact Hamiltonian Monte Carlo for truncated multivariate Gaussians*, 2014): a
point gets a random speed and moves as a pendulum does, for a quarter of its period, and
bounces off the bounds. Nothing has to be tuned, and away from bounds draws are
independent.

A model is not linear: far from the estimate a draw of the Gaussian may fit the logs
much worse than it should. Then it is moved back along what the logs leave wide open,
and where that is not enough altogether, until the logs are as likely as the Gaussian
has it.

What a machine does besides its parameters says the error model: its angle drifts from
the model's with time and way, and its sensor has noise.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit
from numpy.random import Generator
from scipy.linalg import solve_triangular

from hydroid.arrays import Array, Index, Mask, record
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import AngleError
from hydroid.identified_model import IdentifiedModel
from hydroid.plant import Plant
from hydroid.posterior.error_model import likelihood_at
from hydroid.posterior.posterior import NORMAL, Posterior, stored_posterior
from hydroid.problem.problem import Problem
from hydroid.run.record import record_of

FORGOTTEN = 20
"""motions before the first draw"""
BETWEEN = 4
"""motions between two draws: with bounds, one alone does not forget where it began"""
MOST_BOUNCES = 10_000
"""of one motion"""
WIDE_OPEN = 0.1
"""relative standard deviation from which on a direction is one in which no model is
linear"""
HALVINGS = 6
"""of the part of its way that a draw keeps: to 2 %"""
TOUCHING = 1e-9
"""phase within which a wall is the one that was just met [rad]"""


@record
class Draws:
    """n draws of a fit's P parameters, all together.

    Attributes:
        model: at the estimate.
        theta: shape (n, P), in the order and the units of the settings.
        posterior: from which they are.
    """

    model: IdentifiedModel
    theta: Array
    posterior: Posterior

    def __len__(self) -> int:
        return len(self.theta)

    def __repr__(self) -> str:
        count = len(self.names)
        return f"<Draws: {len(self)} of {count} parameters; {self.model.source}>"

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, (P,)."""
        return self.model.settings.parameter_set().names

    @property
    def models(self) -> Iterator[IdentifiedModel]:
        """The model at each draw: what `load_plant` and `Plant` take."""
        for row in self.theta:
            yield replace(self.model, theta=row, summary=None)

    def plants(self, **how: Any) -> Iterator[Plant]:
        """Return a plant at each draw; the keywords are those of `Plant`."""
        how = {"joints": Plant(self.model).joints} | how
        for model in self.models:
            yield Plant(model, **how)

    @property
    def errors(self) -> dict[str, AngleError]:
        """What the residuals of each compared angle show of its error, by angle: `q2`
        of joint 2."""
        return self.model.summarise().errors

    @property
    def apart(self) -> float:
        """How far from the estimate independent draws of each parameter's own interval
        are, by the logs.

        Root mean square over parameters, in standard deviations; 1 of draws of all
        together.
        """
        information = np.sum(self.posterior.root**2, axis=0)
        variances = np.diag(self.posterior.covariance)
        return float(np.sqrt(np.mean(information * variances)))


def draw(
    model: IdentifiedModel, n: int, seed: int = 0, problem: Problem | None = None
) -> Draws:
    """Return n draws of what the logs leave open; the same seed gives the same ones.

    Parameters that a bound held in the fit stay there. The logs are those of the
    `problem`, or of the run that the model is from; without either a draw is one of the
    Gaussian alone.

    Raises:
        RunError: the model holds no covariance of its parameters: it is no fit.
        SettingsError: n is below 1.
    """
    posterior = stored_posterior(model)
    if posterior is None:
        hint = "name the folder of a fit, with the settings that it used"
        raise RunError("holds no covariance of these parameters", model.source, hint)
    if n < 1:
        raise SettingsError("needs one draw at least", "draws")
    changes = within(posterior, n, np.random.default_rng(seed))
    if problem is None:
        fit = record_of(model)
        if fit is not None:
            problem = Problem(model.settings, [p.log for p in fit.fitted])
    if problem is not None:
        changes = on_their_level(posterior, changes, problem)
    return Draws(model, posterior.box.points(changes), posterior)


def on_their_level(posterior: Posterior, changes: Array, problem: Problem) -> Array:
    """Return changes, (n, p), moved back until logs and priors are as likely as the
    Gaussian has it there."""
    box = posterior.box
    likelihood = likelihood_at(problem, box.at)
    widening = posterior.quantile / NORMAL
    deviations = changes @ posterior.root.T / widening
    gaussian = 0.5 * np.sum(deviations**2, axis=1)
    at_estimate = likelihood.rows(box.at[None])
    least = 0.5 * float(np.sum(at_estimate**2))

    def too_unlikely(candidates: Array, rows: Index) -> Mask:
        residuals = likelihood.rows(box.points(candidates))
        cost = 0.5 * np.sum(residuals**2, axis=1)
        # a simulation that diverged is as unlikely as can be
        increase = np.nan_to_num(cost - least, nan=np.inf)
        return increase > widening**2 * gaussian[rows]

    def moved_back(start: Array, end: Array, rows: Index) -> Array:
        """Return how far rows may go from a start towards an end, by halving."""
        way = end[rows] - start[rows]
        part = np.zeros(len(rows))
        if not len(rows):
            return way
        step = 0.5
        for _ in range(HALVINGS):
            tried = part + step
            far = too_unlikely(start[rows] + tried[:, None] * way, rows)
            part = np.where(far, part, tried)
            step *= 0.5
        return start[rows] + part[:, None] * way

    # the same changes without the directions that the logs leave wide open
    # where the Gaussian ends far outside what the logs allow, it is along these
    variances, axes = np.linalg.eigh(posterior.covariance)
    narrow = axes[:, np.sqrt(variances) < WIDE_OPEN]
    projected = changes @ narrow @ narrow.T
    # a projection of a point in the box may lie outside it
    below, above = box.room
    narrowed = np.clip(projected, -below, above)
    every = np.arange(len(changes))
    unlikely = every[too_unlikely(changes, every)]
    still_unlikely = unlikely[too_unlikely(narrowed[unlikely], unlikely)]
    likely_again = np.setdiff1d(unlikely, still_unlikely)
    kept = changes.copy()
    kept[likely_again] = moved_back(narrowed, changes, likely_again)
    estimate = np.zeros_like(narrowed)
    kept[still_unlikely] = moved_back(estimate, narrowed, still_unlikely)
    return kept


def within(posterior: Posterior, n: int, rng: Generator) -> Array:
    """Return n draws of relative changes of the p parameters that vary, inside their
    bounds, (n, p).

    They are as wide as the intervals, which are Student's.
    """
    # with z standard normal, a change is `spread` z
    inverse = solve_triangular(posterior.root, np.eye(len(posterior.root)))
    spread = posterior.quantile / NORMAL * inverse
    walls = np.concatenate([spread, -spread])
    gaps = posterior.box.room.ravel()
    point = np.zeros(len(spread))
    points = np.empty((n, len(spread)))
    for motion in range(FORGOTTEN + BETWEEN * n):
        _move(point, rng.normal(size=len(point)), walls, gaps)
        points[max(motion - FORGOTTEN, 0) // BETWEEN] = point
    return points @ spread.T


@njit(cache=True)
def _move(point: Array, speed: Array, walls: Array, gaps: Array) -> None:
    """Move a point, (p,), for a quarter of a period, inside walls · point + gaps >= 0,
    (m, p) and (m,)."""
    left = 0.5 * np.pi
    for _ in range(MOST_BOUNCES):
        towards = walls @ speed
        there = walls @ point
        first = left
        met = -1
        for k in range(len(gaps)):
            # along a wall's normal the point swings between -reach and reach
            reach = np.sqrt(towards[k] ** 2 + there[k] ** 2)
            if reach <= gaps[k]:
                continue
            phase = np.arctan2(-towards[k], there[k])
            # rounding may lead a little beyond what a cosine can be
            cosine = min(max(-gaps[k] / reach, -1.0), 1.0)
            turn = np.arccos(cosine)
            time = (turn - phase) % (2.0 * np.pi)
            if TOUCHING < time < first:
                first = time
                met = k
        moved = speed * np.sin(first) + point * np.cos(first)
        speed[:] = speed * np.cos(first) - point * np.sin(first)
        point[:] = moved
        if met < 0:
            return
        wall = walls[met]
        # it is thrown back: what is towards the wall changes its sign
        along = np.sum(wall * speed) / np.sum(wall * wall)
        speed -= 2.0 * along * wall
        left -= first


class DriftingAngles:
    """Angles of n machines that drift from their models', as the error model says, and
    sensors with noise.

    Args:
        numbers: of each of J joints' error (`posterior.error_filter.NUMBERS`) in rad and
            s, shape (J, 5); 0 of those without errors.
        n: machines.
        period: between steps [s].
    """

    def __init__(self, numbers: Array, n: int, period: float) -> None:
        sensor, rate, way, lasting, time = numbers.T
        self._sensor = np.sqrt(sensor)
        self._way = way
        self._grown = rate * period
        # a first-order process keeps this part of itself from step to step, and so much
        # is added that its variance stays
        lasts = np.where(time > 0.0, time, 1.0)
        self._kept = np.exp(-period / lasts)
        self._lasting = np.sqrt(lasting * (1.0 - self._kept**2))
        self._drift = np.zeros((n, len(numbers)))
        self._passing = np.zeros((n, len(numbers)))

    def reset(self, rows: Array | slice = slice(None)) -> None:
        """Begin again without any error."""
        self._drift[rows] = 0.0  # pyright: ignore[reportArgumentType, reportCallIssue]
        self._passing[rows] = 0.0  # pyright: ignore[reportArgumentType, reportCallIssue]

    def step(self, way: Array, rng: Generator) -> Array:
        """Go on for a period in which models moved by a way [rad]; return the errors
        [rad], (n, J) each."""
        drifted, lasted = rng.normal(size=(2, *way.shape))
        variance = self._grown + self._way * np.abs(way)
        self._drift += np.sqrt(variance) * drifted
        self._passing = self._kept * self._passing + self._lasting * lasted
        return self._drift + self._passing

    def noise(self, rng: Generator) -> Array:
        """Return the noise of the sensors [rad], (n, J)."""
        return self._sensor * rng.normal(size=self._drift.shape)


def error_numbers(model: IdentifiedModel) -> Array:
    """Return the numbers of each joint's error in rad and s, (J, 5); 0 where a fit did
    not compare it."""
    errors = model.summarise().errors
    numbers = np.zeros((len(model.settings.arm.joint_names), 5))
    for column in range(len(numbers)):
        error = errors.get(f"q{column + 1}")
        if error is not None:
            numbers[column] = error.numbers
    return numbers
