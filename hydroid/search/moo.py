"""Algorithms of pymoo by name, driven as hydroid's own (J. Blank and K. Deb, 2020).

Those for several objectives: MOEA/D (Q. Zhang and H. Li, 2007), the particle swarm
MOPSO-CD (C. R. Raquel and P. C. Naval, 2005), NSGA-III (K. Deb and H. Jain, 2014) and
SPEA2 (E. Zitzler and others, 2001), with pymoo's own rates. pymoo is an optional
package. Its swarm CMOPSO is left out: in version 0.6.2 it does not draw from the
generator that it is given, so that no run of it can be continued.
"""

from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from hydroid.arrays import Array, record
from hydroid.errors import SettingsError
from hydroid.search.chromosomes import Genes
from hydroid.search.genetic import Population
from hydroid.search.pareto import feasible
from hydroid.settings.search import PymooSettings

ALGORITHMS = {
    "moead": ("moead", "ParallelMOEAD"),
    "mopso-cd": ("mopso_cd", "MOPSO_CD"),
    "nsga3": ("nsga3", "NSGA3"),
    "spea2": ("spea2", "SPEA2"),
}
"""module and class of pymoo by the name in the settings"""
BY_DIRECTIONS = ("moead", "nsga3")
"""algorithms that spread their candidates along directions of the objectives"""
INFEASIBLE = 1e9
"""what pymoo takes for an objective that is not finite: it calculates with all of
them"""


@record
class Points:
    """Chromosomes that are the points themselves."""

    def decode(self, chromosomes: Genes) -> Array:
        """Return the points of the unit box, shape (n, parameters)."""
        return chromosomes


class PymooSearch:
    """An algorithm of pymoo as a `hydroid.search.protocol.BoxSearch`.

    Args:
        settings: the algorithm and its size.
        parameters: dimensions p of the unit box.
        objectives: number m of objectives.
        start: point of the box that joins the first population, shape (p,).

    Raises:
        SettingsError: pymoo is not installed, or has no such algorithm.
    """

    single: ClassVar[bool] = False
    coding = Points()

    def __init__(
        self,
        settings: PymooSettings,
        parameters: int,
        objectives: int,
        start: Array | None = None,
    ) -> None:
        self._settings = settings
        self._parameters = parameters
        self._objectives = objectives
        self._start = start
        self._algorithm = _algorithm(settings, objectives)
        self._asked: Any = None

    @property
    def generations(self) -> int:
        """Number of populations after the first one."""
        return self._settings.generations

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Return the points that pymoo asks for, shape (n, p)."""
        if population is None:
            self._set_up(int(rng.integers(2**31)))
        self._asked = self._algorithm.ask()
        asked = self._asked.get("X").astype(float)
        # a swarm's particles fly out of the box
        points = np.clip(asked, 0.0, 1.0)
        if population is None and self._start is not None:
            points[0] = self._start
        self._asked.set("X", points)
        return points

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Tell pymoo the objectives, and return what it keeps."""
        usable = feasible(offspring.objectives)
        told = np.where(usable[:, None], offspring.objectives, INFEASIBLE)
        self._asked.set("F", told)
        for individual in self._asked:
            individual.evaluated.update({"F", "G", "H"})
        self._algorithm.tell(infills=self._asked)
        # of a swarm the particles only pass the best points, which are in its archive
        kept = self._algorithm.archive
        if kept is None:
            kept = self._algorithm.pop
        objectives = kept.get("F").astype(float)
        infeasible = (objectives >= INFEASIBLE).any(axis=1)
        objectives[infeasible] = np.inf
        return Population(kept.get("X").astype(float), objectives)

    def _set_up(self, seed: int) -> None:
        from pymoo.core.problem import Problem

        class Asked(Problem):
            """The unit box; the objectives are told. A swarm evaluates once before it
            asks."""

            def _evaluate(self, x: Array, out: Any, *_: Any, **__: Any) -> None:
                out["F"] = np.full((len(x), self.n_obj), INFEASIBLE)

        problem = Asked(n_var=self._parameters, n_obj=self._objectives, xl=0.0, xu=1.0)
        # the driver counts the generations; one more than it asks for is never reached
        most = ("n_gen", self.generations + 2)
        self._algorithm.seed = seed
        self._algorithm.setup(problem, termination=most)


def _algorithm(settings: PymooSettings, objectives: int) -> Any:
    """Return an algorithm of pymoo with the size that the settings give it."""
    module, name = ALGORITHMS[settings.algorithm]
    try:
        kind = getattr(import_module(f"pymoo.algorithms.moo.{module}"), name)
    except (ImportError, AttributeError) as error:
        hint = "install it: pip install 'hydroid[moo]'"
        raise SettingsError(
            f"pymoo has no {name} ({error})", "search.pymoo", hint
        ) from None
    if settings.algorithm not in BY_DIRECTIONS:
        return kind(pop_size=settings.population)
    directions = _directions(objectives, settings.population)
    if settings.algorithm == "moead":
        return kind(directions, n_neighbors=max(2, min(20, settings.population // 5)))
    return kind(directions, pop_size=settings.population)


def _directions(objectives: int, count: int) -> Array:
    """Return directions in the space of the objectives, one for each candidate, shape
    (count, m).

    They are spread by a low discrepancy over the simplex; the axes, each objective
    alone, are among them.
    """
    from scipy.stats import qmc

    axes = np.eye(objectives)[:count]
    sequence = qmc.Halton(objectives, scramble=False)
    # the first point of the sequence is 0, which has no logarithm
    uniform = sequence.random(count - len(axes) + 1)[1:]
    # exponential numbers over their sum are uniform on the simplex
    exponential = -np.log(uniform)
    inner = exponential / exponential.sum(axis=1, keepdims=True)
    return np.vstack([axes, inner])
