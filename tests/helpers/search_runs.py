"""Runs of a search on a function, for the tests of the algorithms."""

import numpy as np

from hydroid.search.genetic import Population


def evaluate(algorithm, chromosomes, function):
    """Evaluated chromosomes that no one may write into."""
    objectives = np.asarray(function(algorithm.decode(chromosomes)), dtype=float)
    for array in (chromosomes, objectives):
        array.flags.writeable = False
    return Population(chromosomes, objectives)


def advance(algorithm, function, population, rng, generations):
    if population is None:
        population = algorithm.tell(None, evaluate(algorithm, algorithm.ask(None, rng), function))
    for _ in range(generations):
        offspring = evaluate(algorithm, algorithm.ask(population, rng), function)
        population = algorithm.tell(population, offspring)
    return population


def same(a, b):
    return (
        a.chromosomes.dtype == b.chromosomes.dtype
        and np.array_equal(a.chromosomes, b.chromosomes)
        and np.array_equal(a.objectives, b.objectives)
    )
