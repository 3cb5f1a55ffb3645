"""A fit: search, the estimates taken from it, the refinement, and what moves the response at the end."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hydroid.fitting.journal import Journal
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.refinement import refine
from hydroid.fitting.search import Checkpoint, Search, SearchState
from hydroid.parameters import Array
from hydroid.problem.problem import Evaluation, Memo, Problem
from hydroid.search import compromise
from hydroid.search.least_squares import Refinement
from hydroid.search.pareto import non_dominated
from hydroid.uncertainty.covariance import Uncertainty, uncertainty
from hydroid.uncertainty.directions import Identifiability, identifiability

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
    objectives. refinement: the last one. history: shape (G, len(HISTORY)). uncertainty,
    identifiability: what the logs say about the final estimate.
    """

    estimates: dict[str, Estimate]
    final: str
    front: tuple[Array, Evaluation]
    history: Array
    refinement: Refinement | None
    uncertainty: Uncertainty
    identifiability: Identifiability

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

    def refining(self, simulated: int) -> None:
        """Take the number of simulations the refinement has made."""
        ...


def fit(
    problem: Problem,
    save: Callable[[SearchState, Memo], None],
    watch: Watcher,
    checkpoint: Checkpoint | None = None,
    journal: Journal | None = None,
) -> Fit:
    """Search, take the estimates, refinement.

    Args:
        problem: the estimation problem with its settings.
        save: keeps the search's state now and then.
        watch: is told how far the fit is.
        checkpoint: where an interrupted search was.
        journal: what an interrupted refinement has simulated.

    Raises:
        RunError: every simulated parameter set diverged.
    """
    settings = problem.settings
    memo = Memo(problem)
    if checkpoint is not None:
        memo.restore(*checkpoint.memo)
    if settings.search.algorithm == "multistart":
        search = Multistart(problem, settings.search, memo, watch.refining, journal)
    else:
        search = Search(problem, settings.search, memo)
    state = search.run(checkpoint.state if checkpoint else None, save, watch.generation)
    theta = search.theta(state.population)
    evaluation = memo.evaluate(theta)
    if search.single:
        found = {"best": compromise.best(theta, state.population.objectives[:, 0])}
    else:
        found = _from_front(theta, evaluation, memo, settings.search.compromise)
    estimates = _usable_first(_estimates(problem, found))
    final, refined, last = next(iter(estimates)), None, problem
    if settings.refinement is not None:
        start = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
        refined = _refine(problem, start, watch, journal)
        theta_refined = problem.parameters.from_unit(refined.point[None])
        estimates |= _estimates(problem, {"refined": theta_refined[0]})
        final = "refined"
        if settings.joint_refinement:
            last = problem.freed()
            refined = _refine(last, estimates[final], watch, journal)
            theta_refined = last.parameters.from_unit(refined.point[None])
            estimates |= _estimates(last, {"joint": theta_refined[0]})
            final = "joint"
    told = uncertainty(last, estimates[final].theta)
    return Fit(
        estimates,
        final,
        _front(theta, evaluation, memo),
        state.history,
        refined,
        told,
        identifiability(last, told),
    )


def _estimates(problem: Problem, found: dict[str, Array]) -> dict[str, Estimate]:
    theta = np.array(list(found.values()))
    evaluation, responses = problem.evaluate(theta), problem.responses(theta)
    rms = problem.rms(problem.residuals(theta))
    return {
        name: Estimate(
            name,
            theta[i],
            evaluation.segments[i],
            float(evaluation.overall[i]),
            float(rms[i]),
            tuple(r.angle[i] for r in responses),
        )
        for i, name in enumerate(found)
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


def _refine(problem: Problem, start: Estimate, watch: Watcher, journal: Journal | None) -> Refinement:
    assert problem.settings.refinement is not None
    return refine(problem, start.theta, problem.settings.refinement, watch.refining, journal)
