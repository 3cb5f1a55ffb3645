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

FORGOTTEN, BETWEEN = 20, 4
"""motions before the first draw, and between two: with bounds, one alone does not
forget where it began"""
MOST_BOUNCES = 10_000  # of one motion
WIDE_OPEN = 0.1
"""relative standard deviation from which on a direction is one in which no model is
linear"""
HALVINGS = 6  # of a draw's part: to 2 %
TOUCHING = 1e-9  # of a period, within which a wall is the one that was just met


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
        return float(np.sqrt(np.mean(information * np.diag(self.posterior.covariance))))


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
    known = stored_posterior(model)
    if known is None:
        hint = "name the folder of a fit, with the settings that it used"
        raise RunError("holds no covariance of these parameters", model.source, hint)
    if n < 1:
        raise SettingsError("needs one draw at least", "draws")
    changes = within(known, n, np.random.default_rng(seed))
    record = None if problem is not None else record_of(model)
    if record is not None:
        problem = Problem(model.settings, [p.log for p in record.fitted])
    if problem is not None:
        changes = on_their_level(known, changes, problem)
    return Draws(model, known.box.points(changes), known)


def on_their_level(known: Posterior, changes: Array, problem: Problem) -> Array:
    """Return changes, (n, p), moved back until logs and priors are as likely as the
    Gaussian has it there."""
    likelihood, wide = likelihood_at(problem, known.box.at), known.quantile / NORMAL
    level = 0.5 * np.sum((changes @ known.root.T / wide) ** 2, axis=1)
    least = 0.5 * float(np.sum(likelihood.rows(known.box.at[None]) ** 2))

    def too_unlikely(some: Array, rows: Index) -> Mask:
        cost = (
            0.5 * np.sum(likelihood.rows(known.box.points(some)) ** 2, axis=1) - least
        )
        return np.nan_to_num(cost, nan=np.inf) > wide**2 * level[rows]

    variances, axes = np.linalg.eigh(known.covariance)
    close = axes[:, np.sqrt(variances) < WIDE_OPEN]
    inner = np.clip(changes @ close @ close.T, -known.box.room[0], known.box.room[1])
    every = np.arange(len(changes))
    left = every[too_unlikely(changes, every)]
    hopeless = left[too_unlikely(inner[left], left)]
    found = changes.copy()
    for rows, base in (
        (np.setdiff1d(left, hopeless), inner),
        (hopeless, np.zeros_like(inner)),
    ):
        away = (inner if rows is hopeless else changes)[rows] - base[rows]
        part, step = np.zeros(len(rows)), 0.5
        for _ in range(HALVINGS if len(rows) else 0):
            tried = part + step
            far = too_unlikely(base[rows] + tried[:, None] * away, rows)
            part = np.where(far, part, tried)
            step *= 0.5
        found[rows] = base[rows] + part[:, None] * away
    return found


def within(known: Posterior, n: int, rng: Generator) -> Array:
    """Return n draws of relative changes of the p parameters that vary, inside their
    bounds, (n, p).

    They are as wide as the intervals, which are Student's.
    """
    # with z standard normal, a change is `spread` z
    spread = (
        known.quantile / NORMAL * solve_triangular(known.root, np.eye(len(known.root)))
    )
    walls = np.concatenate([spread, -spread])
    gaps = known.box.room.ravel()
    point, drawn = np.zeros(len(spread)), np.empty((n, len(spread)))
    for motion in range(FORGOTTEN + BETWEEN * n):
        _move(point, rng.normal(size=len(point)), walls, gaps)
        drawn[max(motion - FORGOTTEN, 0) // BETWEEN] = point
    return drawn @ spread.T


@njit(cache=True)
def _move(point: Array, speed: Array, walls: Array, gaps: Array) -> None:
    """Move a point, (p,), for a quarter of a period, inside walls · point + gaps >= 0,
    (m, p) and (m,)."""
    left = 0.5 * np.pi
    for _ in range(MOST_BOUNCES):
        towards, there = walls @ speed, walls @ point
        first, met = left, -1
        for k in range(len(gaps)):
            reach = np.sqrt(towards[k] ** 2 + there[k] ** 2)
            if reach <= gaps[k]:
                continue
            phase = np.arctan2(-towards[k], there[k])
            time = (np.arccos(min(max(-gaps[k] / reach, -1.0), 1.0)) - phase) % (
                2.0 * np.pi
            )
            if TOUCHING < time < first:
                first, met = time, k
        moved = speed * np.sin(first) + point * np.cos(first)
        speed[:] = speed * np.cos(first) - point * np.sin(first)
        point[:] = moved
        if met < 0:
            return
        wall = walls[met]
        speed -= 2.0 * np.sum(wall * speed) / np.sum(wall * wall) * wall
        left -= first


class DriftingAngles:
    """Angles of n machines that drift from their models', as the error model says, and
    sensors with noise.

    Args:
        numbers: of each of J joints' error (`posterior.error_model.NUMBERS`) in rad and
            s, shape (J, 5); 0 of those without errors.
        n: machines.
        period: between steps [s].
    """

    def __init__(self, numbers: Array, n: int, period: float) -> None:
        sensor, rate, way, lasting, time = numbers.T
        self._sensor, self._way = np.sqrt(sensor), way
        self._grown = rate * period
        self._kept = np.exp(-period / np.where(time > 0.0, time, 1.0))
        self._lasting = np.sqrt(lasting * (1.0 - self._kept**2))
        self._drift, self._passing = np.zeros((2, n, len(numbers)))

    def reset(self, rows: Array | slice = slice(None)) -> None:
        """Begin again without any error."""
        self._drift[rows] = 0.0  # pyright: ignore[reportArgumentType, reportCallIssue]
        self._passing[rows] = 0.0  # pyright: ignore[reportArgumentType, reportCallIssue]

    def step(self, way: Array, rng: Generator) -> Array:
        """Go on for a period in which models moved by a way [rad]; return the errors
        [rad], (n, J) each."""
        drifted, lasted = rng.normal(size=(2, *way.shape))
        self._drift += np.sqrt(self._grown + self._way * np.abs(way)) * drifted
        self._passing = self._kept * self._passing + self._lasting * lasted
        return self._drift + self._passing

    def noise(self, rng: Generator) -> Array:
        """Return the noise of the sensors [rad], (n, J)."""
        return self._sensor * rng.normal(size=self._drift.shape)


def error_numbers(model: IdentifiedModel) -> Array:
    """Return the numbers of each joint's error in rad and s, (J, 5); 0 where a fit did
    not compare it."""
    errors = model.summarise().errors
    joints = model.settings.arm.joint_names
    rows = [
        errors[f"q{joint}"].numbers if f"q{joint}" in errors else (0.0,) * 5
        for joint in range(1, 1 + len(joints))
    ]
    return np.array(rows)
