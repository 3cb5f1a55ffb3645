"""Algorithms of other libraries behind our `ask` and `tell`."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.search.algorithm import Population
from hydroid.search.coding import Genes
from hydroid.search.nsga2 import crowded_order
from hydroid.search.pareto import feasible
from hydroid.settings.search import PopulationSettings

Float = NDArray[np.float64]

HUGE = 1e100
"""Objectives from here on are taken as infeasible: libraries square what they are told."""

UNSCALED = 1e6
"""What infeasible candidates are told to have while no feasible one has shown the objectives' scale."""


class Engine(Protocol):
    """A run of a library's algorithm."""

    def ask(self) -> Float:
        """Points of the unit box to be evaluated next, shape (n, p); n = 0 once the algorithm has ended."""
        ...

    def tell(self, objectives: Float) -> None:
        """Take the objectives of these points, shape (n, m), all finite."""
        ...


class LibraryAlgorithm:
    """A library's algorithm as ours; its chromosomes are points of the unit box.

    The population is the best `population` candidates that the run has evaluated, by the crowded comparison
    of NSGA-II: with one objective the lowest, with several the first fronts.

    Args:
        settings: population and generations.
        single: whether it minimises one objective.
        begin: begins a run from a source of randomness.
    """

    def __init__(
        self, settings: PopulationSettings, begin: Callable[[Generator], Engine], *, single: bool
    ) -> None:
        self.settings, self.single, self.begin = settings, single, begin

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Points that the library wants next, shape (n, p); without a population, begin the run."""
        if population is None:
            self._engine, self._ends = self.begin(rng), list[Float]()
            self._asked = self._engine.ask()
        return self._asked

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Tell the library; return the best of present population and offspring."""
        self._engine.tell(self._finite(offspring.objectives))
        self._asked = self._engine.ask()
        everyone = offspring if population is None else population.join(offspring)
        return everyone.take(crowded_order(everyone.objectives)[: self.settings.population])

    def decode(self, chromosomes: Genes) -> Float:
        """The points themselves."""
        return chromosomes

    def reached(self, population: Population) -> bool:
        """Whether the library's algorithm has ended by itself: converged, or without new points."""
        return not len(self._asked)

    def _finite(self, objectives: Float) -> Float:
        """Objectives, (n, m), with those of infeasible candidates worse than all feasible ones so far."""
        usable = feasible(objectives) & np.all(np.abs(objectives) < HUGE, axis=1)
        seen = [*self._ends, *objectives[usable]]
        if not seen:
            return np.full_like(objectives, UNSCALED)
        self._ends = [best, worst] = [np.min(seen, axis=0), np.max(seen, axis=0)]
        span = worst - best
        return np.where(usable[:, None], objectives, worst + np.where(span > 0, span, 1.0))


def need(module: str, extra: str) -> Any:
    """Import an optional library.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        raise SettingsError(
            f"the library {library} cannot be imported ({error})",
            where="search.algorithm",
            hint=f"install it with: pip install 'hydroid[{extra}]'",
        ) from None
