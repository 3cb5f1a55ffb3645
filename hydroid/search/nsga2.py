"""NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002) on the simple GA's operators, article 4.2."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.algorithm import Population
from hydroid.search.coding import Genes
from hydroid.search.operators import GeneticAlgorithm
from hydroid.search.pareto import crowding, ranks
from hydroid.settings.search import GeneticSettings

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Nsga2(GeneticAlgorithm):
    """Non-dominated sorting, crowding, crowded tournament, and survival of the best of parents and children.

    Minimises m objectives at once: populations have objectives of shape (n, m).
    """

    settings: GeneticSettings
    single = False

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Offspring of parents from the crowded tournament, shape (population, length)."""
        count = self.settings.population
        if population is None:
            return self.first(rng)
        parents = tournament(population.objectives, count + count % 2, rng)
        return self.breed(population.chromosomes[parents], count, rng)

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """The best of parents and children together, in crowded order."""
        everyone = offspring if population is None else population.join(offspring)
        return everyone.take(crowded_order(everyone.objectives)[: self.settings.population])


def crowded_order(objectives: Float) -> Int:
    """Candidates from best to worst by the crowded comparison: lower rank first, then more room around them.

    Args:
        objectives: shape (n, m).

    Returns:
        Indices, shape (n,); equals keep their order.
    """
    rank = ranks(objectives)
    return np.lexsort((-crowding(objectives, rank), rank))


def tournament(objectives: Float, count: int, rng: Generator) -> Int:
    """Winners of binary tournaments by the crowded comparison.

    The contestants of each round are a random permutation of the population, so that every candidate
    competes equally often. No infeasible candidate beats a feasible one.

    Returns:
        Indices of the parents, shape (count,).
    """
    rank = ranks(objectives)
    room = crowding(objectives, rank)
    n = len(objectives)
    rounds = -(-2 * count // n)
    contestants = np.concatenate([rng.permutation(n) for _ in range(rounds)])[: 2 * count]
    a, b = contestants[0::2], contestants[1::2]
    a_wins = (rank[a] < rank[b]) | ((rank[a] == rank[b]) & (room[a] >= room[b]))
    return np.where(a_wins, a, b)
