"""A fit's result as `estimate.yaml` and `--json` hold it."""

import numpy as np

from hydroid.estimate import FitSummary, NamedEstimate, ParameterEstimate, finite
from hydroid.fitting.fit import Fit
from hydroid.problem.problem import Problem


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
    found = fit.uncertainty
    low, high = found.interval[i]
    return ParameterEstimate(
        value=float(fit.best.theta[i]),
        unit=problem.parameters.parameters[i].unit,
        sd=finite(found.standard_deviation[i]),
        interval=(finite(low), finite(high)),
        flag=found.status[i].flag.value,
        at_bound=found.status[i].at_bound,
    )
