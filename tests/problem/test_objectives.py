"""Norms, segments and objectives by their laws."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from hydroid.errors import SettingsError
from hydroid.problem.channels import (
    norm,
    overall_objective,
    segment_bounds,
    segment_objectives,
)
from hydroid.settings.problem import ObjectiveSettings

ORDERS = [1, 2, "inf"]
ERROR = np.random.default_rng(3).normal(size=(9, 1001))


@pytest.mark.parametrize("p", ORDERS)
def test_equation_18_and_its_laws(p):
    power = 400 if p == "inf" else p
    literal = [
        sum(abs(e) ** power / len(row) for e in row) ** (1 / power)
        for row in ERROR.tolist()
    ]
    # N^(1/400) is what is left of the mean at p = 400
    rtol = 1001 ** (1 / 400) - 1 if p == "inf" else 1e-12
    np.testing.assert_allclose(norm(ERROR, p), literal, rtol=rtol)
    a, b = ERROR, ERROR[::-1]
    np.testing.assert_allclose(norm(-3 * a, p), 3 * norm(a, p), rtol=1e-14)
    assert (norm(a + b, p) <= norm(a, p) + norm(b, p) + 1e-15).all()
    # a mean norm: the same record twice changes nothing
    np.testing.assert_allclose(norm(np.hstack((a, a)), p), norm(a, p), rtol=1e-14)
    assert (norm(ERROR, 1) <= norm(ERROR, 2)).all()
    assert (norm(ERROR, 2) <= norm(ERROR, "inf")).all()


@pytest.mark.parametrize("p", ORDERS)
@given(
    rows=st.lists(st.integers(0, 8), min_size=1, max_size=9),
    layout=st.sampled_from("CF"),
)
def test_a_norm_does_not_depend_on_other_candidates_bit_for_bit(p, rows, layout):
    together = norm(np.asarray(ERROR[rows], order=layout), p)
    assert together.tolist() == [norm(ERROR[k : k + 1], p)[0] for k in rows]


@pytest.mark.parametrize("p", ORDERS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.filterwarnings("error")
def test_only_a_row_that_is_not_finite_is_infinite(p, bad):
    broken = ERROR.copy()
    broken[4, 700] = bad
    value, others = norm(broken, p), np.arange(9) != 4
    assert value[4] == np.inf
    assert (value[others] == norm(ERROR, p)[others]).all()
    assert norm(np.full((1, 3), 1e200), 2)[0] == np.inf  # overflow


@pytest.mark.parametrize("p", ORDERS)
def test_a_relative_objective_has_no_unit(p):
    measured, how = (
        np.sin(np.arange(1001) / 50),
        ObjectiveSettings(norm=p, relative=True),
    )
    value = overall_objective(ERROR, measured, how)
    other = overall_objective(np.rad2deg(ERROR), np.rad2deg(measured), how)
    np.testing.assert_allclose(value, other, rtol=1e-13)
    assert (
        overall_objective(ERROR, measured, ObjectiveSettings(norm=p)) == norm(ERROR, p)
    ).all()
    # a model that never moves
    assert overall_objective(measured[None, :], measured, how)[0] == 1.0
    with pytest.raises(SettingsError, match=r"objective\.relative"):
        overall_objective(np.ones((2, 5)), np.zeros(5), how)


@given(samples=st.integers(1, 60), n=st.integers(1, 70))
def test_any_record_is_covered_or_refused(samples, n):
    try:
        bounds = segment_bounds(samples, n)
    except SettingsError:
        assert n > samples
        return
    assert len(bounds) == n
    assert bounds[[0, -1], [0, 1]].tolist() == [0, samples]
    assert (bounds[1:, 0] == bounds[:-1, 1]).all()
    lengths = bounds[:, 1] - bounds[:, 0]
    assert lengths.min() > 0
    assert np.ptp(lengths) <= 1


def test_each_segment_is_scored_by_its_own_samples():
    rng = np.random.default_rng(0)
    error, measured, how = (
        rng.normal(size=(5, 90)),
        rng.normal(size=90),
        ObjectiveSettings(norm=2),
    )
    bounds = segment_bounds(90, 4)
    whole = segment_objectives(error, measured, bounds, how)
    assert whole.shape == (5, 4)
    # equation (22) is a mean norm: weighted by their lengths, the segments add up to
    # the record
    lengths = bounds[:, 1] - bounds[:, 0]
    np.testing.assert_allclose(whole**2 @ lengths / 90, norm(error, 2) ** 2, rtol=1e-13)
    for s, (a, b) in enumerate(bounds):
        changed = error.copy()
        changed[:, a:b] += 1
        moved = segment_objectives(changed, measured, bounds, how) != whole
        assert moved[:, s].all()
        assert not np.delete(moved, s, axis=1).any()
    # a candidate that diverges late is infeasible in every segment
    error[1, 89] = np.nan
    value = segment_objectives(error, measured, bounds, how)
    assert (value[1] == np.inf).all()
    assert np.isfinite(value[[0, 2, 3, 4]]).all()
