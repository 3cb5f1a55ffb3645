import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hydroid.errors import SettingsError
from hydroid.search.pareto import average, best, segment_best, utopia

POINTS = np.array([[0.0, 1.0], [0.2, 0.4], [0.5, 0.5], [1.0, 0.0]])
OBJECTIVES = np.array([[1.0, 90, 30], [2, 40, 20], [9, 30, 25], [np.nan, 0, 0]])


def test_the_articles_average_counts_a_point_as_often_as_it_is_best():
    assert segment_best(OBJECTIVES).tolist() == [0, 2, 1]
    np.testing.assert_allclose(average(POINTS, OBJECTIVES), POINTS[:3].mean(axis=0))
    twice = OBJECTIVES[:, [0, 0, 1]]
    np.testing.assert_allclose(average(POINTS, twice), (2 * POINTS[0] + POINTS[2]) / 3)


def test_utopia_is_the_nearest_in_terms_of_the_ranges():
    # distances squared: 0 + 1 + 1, 1/64 + 1/36 + 0, 1 + 0 + 1/4
    assert utopia(POINTS, OBJECTIVES).tolist() == POINTS[1].tolist()


def test_utopia_leaves_out_an_objective_without_range():
    flat = np.hstack((OBJECTIVES, np.full((4, 1), 7.0)))
    assert utopia(POINTS, flat).tolist() == utopia(POINTS, OBJECTIVES).tolist()


@given(seed=st.integers(0, 2**32))
def test_a_candidate_that_is_best_everywhere_is_every_compromise(seed):
    rng = np.random.default_rng(seed)
    points, objectives = rng.random((9, 4)), rng.random((9, 5)) + 1
    objectives[6] = rng.random(5)
    for point in (
        average(points, objectives),
        utopia(points, objectives),
        best(points, objectives.max(axis=1)),
    ):
        np.testing.assert_allclose(point, points[6], rtol=1e-15)


def test_best_ignores_the_infeasible():
    assert best(POINTS, np.array([3.0, 2.0, np.inf, -np.inf])).tolist() == POINTS[1].tolist()


def test_nothing_to_choose_from_is_said_so():
    nothing = np.full((4, 3), np.nan)
    for choose in (average, utopia):
        with pytest.raises(SettingsError, match="could be simulated"):
            choose(POINTS, nothing)
    with pytest.raises(SettingsError, match="could be simulated"):
        best(POINTS, nothing[:, 0])
