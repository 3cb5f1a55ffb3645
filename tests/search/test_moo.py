"""Algorithms of pymoo, driven as hydroid's own searches."""

import sys
from typing import get_args

import numpy as np
import pytest
from numpy.random import Generator

from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.search.genetic import Nsga2, Population
from hydroid.search.moo import ALGORITHMS, PymooSearch
from hydroid.search.pareto import non_dominated
from hydroid.search.protocol import BoxSearch
from hydroid.settings.search import ParetoSettings, PymooSettings

NAMES = get_args(PymooSettings.model_fields["algorithm"].annotation)
SIZE = {"population": 24, "generations": 60}
FRONT_AT = np.array([0.7, 0.2, 0.4])
"""the coordinates behind the first of every point of the front"""


def two_valleys(points: Array) -> Array:
    """Objectives of points, (n, 4): f1 = x1, f2 = 1 - sqrt(x1) on the front, above it
    elsewhere."""
    away = np.sum((points[:, 1:] - FRONT_AT) ** 2, axis=1)
    first = points[:, 0]
    return np.stack(
        [first, (1 + 9 * away) * (1 - np.sqrt(first / (1 + 9 * away)))], axis=1
    )


def run(search: BoxSearch, rng: Generator, objectives=two_valleys) -> list[Population]:
    """Return the population of every generation, as `hydroid.fitting.search` drives a
    search."""
    population = None
    populations = list[Population]()
    for _ in range(1 + search.generations):
        chromosomes = search.ask(population, rng)
        values = objectives(search.coding.decode(chromosomes))
        population = search.tell(population, Population(chromosomes, values))
        populations.append(population)
    return populations


def searched(
    name: str, start: Array | None = None, objectives=two_valleys, seed: int = 1
):
    search = PymooSearch(PymooSettings(algorithm=name, **SIZE), 4, 2, start)
    return run(search, np.random.default_rng(seed), objectives)


def above_front(population: Population) -> Array:
    """How far the non-dominated candidates lie above the front, in the second
    objective."""
    first, second = population.objectives[non_dominated(population.objectives)].T
    return second - (1 - np.sqrt(first))


def test_every_name_of_the_settings_is_an_algorithm():
    assert {*NAMES} == ALGORITHMS.keys()


@pytest.mark.parametrize("name", NAMES)
def test_reaches_the_front_and_spreads_along_it(name: str):
    last = searched(name)[-1]
    assert np.median(above_front(last)) < 0.1
    assert np.ptp(last.objectives[:, 0]) > 0.3


@pytest.mark.parametrize("name", NAMES)
def test_draws_from_the_generator_alone(name: str):
    one, two, other = (searched(name, seed=seed) for seed in (1, 1, 2))
    for before, again in zip(one, two, strict=True):
        assert np.array_equal(before.chromosomes, again.chromosomes)
        assert np.array_equal(before.objectives, again.objectives)
    assert not np.array_equal(one[0].chromosomes, other[0].chromosomes)


@pytest.mark.parametrize("name", NAMES)
def test_stays_in_the_box_and_begins_at_the_start(name: str):
    start = np.array([0.25, *FRONT_AT])
    populations = searched(name, start)
    assert np.any(np.all(populations[0].chromosomes == start, axis=1))
    assert all(
        (p.chromosomes >= 0).all() and (p.chromosomes <= 1).all() for p in populations
    )
    # nothing dominates a point of the front, so that none of the last ones is beyond it
    assert above_front(populations[-1]).min() > -1e-9


@pytest.mark.parametrize("name", NAMES)
def test_no_candidate_that_diverged_is_a_result(name: str):
    def half_diverges(points: Array) -> Array:
        return np.where(points[:, 1:2] < 0.5, np.inf, two_valleys(points))

    last = searched(name, objectives=half_diverges)[-1]
    kept = non_dominated(last.objectives)
    assert kept.any()
    assert (last.chromosomes[kept, 1] >= 0.5).all()
    assert np.isinf(last.objectives[last.chromosomes[:, 1] < 0.5]).all()


def test_is_driven_as_our_own():
    ours = run(Nsga2(ParetoSettings(**SIZE), 4), np.random.default_rng(1))[-1]
    theirs = searched("moead")[-1]
    assert abs(np.median(above_front(ours)) - np.median(above_front(theirs))) < 0.1


def test_says_how_to_install_pymoo(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pymoo.algorithms.moo.moead", None)
    with pytest.raises(SettingsError, match=r"pip install 'hydroid\[moo\]'"):
        PymooSearch(PymooSettings(), 4, 2)
