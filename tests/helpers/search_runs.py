"""Runs of a search on a function, and their state through files, for the tests of the algorithms."""

import json

import numpy as np

from hydroid.search.algorithm import Population


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
        if algorithm.reached(population):
            break
        offspring = evaluate(algorithm, algorithm.ask(population, rng), function)
        population = algorithm.tell(population, offspring)
    return population


def through_files(folder, population, rng):
    """The state of a run, written as npz and JSON and read back."""
    np.savez(folder / "population.npz", chromosomes=population.chromosomes, objectives=population.objectives)
    (folder / "rng.json").write_text(json.dumps(rng.bit_generator.state))
    with np.load(folder / "population.npz", allow_pickle=False) as stored:
        again = Population(stored["chromosomes"], stored["objectives"])
    fresh = np.random.default_rng()
    fresh.bit_generator.state = json.loads((folder / "rng.json").read_text())
    return again, fresh


def same(a, b):
    return (
        a.chromosomes.dtype == b.chromosomes.dtype
        and np.array_equal(a.chromosomes, b.chromosomes)
        and np.array_equal(a.objectives, b.objectives)
    )
