"""Intervals without the linear approximation: profile likelihood, and residual block bootstrap."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from hydroid.errors import SettingsError
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings
from hydroid.uncertainty.covariance import COVERAGE, Uncertainty, decompose

POINTS = 6
"""grid points on each side of the estimate"""
REACH = 3.0
"""standard deviations that the grid reaches; of a parameter that is not determined it covers the bounds"""
THRESHOLD = float(chi2.ppf(COVERAGE, 1))
"""deviance beyond which a value lies outside the interval"""
QUICK = RefinementSettings(iterations=20, step_tolerance=1e-10)
STEPS = 4
"""Gauss-Newton steps of a bootstrap's fit"""
CHUNK = 50
"""refits that are simulated together"""

Tell = Callable[[str, int, int], None]
"""is told what is being done, how much of it is done, and how much there is"""


@dataclass(frozen=True, eq=False)
class Profile:
    """Deviance of a parameter held at several values, the others fitted anew.

    Attributes:
        name: of the parameter.
        values: it was held at, increasing, the estimate among them, shape (n,).
        deviance: rise of the cost in units of the noise, (n,): about ((value - estimate) / sd)² near it.
        interval: where the deviance stays below THRESHOLD; a side on which it does so throughout is infinite.
    """

    name: str
    values: Array
    deviance: Array
    interval: tuple[float, float]


def profile(problem: Problem, found: Uncertainty, name: str) -> Profile:
    """Hold a parameter on a grid of values and refinement the others, each from its neighbour's result.

    With autocorrelated noise the rise of a sum of squares is no likelihood ratio; it is scaled so that its
    curvature is the estimate's variance (L. Pace, A. Salvan, N. Sartori, 2011).

    Raises:
        SettingsError: no free parameter of that name.
    """
    names = problem.parameters.names
    if name not in names or not found.free[names.index(name)]:
        free = ", ".join(n for n, is_free in zip(names, found.free, strict=True) if is_free)
        raise SettingsError(f"no free parameter {name!r} to profile", where="--profile", hint=f"free: {free}")
    i = names.index(name)
    lower, upper = problem.parameters.lower[i], problem.parameters.upper[i]
    reach = REACH * found.standard_deviation[i]
    low, high = max(lower, found.theta[i] - reach), min(upper, found.theta[i] + reach)
    residuals, scale = _with_statements(problem, found), _deviance_unit(found, i)
    at = float(np.sum(residuals(found.theta[None])[0] ** 2))
    sides: list[list[tuple[float, float]]] = []
    for end in (low, high):
        start, side = found.theta, list[tuple[float, float]]()
        for value in np.linspace(found.theta[i], end, POINTS + 1)[1:] if end != found.theta[i] else ():
            start, cost = _fit_others(problem, residuals, start, i, float(value))
            side.append((float(value), (cost - at) / scale))
        sides.append(side)
    points = [*reversed(sides[0]), (float(found.theta[i]), 0.0), *sides[1]]
    values, deviance = np.array(points).T
    centre = len(sides[0])
    return Profile(
        name,
        values,
        deviance,
        (
            _crossing(values[centre::-1], deviance[centre::-1], -np.inf),
            _crossing(values[centre:], deviance[centre:], np.inf),
        ),
    )


def bootstrap(problem: Problem, found: Uncertainty, count: int, seed: int, tell: Tell) -> Array:
    """Refit `count` times after the residual was redrawn in blocks; estimates of shape (count, P).

    Blocks are ten times as long as the noise's memory, drawn from the log's ring of residuals, the same for
    all channels of a log (H. R. Künsch, 1989); they are scaled up by what the fit took of the noise. The fits
    are Gauss-Newton steps with the estimate's own derivatives, within the directions that the data feel.
    """
    rng, rows = np.random.default_rng(seed), found.jacobian.residual
    pseudo = _pseudo_inverse(found)
    residuals = _with_statements(problem, found)
    base, free = residuals(found.theta[None])[0], found.free
    lower, upper = problem.parameters.lower[free], problem.parameters.upper[free]
    out = np.tile(found.theta, (count, 1))
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        tell("refits", first, count)
        shift = np.zeros((part.stop - part.start, base.size))
        shift[:, : rows.size] = _redrawn(problem, found, part.stop - part.start, rng) - rows
        for _ in range(STEPS):
            now = residuals(out[part]) + shift
            step = -(now @ pseudo) * found.jacobian.scale[free]
            out[part.start : part.stop, free] = np.clip(
                out[part][:, free] + np.nan_to_num(step), lower, upper
            )
    return out


