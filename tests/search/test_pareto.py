import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pymoo.operators.survival.rank_and_crowding.metrics import calc_crowding_distance
from pymoo.problems import get_problem
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from hydroid.search.pareto import crowding, ideal, non_dominated, ranks

PROBLEMS = [
    ("zdt1", {}),
    ("zdt2", {}),
    ("zdt3", {}),
    ("zdt4", {}),
    ("zdt6", {}),
    ("dtlz1", {"n_var": 7, "n_obj": 3}),
    ("dtlz2", {"n_var": 9, "n_obj": 5}),
    ("dtlz7", {"n_var": 10, "n_obj": 8}),
]

values = st.one_of(st.integers(0, 4).map(float), st.sampled_from([np.nan, np.inf, -np.inf]))
populations = st.tuples(st.integers(1, 14), st.integers(1, 4)).flatmap(
    lambda s: arrays(float, s, elements=values)
)


def population(name, size, seed, n=70):
    problem = get_problem(name, **size)
    return problem.evaluate(np.random.default_rng(seed).random((n, problem.n_var)) * problem.xu)


@pytest.mark.parametrize(("name", "size"), PROBLEMS)
@pytest.mark.parametrize("seed", [0, 1])
def test_ranks_and_crowding_agree_with_pymoo(name, size, seed):
    objectives = population(name, size, seed)
    rank = ranks(objectives)
    theirs = NonDominatedSorting().do(objectives, return_rank=True)[1]
    assert rank.tolist() == theirs.tolist()
    room = crowding(objectives, rank)
    compared = 0
    for front in range(rank.max() + 1):
        candidates = rank == front
        if candidates.sum() > 2:
            expected = calc_crowding_distance(objectives[candidates]) * objectives.shape[1]
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


def test_the_ideal_is_over_the_feasible():
    objectives = np.array([[1.0, 5], [3, 2], [-9, np.nan]])
    assert ideal(objectives).tolist() == [1, 2]
    with pytest.raises(ValueError, match="zero-size"):
        ideal(objectives[2:])
