"""The refinement of an estimate: least squares over all channels, with what is known as further measurements."""

import logging
from collections.abc import Callable

import numpy as np

from hydroid.fitting.journal import Journal, question_of
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import Refinement, least_squares
from hydroid.settings.search import RefinementSettings
from hydroid.uncertainty.noise import prior_weight

ROUNDS = 4
"""times at most that the noise is estimated, to weigh the logs against what is known"""
SETTLED = 0.02
"""relative change of the noise below which another round would change nothing"""

_log = logging.getLogger(__name__)


def refine(
    problem: Problem,
    theta: Array,
    settings: RefinementSettings,
    watch: Callable[[int], None],
    journal: Journal | None = None,
) -> Refinement:
    """Improve an estimate by bounded least squares.

    Statements of `problem.priors` join as residuals of (value - known) / sd times what a score counts
    beside the logs' noise (`prior_weight`), which is taken at the start, and again at the result, until it
    settles.

    Args:
        problem: the problem.
        theta: where to start, shape (P,).
        settings: when to end.
        watch: is told how many simulations were made so far.
        journal: what an interrupted run has simulated already.

    Returns:
        Its point is one of the unit box of the free parameters.

    Raises:
        RunError: the journal cannot be written.
    """
    question = question_of(problem, theta, settings)
    known = None if journal is None else journal.refined(question)
    if known is not None:
        result, simulated = known
        watch(simulated)
        return result
    simulate = problem.residuals if journal is None else journal.residuals(problem)
    result, simulated = _refine(problem, simulate, theta, settings, watch)
    _log.info("refinement of %d parameters: %s", result.point.size, _words(result, simulated))
    if journal is not None:
        journal.end(question, result, simulated)
    return result


def _refine(
    problem: Problem,
    simulate: Callable[[Array], Array],
    theta: Array,
    settings: RefinementSettings,
    watch: Callable[[int], None],
) -> tuple[Refinement, int]:
    """The same with the residuals of `simulate`, theta (n, P) -> (n, R), and the number of simulations."""
    simulated, parameters, priors = 0, problem.parameters, problem.priors
    noise = _noise(problem, simulate, theta) if len(priors) else 0.0

    def residuals(unit: Array) -> Array:
        nonlocal simulated
        simulated += len(unit)
        watch(simulated)
        points = parameters.from_unit(unit)
        rows = simulate(points)
        return np.column_stack([rows, noise * priors.scores(points)]) if len(priors) else rows

    result = least_squares(parameters.to_unit(theta[None])[0], residuals, settings)
    for _ in range(ROUNDS - 1 if len(priors) else 0):
        before, noise = noise, _noise(problem, simulate, parameters.from_unit(result.point[None])[0])
        if not abs(noise - before) > SETTLED * before:
            break
        result = least_squares(result.point, residuals, settings)
    return result, simulated


def _noise(problem: Problem, simulate: Callable[[Array], Array], theta: Array) -> float:
    return prior_weight(problem.channels, simulate(theta[None])[0], problem.settings.objective)


def _words(result: Refinement, simulated: int) -> str:
    """A line for the run's log."""
    cost = f"half the sum of squares {result.cost_before:.6g} to {result.cost_after:.6g}"
    return f"{cost} in {simulated} simulations; {result.ending.value}"
