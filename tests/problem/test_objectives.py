"""Norms, segments and objectives by their laws, and the settings that choose them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydroid.errors import SettingsError
from hydroid.problem.objectives import norm, overall_objective, segment_bounds, segment_objectives
from hydroid.settings.load import validate
from hydroid.settings.problem import ObjectiveSettings, SegmentSettings

ORDERS = [1, 2, "inf"]
ERROR = np.random.default_rng(3).normal(size=(9, 1001))
LEVELS = np.array([0.0, 20, -5, 30, 9, 25, 0.5, 15, 3])  # no two swings alike
NEAR = 0.05 / 4 * 35  # how far from its peak a cut may lie: a quarter of the least swing that counts


@pytest.mark.parametrize("p", ORDERS)
def test_equation_18_and_its_laws(p):
    power = 400 if p == "inf" else p
    literal = [sum(abs(e) ** power / len(row) for e in row) ** (1 / power) for row in ERROR.tolist()]
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
@given(rows=st.lists(st.integers(0, 8), min_size=1, max_size=9), layout=st.sampled_from("CF"))
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
    measured, how = np.sin(np.arange(1001) / 50), ObjectiveSettings(norm=p, relative=True)
    value = overall_objective(ERROR, measured, how)
    np.testing.assert_allclose(
        value, overall_objective(np.rad2deg(ERROR), np.rad2deg(measured), how), rtol=1e-13
    )
    assert (overall_objective(ERROR, measured, ObjectiveSettings(norm=p)) == norm(ERROR, p)).all()
    assert overall_objective(measured[None, :], measured, how)[0] == 1.0  # a model that never moves
    with pytest.raises(SettingsError, match=r"objective\.relative"):
        overall_objective(np.ones((2, 5)), np.zeros(5), how)


def cuts(measured, **how):
    return segment_bounds(np.asarray(measured, dtype=float), 0.01, SegmentSettings(**how))[1:, 0]


@pytest.mark.filterwarnings("error")
def test_given_times_are_kept_unless_a_segment_is_empty():
    assert cuts(np.zeros(1000), times=(1.0, 2.504, 9.99)).tolist() == [100, 250, 999]
    for times in [(10.0,), (1e300,), (0.001,), (3.0, 3.001)]:
        with pytest.raises(SettingsError, match=r"objective\.segments.*do not fit"):
            cuts(np.zeros(1000), times=times)


def strokes(levels, steps):
    """A joint that travels from level to level, smoothly, in `steps` samples each."""
    ramp = (1 - np.cos(np.pi * np.arange(steps) / steps)) / 2
    parts = [a + (b - a) * ramp for a, b in pairwise(levels)]
    return np.concatenate([*parts, levels[-1:]])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from([0.0, 0.3]))
def test_cuts_are_peaks_and_troughs_despite_noise_and_quantisation(seed, noise):
    clean, quantum = strokes(LEVELS, 500), 0.2
    noisy = clean + np.random.default_rng(seed).uniform(-noise, noise, clean.size)
    if noise:
        noisy = np.round(noisy / quantum) * quantum
    found = cuts(noisy, turning_points=8)
    assert np.rint(found / 500).tolist() == [1, 2, 3, 4, 5, 6, 7]
    slack = 2 * (noise + quantum / 2) if noise else 0.0
    assert np.abs(clean[found] - LEVELS[1:-1]).max() <= NEAR + slack


def test_the_most_prominent_turns_are_chosen():
    y = strokes(np.array([0.0, 20, 17, 21, 0, 10, 1]), 100)  # a peak with a small dent, then a trough
    assert np.rint(cuts(y, turning_points=4) / 100).tolist() == [3, 4, 5]
    assert np.rint(cuts(y, turning_points=6) / 100).tolist() == [1, 2, 3, 4, 5]
    with pytest.raises(SettingsError, match=r"has 7 .* at most 8 segments"):
        cuts(strokes(LEVELS, 100), turning_points=9)


@given(
    sign=st.sampled_from([1, -1]),
    scale=st.floats(1e-3, 1e3),
    shift=st.floats(-100, 100),
    n=st.integers(1, 8),
)
def test_cuts_do_not_depend_on_unit_sign_or_zero(sign, scale, shift, n):
    y = strokes(LEVELS, 100)
    moved = cuts(sign * scale * y + shift, turning_points=n) - cuts(y, turning_points=n)
    assert (np.abs(moved) <= 1).all()  # a sample that lies on the edge of a stretch may round either way


@given(
    values=st.lists(st.integers(-5, 5), min_size=1, max_size=60),
    n=st.integers(1, 12),
    kind=st.sampled_from(["equal", "turning_points"]),
)
def test_any_record_is_covered_or_refused(values, n, kind):
    try:
        bounds = segment_bounds(np.array(values, dtype=float), 0.01, SegmentSettings(**{kind: n}))
    except SettingsError:
        assert n > (len(values) if kind == "equal" else 1)  # the whole record is always one segment
        return
    assert len(bounds) == n
    assert bounds[[0, -1], [0, 1]].tolist() == [0, len(values)]
    assert (bounds[1:, 0] == bounds[:-1, 1]).all()
    lengths = bounds[:, 1] - bounds[:, 0]
    assert lengths.min() > 0
    assert kind != "equal" or np.ptp(lengths) <= 1


def test_each_segment_is_scored_by_its_own_samples():
    rng = np.random.default_rng(0)
    error, measured, how = rng.normal(size=(5, 90)), rng.normal(size=90), ObjectiveSettings(norm=2)
    bounds = segment_bounds(measured, 0.01, SegmentSettings(equal=4))
    whole = segment_objectives(error, measured, bounds, how)
    assert whole.shape == (5, 4)
    # equation (22) is a mean norm: weighted by their lengths, the segments add up to the record
    lengths = bounds[:, 1] - bounds[:, 0]
    np.testing.assert_allclose(whole**2 @ lengths / 90, norm(error, 2) ** 2, rtol=1e-13)
    for s, (a, b) in enumerate(bounds):
        changed = error.copy()
        changed[:, a:b] += 1
        moved = segment_objectives(changed, measured, bounds, how) != whole
        assert moved[:, s].all()
        assert not np.delete(moved, s, axis=1).any()
    error[1, 89] = np.nan  # a candidate that diverges late is infeasible in every segment
    value = segment_objectives(error, measured, bounds, how)
    assert (value[1] == np.inf).all()
    assert np.isfinite(value[[0, 2, 3, 4]]).all()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"norm": 3}, "norm"),
        ({"segments": {}}, "exactly one of equal, turning_points, times"),
        ({"segments": {"equal": 2, "times": [1.0]}}, "not equal and times"),
        ({"segments": {"times": [2.0, 1.0]}}, "must increase"),
        ({"segments": {"equal": 0}}, "segments.equal"),
        ({"segments": {"times": [0.0]}}, "segments.times.0"),
    ],
)
def test_settings_that_cannot_be_used_are_named(values, message):
    with pytest.raises(SettingsError, match=message):
        validate(values, ObjectiveSettings, "fit.yaml")
