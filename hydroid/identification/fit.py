"""A fit: search, the estimates taken from it, the polish, and what moves the response at the end."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hydroid.identifiability.identifiability import Identifiability, identifiability
from hydroid.identifiability.uncertainty import Uncertainty, uncertainty
from hydroid.identification.journal import Journal
from hydroid.identification.multistart import Multistart
from hydroid.identification.polishing import polish_estimate
from hydroid.identification.search import Checkpoint, Search, SearchState
from hydroid.parameters import Array
from hydroid.problem.problem import Evaluation, Memo, Problem
from hydroid.search import compromise
from hydroid.search.least_squares import Polish
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
    objectives. polish: the last one. history: shape (G, len(HISTORY)). uncertainty,
    identifiability: what the logs say about the final estimate.
    """

    estimates: dict[str, Estimate]
    final: str
    front: tuple[Array, Evaluation]
    history: Array
    polish: Polish | None
    uncertainty: Uncertainty
    identifiability: Identifiability

    @property
    def best(self) -> Estimate:
        """The estimate to use."""
        return self.estimates[self.final]

    @property
    def searched(self) -> Estimate:
        """The search's own estimate, before the polish."""
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

    def polishing(self, simulated: int) -> None:
        """Take the number of simulations the polish has made."""
        ...


def fit(
    problem: Problem,
    save: Callable[[SearchState, Memo], None],
    watch: Watcher,
    checkpoint: Checkpoint | None = None,
    journal: Journal | None = None,
) -> Fit:
    """Search, take the estimates, polish.

    Args:
        problem: the estimation problem with its settings.
        save: keeps the search's state now and then.
        watch: is told how far the fit is.
        checkpoint: where an interrupted search was.
        journal: what an interrupted polish has simulated.

    Raises:
        RunError: every simulated parameter set diverged.
    """
    settings = problem.settings
    memo = Memo(problem)
    if checkpoint is not None:
        memo.restore(*checkpoint.memo)
    if settings.search.algorithm == "multistart":
        search = Multistart(problem, settings.search, memo, watch.polishing, journal)
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
    final, polished, last = next(iter(estimates)), None, problem
    if settings.polish is not None:
        start = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
        polished = _polish(problem, start, watch, journal)
        theta_polished = problem.parameters.from_unit(polished.point[None])
        estimates |= _estimates(problem, {"polished": theta_polished[0]})
        final = "polished"
        if settings.refine:
            last = problem.freed()
            polished = _polish(last, estimates[final], watch, journal)
            theta_refined = last.parameters.from_unit(polished.point[None])
            estimates |= _estimates(last, {"refined": theta_refined[0]})
            final = "refined"
    told = uncertainty(last, estimates[final].theta)
    return Fit(
        estimates,
        final,
        _front(theta, evaluation, memo),
        state.history,
        polished,
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


def _polish(problem: Problem, start: Estimate, watch: Watcher, journal: Journal | None) -> Polish:
    assert problem.settings.polish is not None
    return polish_estimate(problem, start.theta, problem.settings.polish, watch.polishing, journal)
