"""The search loop: ask, simulate, tell, and a state small enough to keep after every generation."""

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.errors import RunError, SettingsError
from hydroid.fitting.memo import Memo
from hydroid.parameters import Array
from hydroid.problem.problem import Evaluation, Problem
from hydroid.search.algorithm import Algorithm, Population
from hydroid.search.cmaes import cmaes
from hydroid.search.ga import SimpleGa
from hydroid.search.library import LibraryAlgorithm
from hydroid.search.moo import pymoo
from hydroid.search.nsga2 import Nsga2
from hydroid.settings.search import SearchSettings

HISTORY = ("generation", "evaluations", "simulated", "infeasible", "best", "median")
"""Columns of a run's history; `best` is over the run so far, `median` over the population, both of (18) or
(19) over the whole record."""

SAVE_EVERY = 5.0
"""seconds between checkpoints: a lost one costs no more, and writing it is noise beside the search"""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SearchState:
    """All that a search needs to go on: its population, the generator's state, its history."""

    population: Population
    rng: Mapping[str, Any]
    history: Array  # (generations so far, len(HISTORY))


@dataclass(frozen=True)
class Checkpoint:
    """A search's state, and what it had simulated, shapes (m, P) and (m, S + 1)."""

    state: SearchState
    memo: tuple[Array, Array]


class Search:
    """One search over one problem.

    Args:
        problem: what is minimised.
        settings: algorithm and seed.
        memo: what has been simulated already.
    """

    def __init__(self, problem: Problem, settings: SearchSettings, memo: Memo) -> None:
        self._problem, self._memo, self._seed = problem, memo, settings.seed
        self._algorithm = make_algorithm(problem, settings)

    def run(
        self,
        state: SearchState | None,
        save: Callable[[SearchState, Memo], None],
        watch: Callable[[Array], None],
    ) -> SearchState:
        """Run from `state`, or from the seed, to the last generation or convergence.

        Args:
            state: a state to continue from.
            save: called with the state now and then, at the end, and when interrupted.
            watch: called with a row of HISTORY after every generation.

        Raises:
            RunError: a library's algorithm does not do again what it did before `state`.
        """
        if state is not None and len(state.history) < self.generations:
            self._replay(state)
        saved, kept = time.monotonic(), state
        try:
            while state is None or not self._finished(state):
                state = self._next(state)  # an interrupt in here leaves the state before it
                watch(state.history[-1])
                if time.monotonic() - saved > SAVE_EVERY:
                    self._save(state, save)
                    saved, kept = time.monotonic(), state
            return state
        finally:
            if state is not None and state is not kept:
                self._save(state, save)

    def theta(self, population: Population) -> Array:
        """Return the population's parameter sets, shape (n, P)."""
        return self._problem.theta(self._algorithm.decode(population.chromosomes))

    @property
    def single(self) -> bool:
        """Whether it minimises the error over the whole record alone, not that of each segment."""
        return self._algorithm.single

    @property
    def generations(self) -> int:
        """Populations the search evaluates at most, the first, random one included."""
        return 1 + self._algorithm.settings.generations

    def _save(self, state: SearchState, save: Callable[[SearchState, Memo], None]) -> None:
        save(state, self._memo)
        now = dict(zip(HISTORY, state.history[-1], strict=True))
        _log.info(
            "checkpoint: generation %d of %d, %d simulated, %d diverged, best objective %.6g",
            now["generation"],
            self.generations,
            now["simulated"],
            now["infeasible"],
            now["best"],
        )

    def _finished(self, state: SearchState) -> bool:
        return len(state.history) >= self.generations or self._algorithm.reached(state.population)

    def _next(self, state: SearchState | None) -> SearchState:
        rng = np.random.default_rng(self._seed)
        if state is not None:
            rng.bit_generator.state = state.rng
        before = None if state is None else state.population
        chromosomes = self._algorithm.ask(before, rng)
        result = self._memo.evaluate(self._problem.theta(self._algorithm.decode(chromosomes)))
        objectives = result.overall[:, None] if self.single else result.segments
        population = self._algorithm.tell(before, Population(chromosomes, objectives))
        history = np.empty((0, len(HISTORY))) if state is None else state.history
        row = self._row(history, population, result)
        return SearchState(population, rng.bit_generator.state, np.vstack([history, row]))

    def _replay(self, state: SearchState) -> None:
        """Bring a library's algorithm to where `state` was; the memo answers, nothing is simulated."""
        if not isinstance(self._algorithm, LibraryAlgorithm):
            return
        again, known = None, self._memo.simulated
        for _ in state.history:
            again = self._next(again)
            if self._memo.simulated > known:
                raise RunError(
                    "the search cannot be continued: its library does not do again what it did",
                    hint="use the library's version and the machine of then, or begin with another --out",
                )

    def _row(self, history: Array, population: Population, result: Evaluation) -> Array:
        overall = self._memo.evaluate(self.theta(population)).overall
        finite = overall[np.isfinite(overall)]
        evaluations, best = (history[-1, 1], history[-1, 4]) if len(history) else (0, np.inf)
        return np.array(
            [
                len(history) + 1,
                evaluations + len(result),
                self._memo.simulated,
                self._memo.infeasible,
                min(best, result.overall.min()),
                np.median(finite) if finite.size else np.inf,
            ]
        )


def check_search(problem: Problem) -> None:
    """Refuse a search that cannot begin, before anything is written.

    Raises:
        SettingsError: as `make_algorithm`.
    """
    if problem.settings.search.algorithm in ("cmaes", "pymoo"):
        make_algorithm(problem, problem.settings.search)


def make_algorithm(problem: Problem, settings: SearchSettings) -> Algorithm:
    """The search that the settings name, on the unit box of the problem's free parameters.

    Raises:
        SettingsError: a library is not installed, or has no such algorithm.
    """
    free, start = int(problem.parameters.free.sum()), problem.start
    match settings.algorithm:
        case "ga":
            return SimpleGa(settings.ga, free, start)
        case "nsga2":
            return Nsga2(settings.nsga2, free, start)
        case "cmaes":
            return cmaes(settings.cmaes, free, start)
        case "pymoo":
            return pymoo(settings.pymoo, free, len(problem.bounds), start)
        case other:
            raise SettingsError(f"{other} is no search by populations", where="search.algorithm")
