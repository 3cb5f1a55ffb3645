"""A fit's result as `estimate.yaml` and `--json` hold it."""

from typing import Literal

import numpy as np

from hydroid.estimate import FitSummary, NamedEstimate, ParameterEstimate, finite
from hydroid.fitting.fit import Fit
from hydroid.parameters import Parameter
from hydroid.problem.problem import Problem
from hydroid.uncertainty.covariance import NO_EFFECT, NOT_DETERMINED, WEAK, at_bounds

_FLAGS = {NO_EFFECT: "no effect", NOT_DETERMINED: "not identifiable", WEAK: "weakly identifiable"}


def summarise(problem: Problem, fit: Fit) -> FitSummary:
    """Return the final estimate with its uncertainty, and the estimates it was chosen from."""
    objective = 1.0 if problem.settings.objective.relative else 180 / np.pi
    names = problem.parameters.names
    return FitSummary(
        stage=problem.settings.stage,
        estimate={name: _parameter(problem, fit, i) for i, name in enumerate(names)},
        final=fit.final,
        converged=None if fit.refinement is None else fit.refinement.ending.converged,
        ending=None if fit.refinement is None else fit.refinement.ending.value,
        rms_deg=finite(np.degrees(fit.best.rms)),
        seed=problem.settings.search.seed,
        simulations=int(fit.history[-1, 2]),
        diverged=int(fit.history[-1, 3]),
        estimates={
            e.name: NamedEstimate(
                values=problem.parameters.mapping(e.theta),
                rms_deg=finite(np.degrees(e.rms)),
                objective=finite(objective * e.overall),
            )
            for e in fit.estimates.values()
        },
    )


def _parameter(problem: Problem, fit: Fit, i: int) -> ParameterEstimate:
    parameter, found = problem.parameters.parameters[i], fit.uncertainty
    value = float(fit.best.theta[i])
    low, high = found.interval[i]
    free = bool(found.free[i])
    word = next((word for flag, word in _FLAGS.items() if flag in found.flags[i]), "identifiable")
    return ParameterEstimate(
        value=value,
        unit=parameter.unit,
        sd=finite(found.standard_deviation[i]),
        interval=(finite(low), finite(high)),
        flag=word if free else "fixed",
        at_bound=_bound(parameter, value) if free else None,
    )


def _bound(parameter: Parameter, value: float) -> Literal["lower", "upper"] | None:
    lower, upper = (bool(at) for _, at in at_bounds(parameter, value))
    return "lower" if lower else "upper" if upper else None
