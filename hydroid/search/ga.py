"""The simple genetic algorithm of article 4.1 and figure 12, with elitism."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.algorithm import Population
from hydroid.search.coding import Coding, Genes, make_coding
from hydroid.search.operators import breed, roulette
from hydroid.settings.search import GaSettings

Float = NDArray[np.float64]


@dataclass(frozen=True)
class SimpleGa:
    """Roulette, crossover, mutation; the best few live on, the children replace the rest.

    Minimises one objective: populations have objectives of shape (n, 1).
    """

    settings: GaSettings
    parameters: int

    @property
    def single(self) -> bool:
        """One objective."""
        return True

    @property
    def population_size(self) -> int:
        """Candidates of a population."""
        return self.settings.population

    @property
    def coding(self) -> Coding:
        """How candidates are written as chromosomes."""
        return make_coding(self.settings.coding, self.parameters)

    def start(self, rng: Generator) -> Genes:
        """Uniform random chromosomes, shape (population_size, length)."""
        return self.coding.random(self.population_size, rng)

    def ask(self, population: Population, rng: Generator) -> Genes:
        """Offspring, shape (population_size - elitism, length): the elite is not simulated again."""
        count = self.population_size - self.settings.elitism
        parents = roulette(_objective(population), count + count % 2, rng)
        return breed(population.chromosomes[parents], count, self.settings, self.coding, rng)

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """The best `elitism` candidates of the present population, then all offspring."""
        if population is None:
            return offspring
        best = np.argsort(_objective(population), kind="stable")[: self.settings.elitism]
        return population.take(best).join(offspring)

    def decode(self, chromosomes: Genes) -> Float:
        """Points of the unit box, shape (n, p)."""
        return self.coding.decode(chromosomes)

    def reached(self, population: Population) -> bool:
        """Whether the best candidate is as good as the target, where there is one."""
        target = self.settings.target
        return target is not None and bool(_objective(population).min() <= target)


def _objective(population: Population) -> Float:
    """The one objective, shape (n,), inf where infeasible.

    Raises:
        ValueError: more than one.
    """
    if population.objectives.shape[1] != 1:
        raise ValueError(f"the simple GA has one objective, not {population.objectives.shape[1]}")
    return np.where(population.feasible, population.objectives[:, 0], np.inf)
