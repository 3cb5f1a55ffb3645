"""Algorithms of cma and pymoo: what reaches them, what comes back, and that a run is what its seed says."""

import os
import sys
from typing import get_args

import numpy as np
import pytest
from search_runs import advance, same

from hydroid.errors import SettingsError
from hydroid.search.cmaes import cmaes
from hydroid.search.library import LibraryAlgorithm
from hydroid.search.moo import ALGORITHMS, directions, pymoo
from hydroid.search.nsga2 import crowded_order
from hydroid.settings.load import validate
from hydroid.settings.search import PopulationSettings, PymooSettings

ENDS = np.array([[0.2, 0.5, 0.3], [0.7, 0.4, 0.6]])
"""Two points: least distances to both lie on the straight line between them."""


SINGLE = [name for name, place in ALGORITHMS.items() if place.startswith("soo")]
SEVERAL = [name for name in ALGORITHMS if name not in SINGLE]


def build(name: str, population: int = 20, generations: int = 30, parameters: int = 3) -> LibraryAlgorithm:
    if name == "cmaes":
        return cmaes(PopulationSettings(population=population, generations=generations), parameters)
    settings = PymooSettings(algorithm=name, population=population, generations=generations)
    return pymoo(settings, parameters, 2)


def distances(ends):
    return lambda points: np.linalg.norm(points[:, None, :] - ends, axis=2)


def broken(function):
    """Candidates in a corner of the box diverge, each in one objective only and in another way."""

    def diverging(points):
        values = function(points)
        values[points[:, 0] > 0.75, 0] = np.nan
        values[points[:, 1] > 0.75, -1] = np.inf
        values[points[:, 2] > 0.75, 0] = -np.inf
        return values

    return diverging


def objectives(name: str):
    return distances(ENDS if name in SEVERAL else ENDS[:1])


def test_cma_es_finds_an_optimum_on_the_bounds():
    algorithm = build("cmaes", generations=150)
    population = advance(
        algorithm, distances(np.array([[1.5, -0.5, 0.5]])), None, np.random.default_rng(1), 150
    )
    np.testing.assert_allclose(population.chromosomes[0], [1, 0, 0.5], atol=1e-3)


@pytest.mark.parametrize("name", SINGLE)
def test_single_objective_algorithms_approach_the_optimum(name: str):
    population = advance(build(name), objectives(name), None, np.random.default_rng(1), 30)
    # one of 620 random points comes as near in one run of nine
    assert population.objectives[0] < 0.035
    assert (np.diff(population.objectives[:, 0]) >= 0).all()


@pytest.mark.parametrize("name", SEVERAL)
def test_multi_objective_algorithms_come_nearer_to_the_front_than_as_many_random_points(name: str):
    """The sum of the two distances is that of the ends on the front, and more elsewhere."""

    def detour(values):
        return np.median(values.sum(axis=1)) - np.linalg.norm(ENDS[1] - ENDS[0])

    population = advance(build(name), objectives(name), None, np.random.default_rng(1), 30)
    random = distances(ENDS)(np.random.default_rng(2).random((20 * 31, 3)))
    assert len(population) == 20
    assert detour(population.objectives) < detour(random[crowded_order(random)[:20]])


@pytest.mark.parametrize("name", ["cmaes", *ALGORITHMS])
def test_what_diverged_never_reaches_a_library_nor_the_result(name: str):
    algorithm = build(name, generations=15)
    begin, told = algorithm.begin, []

    def watched(rng):
        engine = begin(rng)
        tell = engine.tell
        engine.tell = lambda values: (told.append(values.copy()), tell(values))
        return engine

    algorithm.begin = watched
    population = advance(algorithm, broken(objectives(name)), None, np.random.default_rng(3), 15)
    assert len(told) > 10
    assert all(np.isfinite(values).all() for values in told)
    assert population.feasible.all()
    assert (population.chromosomes <= 0.75).all()


@pytest.mark.parametrize("name", ["cmaes", *ALGORITHMS])
def test_the_seed_alone_decides_every_bit(name: str, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    runs = []
    for seed, other in ((7, 1), (7, 2), (8, 2)):
        np.random.seed(other)  # noqa: NPY002  # what else uses the global generator must not matter
        before = np.random.get_state()[1].copy()  # noqa: NPY002
        runs.append(
            advance(build(name, 8, 12), broken(objectives(name)), None, np.random.default_rng(seed), 12)
        )
        np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])
    assert not os.listdir(tmp_path)
    assert capfd.readouterr() == ("", "")


def test_directions_cover_the_simplex():
    for count, dimensions in ((20, 2), (30, 3), (40, 8), (40, 30)):
        found = directions(count, dimensions)
        assert found.shape == (count, dimensions)
        assert (found >= 0).all()
        np.testing.assert_allclose(found.sum(axis=1), 1)
        corners = {int(i) for i in found.argmax(axis=1)[found.max(axis=1) == 1]}
        assert corners == set(range(dimensions))
        np.testing.assert_array_equal(found, directions(count, dimensions))
    # two objectives: on a line of length √2; the largest gap is at most twice the even spacing
    line = np.sort(directions(17, 2)[:, 0])
    assert np.diff(line).max() <= 2 / 16 + 0.01


def test_other_algorithms_are_refused_with_the_list():
    named = PymooSettings.model_fields["algorithm"].annotation
    assert set(get_args(named)) == ALGORITHMS.keys()
    for name in ("nsga3", "CMOPSO"):
        with pytest.raises(SettingsError, match=r"'NSGA3', 'MOEAD'.*'PSO'"):
            validate({"algorithm": name}, PymooSettings, "fit.yaml")
    with pytest.raises(SettingsError, match="several objectives"):
        pymoo(PymooSettings(), 3, 1)


@pytest.mark.parametrize(("name", "library", "extra"), [("cmaes", "cma", "cma"), ("DE", "pymoo", "moo")])
def test_a_library_that_is_not_there_is_one_line(name: str, library: str, extra: str, monkeypatch):
    for module in [m for m in sys.modules if m.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(SettingsError, match=rf"{library} cannot be imported.*'hydroid\[{extra}\]'$") as error:
        build(name)
    assert "\n" not in str(error.value)
