"""Refinement of an estimate: least squares over all channels, with the priors as further measurements."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hydroid.fitting.checkpoints import Arrays, Checkpoints, saving
from hydroid.parameters import Array
from hydroid.posterior.noise import prior_weight
from hydroid.posterior.open_start import least_squares_rows, with_open_start
from hydroid.problem.problem import Problem
from hydroid.search.descent import Descent, start
from hydroid.search.least_squares import step
from hydroid.settings.search import RefinementSettings

SETTLED = 1e-3
"""relative change of the noise below which the priors keep their weight"""
MAX_NOISES = 8
"""times at most that the noise is estimated: its model may jump to and fro between two orders"""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Refinement:
    """A refinement under way.

    Attributes:
        descent: over the residuals, then the priors' scores times `weight`.
        weight: residual that a prior's standard deviation counts [rad].
        anchor: where the noise, and the effect of open start angles, were estimated: shape (p,).
        noises: how often they were.
    """

    descent: Descent
    weight: float
    anchor: Array
    noises: int = 1

    def arrays(self) -> Arrays:
        own = {"weight": self.weight, "anchor": self.anchor, "noises": self.noises}
        return self.descent.arrays() | {name: np.asarray(value) for name, value in own.items()}


def refine(
    problem: Problem,
    theta: Array,
    settings: RefinementSettings,
    progress: Callable[[str, int, float], None] | None = None,
    checkpoints: Checkpoints | None = None,
    name: str = "refined",
) -> Descent:
    """Improve an estimate by bounded least squares.

    Priors join as residuals of (value - prior) / sd times what one standard deviation counts beside the logs'
    noise (`prior_weight`). The noise, and the effect of open start angles, are estimated at the start, and
    again where a Jacobian is taken, until they settle. Between two Jacobians nothing is stored: a resumed
    refinement repeats the steps since the last one.

    Args:
        problem: the problem.
        theta: where to start, shape (P,).
        settings: when to end.
        progress: takes the name, the number of simulations and the rms error [rad] so far.
        checkpoints: where it continues from, and stores how far it is; a result is stored too.
        name: of this refinement among them.

    Raises:
        RunError: the checkpoint cannot be written.
    """
    checkpoints = {} if checkpoints is None else checkpoints
    stored = checkpoints.get(name)
    if stored is None:
        now = _estimated(problem, problem.parameters.to_unit(theta))
    else:
        own = float(stored["weight"]), stored["anchor"], int(stored["noises"])
        now = _Refinement(Descent.from_arrays(stored), *own)
        if now.descent.ended:
            return now.descent
    residuals = _residuals(problem, now)
    with saving(checkpoints, name) as keep:
        while not now.descent.ended:
            if not len(now.descent.jacobian):
                after = _following(problem, now)
                residuals = residuals if after is now else _residuals(problem, after)
                now = after
                keep(now.arrays)
            now = replace(now, descent=step(now.descent, residuals, settings))
            if progress is not None:
                error = problem.rms(now.descent.residual[None, : problem.measured.size])[0]
                progress(name, now.descent.evaluations, float(error))
        keep(now.arrays)
    _log.info("refinement of %d parameters: %s", now.descent.point.size, now.descent)
    return now.descent


def _estimated(problem: Problem, unit: Array, row: Array | None = None) -> _Refinement:
    """Begin at a point of the unit box, (p,), with the noise there; `row`, (R,): its residuals, if known."""
    theta, weight = problem.parameters.from_unit(unit[None]), 0.0
    here = with_open_start(problem, theta[0]).residuals(theta)[0] if row is None else row
    if len(problem.priors) or problem.leaves_start_open:
        weight = prior_weight(problem.channels, here, problem.settings.objective)
    return _Refinement(start(unit, np.append(here, weight * problem.priors.scores(theta))), weight, unit)


def _following(problem: Problem, now: _Refinement) -> _Refinement:
    """Return the refinement with the noise estimated at its point, if it has changed."""
    if not now.weight or now.noises == MAX_NOISES:
        return now
    row, point = now.descent.residual[: problem.measured.size], now.descent.point
    weight = prior_weight(problem.channels, row, problem.settings.objective)
    if abs(weight - now.weight) <= SETTLED * now.weight:
        return now
    here = _estimated(problem, point, None if problem.leaves_start_open else row)
    descent = replace(now.descent, residual=here.descent.residual, cost=here.descent.cost)
    return replace(here, descent=descent, noises=now.noises + 1)


def _residuals(problem: Problem, now: _Refinement) -> Callable[[Array], Array]:
    """What least squares minimises: points of the unit box, (n, p), to residuals and weighed scores."""
    rows = least_squares_rows(problem, problem.parameters.from_unit(now.anchor), now.weight)
    return lambda unit: rows(problem.parameters.from_unit(unit))
