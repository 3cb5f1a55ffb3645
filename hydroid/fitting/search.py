"""The search over a problem: ask for candidates, simulate them, tell their objectives, store a checkpoint."""

from collections.abc import Mapping, Sequence

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Arrays, Checkpoints, Memo, saving
from hydroid.fitting.ladder import Watcher
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.step import Step
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER
from hydroid.search.chromosomes import Genes
from hydroid.search.genetic import Nsga2, Population, SimpleGa

HISTORY = ("generation", "evaluations", "simulated", "infeasible", "best", "median")
"""Columns of a run's history; `best` is over the run so far, `median` over the population, both of (18) or
(19) over the whole record."""


@record
class Searched:
    """Result of a search: its last population, theta (n, P), all candidates simulated, and its history.

    `single`: whether it minimised one objective, not that of each segment. `ends`: costs at which the starts
    of a multi-start ended, by the joint that was fitted alone (0: all together).
    """

    theta: Array
    population: Population
    single: bool
    history: Array
    memo: Memo
    ends: Mapping[int, Sequence[float]]


def search(problem: Problem, watch: Watcher, checkpoints: Checkpoints) -> Searched:
    """Search to the last generation, from the seed or from what `checkpoints` holds as "search".

    `watch` takes a row of HISTORY after every generation, but for those that a resumed run repeats, and says
    whether that was the last; it also watches least squares within multi-start. Raises RunError: the search
    does not repeat what it did before the checkpoint.
    """
    settings, free, late = problem.settings.search, int(problem.parameters.free.sum()), False

    def refining(step: Step, simulated: int, rms: float) -> bool:
        nonlocal late
        late = watch.refining(step, simulated, rms) or late
        return late

    memo = Memo(problem, checkpoints.get("search"))
    if settings.algorithm == "multistart":
        algorithm = Multistart(problem, memo, refining, checkpoints)
    elif settings.algorithm == "ga":
        algorithm = SimpleGa(settings.ga, free, problem.start)
    else:
        algorithm = Nsga2(settings.nsga2, free, problem.start)

    def theta(chromosomes: Genes) -> Array:
        if isinstance(algorithm, Multistart):  # its chromosomes are theta
            return chromosomes
        return problem.theta(algorithm.coding.decode(chromosomes))

    def state() -> Arrays:
        words = "checkpoint: generation %d, %d evaluated, %d simulated, %d diverged, best objective %.6g"
        LOGGER.info(words, *history[-1, :5])
        return memo.arrays()

    generations, rng = 1 + algorithm.settings.generations, np.random.default_rng(settings.seed)
    population, history, evaluations = None, np.empty((0, len(HISTORY))), 0
    with saving(checkpoints, "search") as keep:
        while population is None or (len(history) < generations and not late):
            repeats = bool(memo.stored)
            chromosomes = algorithm.ask(population, rng)
            result = memo.evaluate(theta(chromosomes))
            evaluations += len(chromosomes)
            objectives = result[:, -1:] if algorithm.single else result[:, :-1]
            population = algorithm.tell(population, Population(chromosomes, objectives))
            overall = memo.evaluate(theta(population.chromosomes))[:, -1]
            finite = overall[np.isfinite(overall)]
            best = min(history[-1, 4] if len(history) else np.inf, result[:, -1].min())
            median = np.median(finite) if finite.size else np.inf
            row = [
                len(history) + 1,
                evaluations + memo.elsewhere,
                memo.simulated,
                memo.infeasible,
                best,
                median,
            ]
            history = np.vstack([history, row])
            if not repeats:
                if not late:  # else a start may not have been refined to its end
                    keep(state)
                late = watch.generation(history[-1]) or late
    ends = algorithm.ends if isinstance(algorithm, Multistart) else {}
    return Searched(theta(population.chromosomes), population, algorithm.single, history, memo, ends)
