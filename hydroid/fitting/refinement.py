"""Refinement of an estimate: least squares over all channels, with the priors as further measurements."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hydroid.fitting.checkpoints import Checkpoints, saving
from hydroid.parameters import Array
from hydroid.posterior.linear import least_squares_rows, with_open_start
from hydroid.posterior.noise import prior_weight
from hydroid.problem.channels import UNFILTERED
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER
from hydroid.search.descent import Descent, Ending, start
from hydroid.search.least_squares import step
from hydroid.settings.search import RefinementSettings

SETTLED = 1e-3
"""relative change of the noise below which the priors keep their weight"""
MAX_NOISES = 8
"""times at most that the noise is estimated: its model may jump to and fro between two orders"""

Refining = Callable[[str, int, float], bool | None]
"""takes the name of a least squares, its number of simulations, and its rms error [rad] so far; returns
whether its time is up"""
ROUGH = 0.1
"""gain below which least squares without the prefilter ends"""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Refinement(Descent):
    """A descent over the residuals, then the priors' scores times `weight`.

    Attributes:
        weight: residual that a prior's standard deviation counts [rad].
        anchor: where the noise, and the effect of open start angles, were estimated: shape (p,).
        noises: how often they were.
    """

    weight: float
    anchor: Array
    noises: int = 1


def refine(
    problem: Problem,
    theta: Array,
    settings: RefinementSettings,
    progress: Refining,
    checkpoints: Checkpoints,
    name: str,
) -> Descent:
    """Improve an estimate by bounded least squares.

    Priors join as residuals of (value - prior) / sd times what one standard deviation counts beside the logs'
    noise (`prior_weight`). The noise, and the effect of open start angles, are estimated at the start, and
    again where a Jacobian is taken, until they settle. Between two Jacobians nothing is stored: a resumed
    refinement repeats the steps since the last one.

    Fast errors have more optima than slow ones: where there is a prefilter, least squares goes most of the
    way without it.

    It starts at theta, shape (P,). It continues from `checkpoints`, and stores there by its name how far it
    is; a result too.
    Raises RunError: the checkpoint cannot be written.
    """
    simulated = 0
    if any(channel.prefilter is not UNFILTERED for channel in problem.channels):
        rough = settings.changed({"gain_tolerance": max(settings.gain_tolerance, ROUGH)})
        first = refine(
            problem.from_afar(filtered=False), theta, rough, progress, checkpoints, f"{name} from afar"
        )
        if first.ending is Ending.TIME:
            return first
        theta, simulated = problem.parameters.from_unit(first.point), first.evaluations
    if name in checkpoints:
        now = _Refinement.from_arrays(checkpoints[name])
        if now.ended:
            return now
    else:
        now = _estimated(problem, problem.parameters.to_unit(theta))
        now = replace(now, evaluations=now.evaluations + simulated)
    residuals, moved = _residuals(problem, now), False
    with saving(checkpoints, name) as keep:
        while not now.ended:
            errors = problem.unfiltered(now.residual[None, : problem.measured.size])
            if progress(name, now.evaluations, problem.rms(errors)[0]):
                break
            if not len(now.jacobian):
                now = _following(problem, now)
                residuals = _residuals(problem, now)
                keep(now.arrays)
            now, moved = step(now, residuals, settings), True
        if moved or now.ended:  # else a start that itself may have been reached too late
            keep(now.arrays)
    if not now.ended:  # the checkpoint is where it goes on
        now = replace(now, ending=Ending.TIME)
    LOGGER.info("refinement of %d parameters: %s", now.point.size, now)
    return now


def _estimated(problem: Problem, unit: Array, row: Array | None = None) -> _Refinement:
    """Begin at a point of the unit box, (p,), with the noise there; `row`, (R,): its residuals, if known."""
    theta, weight = problem.parameters.from_unit(unit[None]), 0.0
    here = with_open_start(problem, theta[0]).residuals(theta)[0] if row is None else row
    if len(problem.priors) or problem.leaves_start_open:
        weight = prior_weight(problem, here)
    begun = start(unit, np.append(here, weight * problem.priors.scores(theta)))
    return _Refinement(**vars(begun), weight=weight, anchor=unit)


def _following(problem: Problem, now: _Refinement) -> _Refinement:
    """Return the refinement with the noise estimated at its point, if it has changed."""
    row = now.residual[: problem.measured.size]
    if not now.weight or now.noises == MAX_NOISES:
        return now
    if abs(prior_weight(problem, row) - now.weight) <= SETTLED * now.weight:
        return now
    here = _estimated(problem, now.point, None if problem.leaves_start_open else row)
    return replace(
        now,
        residual=here.residual,
        cost=here.cost,
        weight=here.weight,
        anchor=here.anchor,
        noises=now.noises + 1,
    )


def _residuals(problem: Problem, now: _Refinement) -> Callable[[Array], Array]:
    """What least squares minimises: points of the unit box, (n, p), to residuals and weighed scores."""
    rows = least_squares_rows(problem, problem.parameters.from_unit(now.anchor), now.weight)
    return lambda unit: rows(problem.parameters.from_unit(unit))
