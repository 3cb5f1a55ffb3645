"""The article's two searches: the simple genetic algorithm (4.1, figure 12), and
NSGA-II (4.2).

Both are a `hydroid.search.protocol.BoxSearch`.
"""

from typing import ClassVar

import numpy as np
from numpy.random import Generator

from hydroid.arrays import Array, Ints, record
from hydroid.search.chromosomes import (
    Genes,
    GrayCoding,
    IntegerCoding,
    crossover,
    mutate,
    roulette,
)
from hydroid.search.pareto import crowding, ranks
from hydroid.settings.search import GeneticSettings


@record
class Population:
    """Candidates, (n, length), and objectives to be minimised, (n, m);
    nothing ever writes into its arrays.

    A candidate with an objective that is not finite is infeasible.
    """

    chromosomes: Genes
    objectives: Array

    def take(self, index: Ints) -> "Population":
        """Return the candidates at `index`, in that order."""
        return Population(self.chromosomes[index], self.objectives[index])

    def join(self, other: "Population") -> "Population":
        """Return these candidates, then the others."""
        return Population(
            np.concatenate([self.chromosomes, other.chromosomes]),
            np.concatenate([self.objectives, other.objectives]),
        )


def crowded_order(objectives: Array) -> Ints:
    """Return candidates, (n,), from best to worst by their objectives, (n, m);
    equals keep their order.

    That is the crowded comparison: lower rank first, then more room around them.
    """
    rank = ranks(objectives)
    return np.lexsort((-crowding(objectives, rank), rank))


def tournament(objectives: Array, count: int, rng: Generator) -> Ints:
    """Return winners, (count,), of binary tournaments by the crowded comparison of
    objectives, (n, m).

    The contestants of each round are a random permutation of the population, so that
    every candidate competes equally often. No infeasible candidate beats a feasible
    one.
    """
    rank = ranks(objectives)
    room = crowding(objectives, rank)
    rounds = -(-2 * count // len(rank))
    drawn = [rng.permutation(len(rank)) for _ in range(rounds)]
    contestants = np.concatenate(drawn)[: 2 * count]
    first = contestants[0::2]
    second = contestants[1::2]
    same_front = rank[first] == rank[second]
    as_good = same_front & (room[first] >= room[second])
    first_wins = (rank[first] < rank[second]) | as_good
    return np.where(first_wins, first, second)


@record
class SimpleGa:
    """Roulette, crossover, mutation; the best few survive, the children replace the
    rest.

    Attributes:
        settings: population, generations and rates.
        parameters: dimensions p of the unit box.
        start: point of the box that joins the first population, shape (p,).
        single: whether it minimises one objective, shape (n, 1), rather than several at
            once.
        elite: best candidates that survive unchanged,
            and are not simulated again (the article gives none).
    """

    settings: GeneticSettings
    parameters: int
    start: Array | None = None
    single: ClassVar[bool] = True
    elite: ClassVar[int] = 1
    select = staticmethod(roulette)

    @property
    def generations(self) -> int:
        """Number of populations after the first one."""
        return self.settings.generations

    @property
    def coding(self) -> GrayCoding | IntegerCoding:
        """How candidates are written as chromosomes."""
        kind = GrayCoding if self.settings.coding == "binary" else IntegerCoding
        return kind(self.parameters)

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Return chromosomes to be evaluated: the first population, or the offspring of
        one."""
        if population is None:
            chromosomes = self.coding.random(self.settings.population, rng)
            if self.start is not None:
                chromosomes[:1] = self.coding.encode(self.start[None])
            return chromosomes
        count = self.settings.population - self.elite
        # parents come in pairs: of an odd number of children the last one's sibling is
        # left out
        parents = self.select(population.objectives, count + count % 2, rng)
        children = crossover(population.chromosomes[parents], self.settings, rng)
        rate = self.settings.mutation_rate
        return mutate(children[:count], rate, self.coding, rng)

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Return the elite of the present population, then all offspring."""
        if population is None:
            return offspring
        # of equals the one that has been there longer
        order = np.argsort(population.objectives[:, 0], kind="stable")
        best = order[: self.elite]
        return population.take(best).join(offspring)


class Nsga2(SimpleGa):
    """NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002) on the simple GA's operators.

    Non-dominated sorting, crowding, crowded tournament,
    and survival of the best of parents and children.
    """

    single: ClassVar[bool] = False
    elite: ClassVar[int] = 0
    select = staticmethod(tournament)

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Return the best of parents and children together, in crowded order."""
        # parents and children compete: a good candidate is never lost
        everyone = offspring
        if population is not None:
            everyone = population.join(offspring)
        order = crowded_order(everyone.objectives)
        return everyone.take(order[: self.settings.population])
