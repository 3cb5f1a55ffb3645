"""The simple genetic algorithm of article 4.1 and figure 12, with elitism."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.algorithm import Population
from hydroid.search.coding import Genes
from hydroid.search.operators import GeneticAlgorithm, roulette
from hydroid.settings.search import GeneticSettings

ELITE = 1
"""best candidates that survive unchanged (ours; the article gives none)"""


@dataclass(frozen=True)
class SimpleGa(GeneticAlgorithm):
    """Roulette, crossover, mutation; the best few survive, the children replace the rest.

    Minimises one objective: populations have objectives of shape (n, 1).
    """

    settings: GeneticSettings
    single = True

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Offspring, shape (population - ELITE, length): the elite is not simulated again."""
        if population is None:
            return self.first(rng)
        count = self.settings.population - ELITE
        parents = roulette(_objective(population), count + count % 2, rng)
        return self.breed(population.chromosomes[parents], count, rng)

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """The best ELITE candidates of the present population, then all offspring."""
        if population is None:
            return offspring
        best = np.argsort(_objective(population), kind="stable")[:ELITE]
        return population.take(best).join(offspring)


def _objective(population: Population) -> NDArray[np.float64]:
    """The one objective, shape (n,), inf where infeasible.

    Raises:
        ValueError: more than one.
    """
    if population.objectives.shape[1] != 1:
        raise ValueError(f"the simple GA has one objective, not {population.objectives.shape[1]}")
    return np.where(population.feasible, population.objectives[:, 0], np.inf)
