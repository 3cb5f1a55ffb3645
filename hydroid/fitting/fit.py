"""A fit: search, the estimates taken from it, refinement, and the uncertainty of the last estimate."""

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hydroid.fitting.memo import Memo
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.refinement import Checkpoints, Refinement, refine
from hydroid.fitting.search import Checkpoint, Search, SearchState
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty, uncertainty
from hydroid.posterior.directions import Identifiability, identifiability
from hydroid.posterior.quantities import Quantities, quantities
from hydroid.posterior.sources import Strain, strains
from hydroid.problem.objectives import overall_objective, segment_objectives
from hydroid.problem.problem import Evaluation, Problem
from hydroid.search import compromise
from hydroid.search.pareto import non_dominated

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Estimate:
    """One parameter set with its response.

    theta: shape (P,). segments: objectives by segment, shape (S,). overall: norm over the whole record.
    rms: of the output error [rad]. responses: simulated outputs [rad], (T, K) a log.
    """

    name: str
    theta: Array
    segments: Array
    overall: float
    rms: float
    responses: tuple[Array, ...]

    @property
    def usable(self) -> bool:
        """Whether it could be simulated: a compromise between sets that could need not."""
        return bool(np.isfinite(self.rms))


@dataclass(frozen=True)
class Fit:
    """What a fit found.

    estimates: by name; `final` names the one to use. front: the non-dominated sets, shape (n, P), and their
    objectives. history: shape (G, len(HISTORY)). refinements: by the estimate that each gave. uncertainty,
    identifiability, quantities: what the logs say about the final estimate. strains: priors far from it.
    seconds: wall-clock time of "search", "refinement" and "uncertainty" [s]; of a resumed fit, since it was
    resumed.
    """

    estimates: dict[str, Estimate]
    final: str
    front: tuple[Array, Evaluation]
    history: Array
    refinements: dict[str, Refinement]
    uncertainty: Uncertainty
    identifiability: Identifiability
    quantities: Quantities
    strains: tuple[Strain, ...]
    seconds: Mapping[str, float]

    @property
    def refinement(self) -> Refinement | None:
        """The last refinement; None where there was none."""
        return next(reversed(self.refinements.values()), None)

    @property
    def converged(self) -> bool:
        """Whether every refinement reached an optimum."""
        return all(r.ending.converged for r in self.refinements.values())

    @property
    def best(self) -> Estimate:
        """The estimate to use."""
        return self.estimates[self.final]

    @property
    def searched(self) -> Estimate:
        """The search's own estimate, before the refinement."""
        return next(iter(self.estimates.values()))

    @property
    def effects(self) -> Array:
        """Rms change of the response per 1 % of each parameter [rad], shape (P,)."""
        return self.uncertainty.jacobian.effects

    @property
    def without_effect(self) -> NDArray[np.bool_]:
        """Parameters that the outputs do not feel at all, shape (P,)."""
        return self.uncertainty.jacobian.without_effect


class Watcher(Protocol):
    """What a fit tells while it runs."""

    def generation(self, row: Array) -> None:
        """Take a row of HISTORY."""
        ...

    def refining(self, simulated: int, rms: float) -> None:
        """Take the number of simulations of the refinement, and its rms error [rad] so far."""
        ...


