"""Derivatives along the axes of a covariance: by laws of functions whose derivatives
are known."""

import numpy as np
import pytest

from hydroid.search.axes import (
    SHARED,
    Axes,
    Box,
    covariance_axes,
    differentiate,
    single_axes,
)

SLOPES = np.random.default_rng(1).normal(size=(3, 40))
ROOT = np.array([[100.0, 99.0, 0.0], [0.0, 2.0, 1.0], [0.0, 0.0, 50.0]])


def box(at=(1.0, 2.0, 3.0), varied=(True, True, True)):
    at = np.array(at)
    return Box(at, np.zeros(3), np.full(3, 4.0), np.ones(3), np.array(varied))


def linear(points):
    return points @ SLOPES


@pytest.mark.parametrize(
    "at", [(1.0, 2.0, 3.0), (0.0, 2.0, 4.0), (0.0, 0.0, 4.0), (1e-4, 2.0, 3.9999)]
)
@pytest.mark.parametrize("sided", [lambda axes: axes, lambda axes: axes.one_sided])
def test_a_linear_function_is_differentiated_exactly_inside_and_at_bounds(at, sided):
    here, visited = box(at), []

    def function(points):
        visited.append(points)
        return linear(points)

    owner = np.array([0, SHARED, 1])
    for axes in (
        single_axes(here, 1e-3),
        covariance_axes(here, ROOT, 1.0),
        covariance_axes(here, ROOT, 1.0, owner),
    ):
        np.testing.assert_allclose(
            differentiate(function, here, sided(axes)), SLOPES, rtol=1e-8, atol=1e-8
        )
    points = np.vstack(visited)
    assert (points >= here.lower).all()
    assert (points <= here.upper).all()


def test_axes_of_an_owner_leave_the_others_and_shared_ones_carry_them_along():
    owner = np.array([0, SHARED, 1])
    axes = covariance_axes(box(), ROOT, 0.01, owner)
    of_first, of_second, shared = axes.directions
    np.testing.assert_array_equal(of_first != 0.0, [True, False, False])
    np.testing.assert_array_equal(of_second != 0.0, [False, False, True])
    # as short as can be: what is left has nothing along the owners' effects
    np.testing.assert_allclose(ROOT @ shared @ ROOT[:, [0, 2]], 0.0, atol=1e-9)
    lengths = np.linalg.norm(ROOT @ axes.directions.T, axis=0)
    np.testing.assert_allclose(lengths * axes.steps[:, 0], 0.01)


def test_held_coordinates_stay():
    here = box(varied=(True, False, True))
    found = differentiate(linear, here, covariance_axes(here, ROOT[::2, ::2], 1.0))
    np.testing.assert_allclose(found, SLOPES[::2], rtol=1e-8)


def test_curvature_is_no_slope():
    def function(points):
        change = points - np.array([1.0, 2.0, 3.0])
        return (
            points @ SLOPES
            + 1e4 * (change[:, :1] ** 3 + change[:, :1] ** 2) * SLOPES[0]
        )

    axes = Axes(np.eye(3), np.tile([0.1, -0.1], (3, 1)))
    found = differentiate(function, box(), axes)
    # 100 times without shorter steps
    assert np.linalg.norm(found - SLOPES) < 2 * np.linalg.norm(SLOPES)


def test_an_axis_that_fails_keeps_its_former_slope():
    def function(points):
        rows = linear(points)
        rows[points[:, 1] != 2.0] = np.nan
        return rows

    here, axes = box(), single_axes(box(), 1e-3)
    alone = differentiate(function, here, axes)
    assert np.isnan(alone[1]).all()
    np.testing.assert_allclose(
        differentiate(function, here, axes, former=SLOPES), SLOPES, rtol=1e-8
    )
