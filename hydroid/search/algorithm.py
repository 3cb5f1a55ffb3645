"""What every search shares: a population, and `ask` and `tell`.

An algorithm is deterministic: it draws from the generator passed in alone. So a run is continued by running
it again from its seed, with the objectives that are known (`fitting.memo`).

    population = None
    for _ in range(1 + generations):
        chromosomes = algorithm.ask(population, rng)
        offspring = Population(chromosomes, objectives(algorithm.decode(chromosomes)))
        population = algorithm.tell(population, offspring)
        if algorithm.reached(population):
            break
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.coding import Genes
from hydroid.search.pareto import feasible
from hydroid.settings.search import PopulationSettings

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Population:
    """Candidates and their objectives; nothing ever writes into its arrays.

    Attributes:
        chromosomes: shape (n, length), see `coding`.
        objectives: to be minimised, shape (n, m). A candidate with an objective that is not finite is
            infeasible.

    Raises:
        ValueError: the two do not have the same length.
    """

    chromosomes: Genes
    objectives: Float

    def __post_init__(self) -> None:
        if self.objectives.ndim != 2 or len(self.objectives) != len(self.chromosomes):
            raise ValueError(
                f"objectives of shape {self.objectives.shape} for {len(self.chromosomes)} chromosomes"
            )

    def __len__(self) -> int:
        return len(self.chromosomes)

    @property
    def feasible(self) -> Bool:
        """Candidates all of whose objectives are finite, shape (n,)."""
        return feasible(self.objectives)

    def take(self, index: NDArray[np.int64]) -> "Population":
        """The candidates at `index`, in that order."""
        return Population(self.chromosomes[index], self.objectives[index])

    def join(self, other: "Population") -> "Population":
        """These candidates, then the others."""
        return Population(
            np.concatenate((self.chromosomes, other.chromosomes)),
            np.concatenate((self.objectives, other.objectives)),
        )


class Algorithm(Protocol):
    """A search strategy."""

    @property
    def settings(self) -> PopulationSettings:
        """Size of the population and number of generations."""
        ...

    @property
    def single(self) -> bool:
        """Whether it minimises one objective, shape (n, 1), rather than several at once."""
        ...

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Chromosomes to be evaluated next: the offspring of a population, or at the start the first one."""
        ...

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """The next population, from the present one (none at the start) and its evaluated offspring."""
        ...

    def decode(self, chromosomes: Genes) -> Float:
        """Points of the unit box, shape (n, p)."""
        ...

    def reached(self, population: Population) -> bool:
        """Whether the search has converged and may stop early."""
        ...
