"""What a search in the unit box is to those who drive it.

    population = None
    for _ in range(1 + search.generations):
        chromosomes = search.ask(population, rng)
        points = search.coding.decode(chromosomes)
        offspring = Population(chromosomes, objectives(points))
        population = search.tell(population, offspring)

A search draws from the generator passed in alone, and the same answers lead it the same
way. So a run is continued by running it again from its seed, with the objectives that
are known.
"""

from typing import ClassVar, Protocol

from numpy.random import Generator

from hydroid.arrays import Array
from hydroid.search.chromosomes import Genes
from hydroid.search.genetic import Population


class Coding(Protocol):
    """How points of the unit box are written as chromosomes."""

    def decode(self, chromosomes: Genes) -> Array:
        """Return points of the unit box, shape (n, p)."""
        ...


class BoxSearch(Protocol):
    """A search for the smallest objectives in the unit box."""

    single: ClassVar[bool]
    """whether it minimises one objective, shape (n, 1), rather than several at once,
    (n, m)"""

    @property
    def generations(self) -> int:
        """Number of populations after the first one."""
        ...

    @property
    def coding(self) -> Coding:
        """How candidates are written as chromosomes."""
        ...

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Return chromosomes to be evaluated; None: there is no population yet."""
        ...

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Take what was evaluated, and return the population from which the search goes
        on."""
        ...
