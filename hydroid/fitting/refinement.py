"""Refinement of an estimate: maximum likelihood by least squares, with the priors as
further measurements."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hydroid.arrays import Array, Mask
from hydroid.fitting.checkpoints import Checkpoints, saving
from hydroid.fitting.step import Step
from hydroid.posterior.error_model import Likelihood
from hydroid.progress import LOGGER
from hydroid.search.descent import (
    Descent,
    Ending,
    LinearModel,
    derivatives,
    start,
    with_jacobian,
    without_jacobian,
)
from hydroid.search.least_squares import UNDAMPED, step
from hydroid.settings.search import RefinementSettings

SETTLED = 1.0
"""gain of the log-likelihood below which the numbers of the error model stay as they
are: so they settle"""

ROUGH = 1e-3
"""gain below which a least squares of output errors ends that is to lead near an
optimum"""

ENOUGH = 0.005
"""gain of the log-likelihood below which least squares ends that only leads on: what
weighs its errors makes its cost one"""
LARGEST = 0.5
"""tolerance [1] at most: with fewer errors left than ENOUGH"""

Refining = Callable[[Step, int, float], bool | None]
"""takes a step of the fit, its number of simulations, and its rms error [rad] so far;
returns whether its time is up"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Refinement(Descent):
    """A descent over innovations, then the priors' scores.

    Attributes:
        numbers: of the model of the errors, shape (S, 5).
        negative_log: of likelihood and priors at the point: what starts are compared
            by.
    """

    numbers: Array
    negative_log: float = np.inf


def refine(
    likelihood: Likelihood,
    theta: Array,
    settings: RefinementSettings,
    progress: Refining,
    checkpoints: Checkpoints,
    what: Step,
) -> Refinement:
    """Improve an estimate by bounded least squares of innovations.

    The error model is estimated at the start, anew where a Jacobian is taken, and at
    the end, until it settles. Between two Jacobians nothing is stored: a resumed
    refinement repeats the steps since the last one.

    It starts at theta, shape (P,). It continues from `checkpoints`, and stores there
    how far it is by the name of the step; a result too. Raises RunError: the checkpoint
    cannot be written.
    """
    parameters = likelihood.problem.parameters
    name = what.name
    if name in checkpoints:
        now = Refinement.from_arrays(checkpoints[name])
        if now.ended:
            return now
    else:
        now = _begun(likelihood, parameters.to_unit(theta))
    rows = _rows(likelihood, now)
    moved = False
    with saving(checkpoints, name) as keep:
        while not now.ended:
            if progress(what, now.evaluations, _rms_error(likelihood, now)):
                break
            if not len(now.jacobian):
                keep(now.arrays)  # a resumed refinement estimates the errors here, too
                now = _with_new_numbers(likelihood, now, nearby=True)
                rows = _rows(likelihood, now)
            now = step(now, rows, _tolerant(settings, now, what))
            moved = True
            if now.ending.converged:  # unless its errors are others by now
                now = _with_new_numbers(likelihood, now, nearby=False)
                rows = _rows(likelihood, now)
        now = replace(now, negative_log=_at(likelihood, now).negative_log(now.residual))
        if now.ended and what.on_its_way:
            now = without_jacobian(now)  # it is large
        # else a start that itself may have been reached too late
        if moved or now.ended:
            keep(now.arrays)
    if not now.ended:  # the checkpoint is where it goes on
        now = replace(now, ending=Ending.TIME)
    LOGGER.info("%s, %d parameters: %s", name, now.point.size, now)
    return now


def refine_from_afar(
    likelihood: Likelihood,
    theta: Array,
    settings: RefinementSettings,
    progress: Refining,
    checkpoints: Checkpoints,
    what: Step,
) -> Refinement:
    """Improve an estimate that may be far off, as `refine` does.

    There a model of the errors takes what the parameters have not explained yet for
    drift. Output errors know no drift. So a rough least squares of output errors comes
    first.
    """
    if np.isinf(likelihood.memory):
        return refine(likelihood, theta, settings, progress, checkpoints, what)
    rough = settings.changed({"gain_tolerance": max(settings.gain_tolerance, ROUGH)})
    afar = what.changed(phase="from afar")
    output_errors = likelihood.of_output_errors
    first = refine(output_errors, theta, rough, progress, checkpoints, afar)
    if first.ending is Ending.TIME:
        return first
    near = likelihood.problem.parameters.from_unit(first.point)
    result = refine(likelihood, near, settings, progress, checkpoints, what)
    return replace(result, evaluations=result.evaluations + first.evaluations)


