import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from pymoo.operators.survival.rank_and_crowding.metrics import calc_crowding_distance
from pymoo.problems import get_problem
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from hydroid.search.pareto import (
    average,
    crowding,
    non_dominated,
    ranks,
    segment_best,
    utopia,
)

PROBLEMS = [("zdt1", {}), ("zdt4", {}), ("dtlz7", {"n_var": 10, "n_obj": 8})]

values = st.one_of(
    st.integers(0, 4).map(float), st.sampled_from([np.nan, np.inf, -np.inf])
)
shapes = st.tuples(st.integers(1, 14), st.integers(1, 4))
populations = shapes.flatmap(lambda s: arrays(float, s, elements=values))


@pytest.mark.parametrize(("name", "size"), PROBLEMS)
def test_ranks_and_crowding_agree_with_pymoo(name, size):
    problem = get_problem(name, **size)
    objectives = problem.evaluate(
        np.random.default_rng(0).random((70, problem.n_var)) * problem.xu
    )
    rank = ranks(objectives)
    theirs = NonDominatedSorting().do(objectives, return_rank=True)[1]
    assert rank.tolist() == theirs.tolist()
    room = crowding(objectives, rank)
    compared = 0
    for front in range(rank.max() + 1):
        candidates = rank == front
        if candidates.sum() > 2:
            expected = (
                calc_crowding_distance(objectives[candidates]) * objectives.shape[1]
            )
            np.testing.assert_allclose(room[candidates], expected, rtol=1e-12)
            compared += 1
    assert compared


def dominates(a, b):
    feasible_a, feasible_b = np.isfinite(a).all(), np.isfinite(b).all()
    if not feasible_a or not feasible_b:
        return feasible_a and not feasible_b
    return bool((a <= b).all() and (a < b).any())


@given(objectives=populations)
def test_ranks_by_their_definition(objectives):
    rank = ranks(objectives)
    for i, a in enumerate(objectives):
        above = [rank[j] for j, b in enumerate(objectives) if dominates(b, a)]
        assert rank[i] == (max(above) + 1 if above else 0)
    feasible = np.isfinite(objectives).all(axis=1)
    assert (crowding(objectives, rank)[~feasible] == 0).all()
    assert not non_dominated(objectives)[~feasible].any()
    assert non_dominated(objectives).any() == feasible.any()


def test_an_objective_without_range_makes_no_ends():
    objectives = np.array([[0.0, 3, 5], [1, 2, 5], [2, 1, 5], [3, 0, 5]])
    room = crowding(objectives, ranks(objectives))
    assert room.tolist() == [np.inf, 4 / 3, 4 / 3, np.inf]


POINTS = np.array([[0.0, 1.0], [0.2, 0.4], [0.5, 0.5], [1.0, 0.0]])
OBJECTIVES = np.array([[1.0, 90, 30], [2, 40, 20], [9, 30, 25], [np.nan, -np.inf, 0]])


def test_the_articles_average_counts_a_point_as_often_as_it_is_best():
    assert segment_best(OBJECTIVES).tolist() == [0, 2, 1]
    np.testing.assert_allclose(average(POINTS, OBJECTIVES), POINTS[:3].mean(axis=0))
    twice = OBJECTIVES[:, [0, 0, 1]]
    np.testing.assert_allclose(average(POINTS, twice), (2 * POINTS[0] + POINTS[2]) / 3)


def test_utopia_is_the_nearest_in_terms_of_the_ranges_of_objectives_that_have_one():
    # distances squared: 0 + 1 + 1, 1/64 + 1/36 + 0, 1 + 0 + 1/4
    for objectives in (OBJECTIVES, np.hstack((OBJECTIVES, np.full((4, 1), 7.0)))):
        assert utopia(POINTS, objectives).tolist() == POINTS[1].tolist()


@given(seed=st.integers(0, 2**32))
def test_a_candidate_that_is_best_everywhere_is_every_compromise(seed):
    rng = np.random.default_rng(seed)
    points, objectives = rng.random((9, 4)), rng.random((9, 5)) + 1
    objectives[6] = rng.random(5)
    for point in (average(points, objectives), utopia(points, objectives)):
        np.testing.assert_allclose(point, points[6], rtol=1e-15)