def fit(
    problem: Problem,
    save: Callable[[SearchState, Memo], None],
    watch: Watcher,
    checkpoint: Checkpoint | None = None,
    refinements: Checkpoints | None = None,
) -> Fit:
    """Search, take the estimates, refine the best of them.

    Args:
        problem: the estimation problem with its settings.
        save: keeps the search's state now and then.
        watch: takes how far the fit is.
        checkpoint: where an interrupted search was.
        refinements: how far interrupted refinements were; takes how far these are.

    Raises:
        RunError: every simulated candidate diverged.
    """
    settings, began = problem.settings, time.perf_counter()
    memo = Memo(problem)
    if checkpoint is not None:
        memo.restore(*checkpoint.memo)
    if settings.search.algorithm == "multistart":
        search = Multistart(problem, settings.search, memo, watch.refining, refinements)
    else:
        search = Search(problem, settings.search, memo)
    state = search.run(checkpoint.state if checkpoint else None, save, watch.generation)
    theta = search.theta(state.population)
    evaluation = memo.evaluate(theta)
    if search.single:
        candidates = {"best": compromise.best(theta, state.population.objectives[:, 0])}
    else:
        candidates = _from_front(theta, evaluation, memo, settings.search.compromise)
    estimates = _usable_first(_estimates(problem, candidates))
    start = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
    searched = time.perf_counter()
    results, last, final = dict[str, Refinement](), problem, next(iter(estimates))
    for name in _refined(problem):
        last = problem.freed() if name == "joint" else problem
        assert settings.refinement is not None
        result = refine(last, start.theta, settings.refinement, watch.refining, refinements, name)
        if not result.ending.converged:
            _log.warning(
                "The least-squares refinement did not converge: %s. The estimate '%s' need not be an "
                "optimum.",
                result.ending.value,
                name,
            )
        estimates |= _estimates(last, {name: last.parameters.from_unit(result.point[None])[0]})
        results[name], start, final = result, estimates[name], name
    refined = time.perf_counter()
    told = uncertainty(last, estimates[final].theta)
    directions = identifiability(last, told)
    determined = quantities(last, told)
    seconds = {
        "search": searched - began,
        "refinement": refined - searched,
        "uncertainty": time.perf_counter() - refined,
    }
    return Fit(
        estimates,
        final,
        _front(theta, evaluation, memo),
        state.history,
        results,
        told,
        directions,
        determined,
        strains(last, told.theta, told.jacobian),
        seconds,
    )


def _refined(problem: Problem) -> list[str]:
    """Names of the estimates that refinements give, in order."""
    if problem.settings.refinement is None:
        return []
    return ["refined", "joint"] if problem.settings.joint_refinement else ["refined"]


def _estimates(problem: Problem, candidates: dict[str, Array]) -> dict[str, Estimate]:
    """Simulate candidates by name, each of shape (P,), and measure them."""
    theta = np.array(list(candidates.values()))
    responses = problem.responses(theta)
    errors = np.concatenate([channel.residual(responses) for channel in problem.channels], axis=1)
    objective = problem.settings.objective
    segments = segment_objectives(errors, problem.measured, problem.bounds, objective)
    overall, rms = overall_objective(errors, problem.measured, objective), problem.rms(errors)
    return {
        name: Estimate(
            name,
            theta[i],
            segments[i],
            float(overall[i]),
            float(rms[i]),
            tuple(r.angle[i] for r in responses),
        )
        for i, name in enumerate(candidates)
    }


def _usable_first(estimates: dict[str, Estimate]) -> dict[str, Estimate]:
    """The same with those that diverged behind the others; the first is the search's own."""
    for name, estimate in estimates.items():
        if not estimate.usable:
            _log.warning("the estimate %s diverged when it was simulated; it is not used", name)
    return dict(sorted(estimates.items(), key=lambda item: not item[1].usable))


def _from_front(theta: Array, evaluation: Evaluation, memo: Memo, first: str) -> dict[str, Array]:
    """The three ways to one estimate, the one that the settings ask for first.

    The best over the whole record may have left the population: it is taken from all that was simulated.
    """
    found = {
        "average": compromise.average(theta, evaluation.segments),
        "utopia": compromise.utopia(theta, evaluation.segments),
        "best": memo.best,
    }
    return {first: found[first]} | found


def _front(theta: Array, evaluation: Evaluation, memo: Memo) -> tuple[Array, Evaluation]:
    """The different non-dominated sets of the last population."""
    _, first = np.unique(theta, axis=0, return_index=True)
    keep = np.sort(first)
    theta = theta[keep]
    theta = theta[non_dominated(evaluation.segments[keep])]
    return theta, memo.evaluate(theta)