def promised(likelihood: Likelihood, theta: Array, new: Mask) -> float:
    """Return the part of the squared errors that `new` parameters, (P,), promise to
    explain by the linear model at theta, (P,), of what the others leave.

    It is 1 where that cannot be told.
    """
    parameters = likelihood.problem.parameters
    begun = _begun(likelihood, parameters.to_unit(theta))
    columns = derivatives(_rows(likelihood, begun), begun.point, begun.residual)
    if begun.ended or not np.isfinite(columns).all():
        return 1.0
    others = columns * ~new[parameters.free, None]
    left = list[float]()
    for slopes in (others, columns):
        model = LinearModel(with_jacobian(begun, slopes.T))
        left.append(begun.cost - model.gain(model.step(UNDAMPED)))
    return 1.0 - left[1] / left[0]


def _tolerant(
    settings: RefinementSettings, now: Refinement, what: Step
) -> RefinementSettings:
    """Return the settings of the next iteration: a step that only leads on need not be
    exact."""
    if what.is_last or now.cost <= 0.0:
        return settings
    tolerance = min(max(settings.gain_tolerance, ENOUGH / now.cost), LARGEST)
    return settings.changed({"gain_tolerance": tolerance})


def _begun(likelihood: Likelihood, unit: Array) -> Refinement:
    """Begin at a point of the unit box, (p,), with the errors there."""
    problem = likelihood.problem
    theta = problem.parameters.from_unit(unit[None])
    errors = problem.output_errors(theta)
    if np.isfinite(errors).all():
        likelihood = likelihood.estimated(errors[0])
    innovations = likelihood.errors.innovations(errors)[0]
    begun = start(unit, np.append(innovations, problem.priors.scores(theta)))
    return Refinement(**vars(begun), numbers=likelihood.shown.numbers)


def _with_new_numbers(
    likelihood: Likelihood, now: Refinement, *, nearby: bool
) -> Refinement:
    """Return the refinement with the error model of its point, if that is clearly more
    likely.

    One that had converged then goes on.
    """
    problem = likelihood.problem
    errors = problem.output_errors(problem.parameters.from_unit(now.point[None]))
    before = _at(likelihood, now)
    after = before.estimated(errors[0], nearby=nearby)
    now = replace(now, evaluations=now.evaluations + 1)
    if (
        after.shown.log_likelihood(errors[0]) - before.shown.log_likelihood(errors[0])
        < SETTLED
    ):
        return now
    innovations = after.errors.innovations(errors)[0]
    rows = np.append(innovations, now.residual[innovations.size :])
    begun = start(now.point, rows)
    return replace(
        without_jacobian(now),
        residual=begun.residual,
        cost=begun.cost,
        fresh=False,
        slow=0,
        ending=Ending.UNDER_WAY,
        numbers=after.shown.numbers,
    )


def _at(likelihood: Likelihood, now: Refinement) -> Likelihood:
    return replace(likelihood, shown=replace(likelihood.shown, numbers=now.numbers))


def _rows(likelihood: Likelihood, now: Refinement) -> Callable[[Array], Array]:
    """Return what least squares minimises: points of the unit box, (n, p), to
    innovations and scores."""
    from_unit = likelihood.problem.parameters.from_unit
    rows = _at(likelihood, now).rows
    return lambda unit: rows(from_unit(unit))


def _rms_error(likelihood: Likelihood, now: Refinement) -> float:
    """Rms of the angles' errors at the point [rad]."""
    problem = likelihood.problem
    innovations = now.residual[None, : problem.measured.size]
    return problem.rms(_at(likelihood, now).errors.errors(innovations))[0]
