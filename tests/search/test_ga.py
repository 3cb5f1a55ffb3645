import numpy as np
import pytest
from search_runs import advance, evaluate

from hydroid.errors import SettingsError
from hydroid.search.algorithm import Population
from hydroid.search.ga import SimpleGa
from hydroid.settings.load import validate
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


def test_solves_one_max():
    ga = SimpleGa(GeneticSettings(mutation_rate=0.03), 9)

    def count(points):
        return -ga.coding.encode(points).sum(axis=1, dtype=float)[:, None]

    rng = np.random.default_rng(4)
    population = advance(ga, count, None, rng, 0)
    assert population.objectives.min() == pytest.approx(-92, abs=12)
    for _ in range(20):
        if population.objectives.min() > -144:
            population = advance(ga, count, population, rng, 100)
    assert population.objectives.min() == -144


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


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_infeasible_candidates_have_no_children(bad):
    ga = SimpleGa(GeneticSettings(crossover_rate=0, mutation_rate=0), 2)
    rng = np.random.default_rng(0)
    chromosomes = ga.ask(None, rng)
    objectives = sphere(ga.decode(chromosomes))
    objectives[::2] = bad
    children = ga.ask(Population(chromosomes, objectives), rng)
    feasible = {row.tobytes() for row in chromosomes[1::2]}
    assert all(child.tobytes() in feasible for child in children)
    offspring = Population(children, np.ones((len(children), 1)))
    assert np.isfinite(ga.tell(Population(chromosomes, objectives), offspring).objectives).all()


def test_survives_a_population_without_a_feasible_candidate():
    ga = SimpleGa(GeneticSettings(population=70), 3)
    population = advance(ga, lambda x: np.full((len(x), 1), np.nan), None, np.random.default_rng(0), 3)
    assert len(population) == 70
    assert not population.feasible.any()


def test_more_than_one_objective_is_a_mistake():
    ga = SimpleGa(GeneticSettings(population=70), 2)
    with pytest.raises(ValueError, match="one objective, not 2"):
        ga.ask(Population(ga.ask(None, np.random.default_rng(0)), np.ones((70, 2))), np.random.default_rng(0))


def test_objectives_that_do_not_belong_to_the_chromosomes_are_a_mistake():
    with pytest.raises(ValueError, match="for 3 chromosomes"):
        Population(np.zeros((3, 4)), np.zeros((2, 1)))


@pytest.mark.parametrize(
    "values",
    [{"population": 1}, {"crossover_rate": 1.1}, {"mutation_rate": -0.1}],
)
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(SettingsError, match=next(iter(values))):
        validate(values, GeneticSettings, "fit.yaml")
