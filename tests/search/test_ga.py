import numpy as np
import pytest
from search_runs import advance, evaluate

from hydroid.search.ga import SimpleGa
from hydroid.settings.search import GeneticSettings


def sphere(points):
    return ((points - 0.3) ** 2).sum(axis=1, keepdims=True)


def with_failures(points):
    value = sphere(points)
    value[points[:, 0] > 0.5] = np.nan
    value[points[:, 1] > 0.8] = np.inf
    return value


@pytest.mark.parametrize("coding", ["binary", "integer"])
@pytest.mark.parametrize("cross", ["pointwise", "uniform"])
def test_finds_the_bottom_of_a_sphere(coding, cross):
    ga = SimpleGa(GeneticSettings(coding=coding, crossover=cross), 9)
    population = advance(ga, sphere, None, np.random.default_rng(0), 200)
    random = sphere(np.random.default_rng(0).random((201 * 70, 9))).min()
    assert population.objectives.min() < random / 5  # random search with the same number of evaluations


def test_the_best_one_is_kept_and_not_evaluated_again():
    ga = SimpleGa(GeneticSettings(population=11), 3)
    rng = np.random.default_rng(0)
    population = advance(ga, with_failures, None, rng, 0)
    for _ in range(30):
        chromosomes = ga.ask(population, rng)
        assert len(chromosomes) == 10
        successor = ga.tell(population, evaluate(ga, chromosomes, with_failures))
        assert len(successor) == 11
        best = np.sort(population.objectives[:, 0])[:1]  # numpy sorts nan last
        assert np.array_equal(successor.objectives[:1, 0], best, equal_nan=True)
        population = successor
