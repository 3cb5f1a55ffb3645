"""The search over a problem: ask for candidates, simulate them, tell their objectives,
store a checkpoint."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.random import Generator

from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Arrays, Checkpoints, Memo, saving
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.step import Step
from hydroid.fitting.watcher import Watcher
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER
from hydroid.search.chromosomes import Genes
from hydroid.search.genetic import Nsga2, Population, SimpleGa
from hydroid.search.moo import PymooSearch
from hydroid.search.protocol import BoxSearch

HISTORY = ("generation", "evaluations", "simulated", "infeasible", "best", "median")
"""Columns of a run's history; `best` is over the run so far, `median` over the
population, both of (18) or (19) over the whole record."""


@record
class Searched:
    """Result of a search: its last population, theta (n, P), all candidates simulated,
    and its history.

    `single`: whether it minimised one objective, not that of each segment. `ends`:
    costs at which the starts of a multi-start ended, by the joint that was fitted alone
    (0: all together).
    """

    theta: Array
    population: Population
    single: bool
    history: Array
    memo: Memo
    ends: Mapping[int, Sequence[float]]


class Search(Protocol):
    """What the loop of `search` asks of an algorithm whose chromosomes stand for
    candidates theta."""

    @property
    def single(self) -> bool:
        """Whether it minimises one objective, not that of each segment."""
        ...

    @property
    def generations(self) -> int:
        """Number of populations after the first one."""
        ...

    @property
    def ends(self) -> Mapping[int, Sequence[float]]:
        """Costs at which starts ended, by the joint that was fitted alone (0: all
        together)."""
        ...

    def theta(self, chromosomes: Genes) -> Array:
        """Return the candidates that chromosomes stand for, shape (n, P)."""
        ...

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Return chromosomes to be evaluated; None: there is no population yet."""
        ...

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Take what was evaluated, and return the population from which the search goes
        on."""
        ...


class InBox:
    """A search in the unit box of a problem's free parameters, as a `Search`."""

    ends: Mapping[int, Sequence[float]] = {}

    def __init__(self, problem: Problem, algorithm: BoxSearch) -> None:
        self._problem = problem
        self._algorithm = algorithm
        self.single = algorithm.single
        self.generations = algorithm.generations
        self.ask = algorithm.ask
        self.tell = algorithm.tell

    def theta(self, chromosomes: Genes) -> Array:
        """Return the candidates that chromosomes stand for, shape (n, P)."""
        return self._problem.theta(self._algorithm.coding.decode(chromosomes))


def box_search(problem: Problem) -> BoxSearch:
    """Return the algorithm that the settings name, in the unit box of the free
    parameters."""
    settings = problem.settings.search
    free = int(problem.parameters.free.sum())
    if settings.algorithm == "ga":
        return SimpleGa(settings.ga, free, problem.start)
    if settings.algorithm == "pymoo":
        return PymooSearch(
            settings.pymoo, free, problem.settings.objective.segments, problem.start
        )
    return Nsga2(settings.nsga2, free, problem.start)


def search(problem: Problem, watch: Watcher, checkpoints: Checkpoints) -> Searched:
    """Search to the last generation, from the seed or from what `checkpoints` holds as
    "search".

    `watch` takes a row of HISTORY after every generation, but for those that a resumed
    run repeats, and says whether that was the last; it also watches least squares
    within multi-start.

    Raises RunError: the search does not repeat what it did before the checkpoint.
    """
    time_is_up = False

    def refining(step: Step, simulated: int, rms: float) -> bool:
        nonlocal time_is_up
        time_is_up = watch.refining(step, simulated, rms) or time_is_up
        return time_is_up

    memo = Memo(problem, checkpoints.get("search"))
    algorithm: Search
    if problem.settings.search.algorithm == "multistart":
        algorithm = Multistart(problem, memo, refining, checkpoints)
    else:
        algorithm = InBox(problem, box_search(problem))

    def state() -> Arrays:
        words = "checkpoint: generation %d, %d evaluated, %d simulated, %d diverged"
        LOGGER.info(f"{words}, best objective %.6g", *history[-1, :5])
        return memo.arrays()

    rng = np.random.default_rng(problem.settings.search.seed)
    population = None
    history = np.empty((0, len(HISTORY)))
    evaluations = 0
    with saving(checkpoints, "search") as keep:
        while population is None or (
            len(history) <= algorithm.generations and not time_is_up
        ):
            repeats = bool(memo.stored)
            chromosomes = algorithm.ask(population, rng)
            result = memo.evaluate(algorithm.theta(chromosomes))
            evaluations += len(chromosomes)
            # overall comes last, behind the segments
            objectives = result[:, :-1]
            if algorithm.single:
                objectives = result[:, -1:]
            population = algorithm.tell(population, Population(chromosomes, objectives))
            overall = memo.evaluate(algorithm.theta(population.chromosomes))[:, -1]
            finite = overall[np.isfinite(overall)]
            best_before = np.inf
            if len(history):
                best_before = history[-1, 4]
            row = [
                len(history) + 1,
                evaluations + memo.elsewhere,
                memo.simulated,
                memo.infeasible,
                min(best_before, result[:, -1].min()),
                np.median(finite) if finite.size else np.inf,
            ]
            history = np.vstack([history, row])
            if not repeats:
                # else a start may not have been refined to its end
                if not time_is_up:
                    keep(state)
                time_is_up = watch.generation(history[-1]) or time_is_up
    theta = algorithm.theta(population.chromosomes)
    return Searched(theta, population, algorithm.single, history, memo, algorithm.ends)