def _redrawn(problem: Problem, found: Uncertainty, count: int, rng: np.random.Generator) -> Array:
    """Residuals put together from blocks of the log's own, shape (count, R)."""
    out = np.empty((count, found.jacobian.residual.size))
    for log in dict.fromkeys(channel.log for channel in problem.channels):
        mine = [(c, n) for c, n in zip(problem.channels, found.noise, strict=True) if c.log == log]
        samples = len(mine[0][0].measured)
        memory = max(noise.correlation_time for _, noise in mine)
        block = int(min(max(np.ceil(samples ** (1 / 3)), 10 * memory), max(samples // 10, 1)))
        starts = rng.integers(samples, size=(count, -(-samples // block)))
        index = ((starts[:, :, None] + np.arange(block)).reshape(count, -1) % samples)[:, :samples]
        for channel, noise in mine:
            residual = found.jacobian.residual[channel.rows]
            level = float(np.sqrt(np.mean(residual**2)))
            residual = residual - residual.mean()
            out[:, channel.rows] = residual[index] * (noise.level / level if level > 0 else 0.0)
    return out


def _with_statements(problem: Problem, found: Uncertainty) -> Callable[[Array], Array]:
    """Residuals with the statements' scores below them, as the refinement has them, (n, P) -> (n, R + M)."""
    unit, priors = found.jacobian.unit, problem.priors

    def residuals(theta: Array) -> Array:
        return np.hstack([problem.residuals(theta), unit * priors.scores(theta)])

    return residuals


def _fit_others(
    problem: Problem, residuals: Callable[[Array], Array], start: Array, i: int, value: float
) -> tuple[Array, float]:
    """Refinement all but parameter i, held at a value; the result, shape (P,), and its sum of squares."""
    parameters = problem.parameters
    column = int(np.sum(parameters.free[:i]))

    def full(unit: Array) -> Array:
        theta = parameters.from_unit(np.insert(unit, column, 0.5, axis=1))
        theta[:, i] = value
        return theta

    unit = np.delete(parameters.to_unit(start[None])[0], column)
    if not unit.size:
        theta = full(np.empty((1, 0)))
        return theta[0], float(np.sum(residuals(theta)[0] ** 2))
    result = least_squares(unit, lambda points: residuals(full(points)), QUICK)
    return full(result.point[None])[0], 2 * result.cost_after


def _pseudo_inverse(found: Uncertainty) -> Array:
    """Relative changes that best explain a residual with its statements, shape (R + M, p)."""
    directions, values, course = decompose(found.free, found.jacobian)
    taken = values > 0
    return course[taken].T @ (directions[:, taken] / values[taken]).T


def _deviance_unit(found: Uncertainty, i: int) -> float:
    """Rise of the sum of squares that is one unit of deviance of parameter i."""
    bread = np.sum(_pseudo_inverse(found) ** 2, axis=0)  # diagonal of (J J')^-1
    column = int(np.sum(found.free[:i]))
    if np.isfinite(found.relative[i]) and bread[column] > 0:
        return float(found.relative[i] ** 2 / bread[column])
    known = np.isfinite(found.relative[found.free]) & (bread > 0)
    if known.any():
        return float(np.max(found.relative[found.free][known] ** 2 / bread[known]))
    return float(np.mean([noise.level**2 for noise in found.noise]))


def _crossing(values: Array, deviance: Array, none: float) -> float:
    """Where the deviance first rises above THRESHOLD, its root interpolated; `none` where it never does."""
    root = np.sqrt(np.maximum(deviance, 0.0))
    above = np.flatnonzero(deviance > THRESHOLD)
    if not len(above):
        return none
    b = int(above[0])
    share = (np.sqrt(THRESHOLD) - root[b - 1]) / (root[b] - root[b - 1])
    return float(values[b - 1] + share * (values[b] - values[b - 1]))
