"""Loads that logs ask for: a mass at the tip that explains what a fit made without it
errs by.

A load is asked for where a model that carries one foretells parts of a log left out
clearly better. Its estimate and interval count with all other parameters as uncertain
as the fit left them: one Gauss-Newton step of the load and of these together, with the
fit's posterior as their prior. Where the fit compares pressures, they count too.
"""

from collections.abc import Sequence

import numpy as np

from hydroid.advice.adaptation import adapted, carrying, first_guess
from hydroid.arrays import Array, record
from hydroid.findings import Finding
from hydroid.fitting.left_out import is_better, not_fitted, refit
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.error_model import likelihood_at
from hydroid.posterior.posterior import NORMAL, STEP, stored_posterior
from hydroid.problem.problem import Problem
from hydroid.search.axes import differentiate
from hydroid.settings.arm import TIP_LOAD
from hydroid.settings.log import log_file

PART = 0.1
"""change of a load over which its effect is taken for linear, as a part of the load"""


@record
class Load:
    """A load at the tip that a log asks for.

    Attributes:
        log: name of the file.
        mass: beyond the payload that the settings state [kg].
        low, high: its 95 % interval [kg].
    """

    log: str
    mass: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.log}: {self.mass:.3g} kg ({self.low:.3g} to {self.high:.3g})"


def asked_loads(model: IdentifiedModel, logs: Sequence[Log]) -> list[Load]:
    """Return the loads of those logs that ask for one."""
    able = carrying(model)
    loads = list[Load]()
    for log in logs:
        problem = Problem(adapted(able, [TIP_LOAD], [log]), [log])
        errors = problem.output_errors(able.theta[None])[0]
        before = not_fitted(problem, able.theta, errors)
        begin = able.theta.copy()
        begin[-1] = first_guess(able)
        after = refit(problem, begin)
        if is_better(after, before, len(logs)):
            loads.append(load_of(model, log, problem, after.theta))
    return loads


def load_of(model: IdentifiedModel, log: Log, problem: Problem, theta: Array) -> Load:
    """Return the load of a log with its interval.

    Args:
        model: without the load.
        log: it alone is the problem's.
        problem: its last parameter is the load.
        theta: where all others are the model's, shape (P + 1,).
    """
    likelihood = likelihood_at(problem, theta)
    begun = float(theta[-1])

    def with_load(points: Array, load: float) -> Array:
        """Return innovations of the model's parameters, (n, P), with a load."""
        loads = np.full(len(points), load)
        return likelihood.innovations(np.column_stack([points, loads]))

    # the load counts in units of this change [kg]
    change = PART * max(begun, first_guess(model))
    others = theta[None, :-1]
    heavier = with_load(others, begun + change)[0]
    innovations = with_load(others, begun)[0]
    slopes = [heavier - innovations]
    prior = np.zeros((0, 1))
    quantile = NORMAL
    posterior = stored_posterior(model)
    if posterior is not None:
        slopes += [
            *differentiate(
                lambda points: with_load(points, begun),
                posterior.box,
                posterior.axes(STEP),
                innovations,
            )
        ]
        # the fit says nothing of the load, whose column comes first
        of_load = np.zeros(len(posterior.root))
        prior = np.column_stack([of_load, posterior.root])
        quantile = posterior.quantile
    rows = np.vstack([np.column_stack(slopes), prior])
    wanted = np.append(-innovations, np.zeros(len(prior)))
    # what the log does not determine stays as the fit has it
    covariance = np.linalg.pinv(rows.T @ rows, hermitian=True)
    step = covariance @ (rows.T @ wanted)
    mass = max(begun + change * float(step[0]), 0.0)
    half = change * quantile * float(np.sqrt(covariance[0, 0]))
    name = log_file(log.source).name
    return Load(name, mass, max(mass - half, 0.0), mass + half)


def load_finding(loads: Sequence[Load]) -> list[Finding]:
    """Return what is said of loads that logs ask for; nothing without any."""
    if not loads:
        return []
    stated = ", ".join(f"{load.log}: {load.mass:.3g}" for load in loads)
    numbers = {"stated": f"{{{stated}}}"}
    return [Finding("load asked for", "note", tuple(map(str, loads)), numbers)]
