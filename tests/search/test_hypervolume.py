from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pymoo.indicators.hv import HV
from pymoo.problems import get_problem

from hydroid.search.hypervolume import hypervolume

grid = st.tuples(st.integers(1, 6), st.integers(1, 4)).flatmap(
    lambda s: arrays(float, s, elements=st.integers(0, 6).map(float))
)


def by_inclusion_and_exclusion(objectives, reference):
    """The volume of the union of all boxes, from those of all intersections."""
    boxes = np.maximum(reference - objectives, 0)
    return sum(
        (-1) ** (k + 1) * boxes[list(some)].min(axis=0).prod()
        for k in range(1, len(boxes) + 1)
        for some in combinations(range(len(boxes)), k)
    )


@given(objectives=grid)
def test_is_the_volume_of_the_union(objectives):
    reference = np.full(objectives.shape[1], 5.0)
    assert hypervolume(objectives, reference) == by_inclusion_and_exclusion(objectives, reference)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("name", "size", "n"),
    [
        ("zdt1", {}, 70),
        ("zdt3", {}, 150),  # more candidates than a word has bits
        ("dtlz2", {"n_var": 7, "n_obj": 3}, 80),
        ("dtlz2", {"n_var": 9, "n_obj": 5}, 30),
        ("dtlz2", {"n_var": 12, "n_obj": 8}, 20),
    ],
)
def test_agrees_with_pymoo(name, size, n, seed):
    problem = get_problem(name, **size)
    objectives = problem.evaluate(np.random.default_rng(seed).random((n, problem.n_var)))
    reference = objectives.max(axis=0) * 1.1 + 0.1
    assert hypervolume(objectives, reference) == pytest.approx(HV(ref_point=reference)(objectives), rel=1e-12)


@given(seed=st.integers(0, 2**32))
def test_grows_with_every_new_non_dominated_member_only(seed):
    rng = np.random.default_rng(seed)
    objectives, reference = rng.random((10, 4)), np.ones(4)
    before = hypervolume(objectives, reference)
    worse = objectives[0] + 0.1 * rng.random(4)
    better = objectives[0] - 0.1 * rng.random(4)
    assert hypervolume(np.vstack((objectives, worse)), reference) == pytest.approx(before, rel=1e-12)
    assert hypervolume(np.vstack((objectives, better)), reference) >= before * (1 - 1e-12)
    assert hypervolume(better[None, :], reference) > hypervolume(objectives[:1], reference)


def test_what_is_infeasible_or_beyond_the_reference_adds_nothing():
    objectives = np.array([[0.5, 0.5], [np.nan, 0], [-np.inf, 0], [0, 1.0], [2, 2]])
    assert hypervolume(objectives, np.ones(2)) == 0.25
    assert hypervolume(objectives[1:], np.ones(2)) == 0.0
    assert hypervolume(np.empty((0, 2)), np.ones(2)) == 0.0
