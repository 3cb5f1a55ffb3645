from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydroid.errors import SettingsError
from hydroid.problem.norms import norm
from hydroid.problem.segments import segment_bounds, segment_objectives
from hydroid.settings.problem import ObjectiveSettings, SegmentSettings

PERIOD = 0.01


def cuts(measured, **how):
    return segment_bounds(np.asarray(measured, dtype=float), PERIOD, SegmentSettings(**how))[1:, 0]


def covers(bounds, samples):
    return (
        bounds[0, 0] == 0
        and bounds[-1, 1] == samples
        and (bounds[1:, 0] == bounds[:-1, 1]).all()
        and (bounds[:, 1] > bounds[:, 0]).all()
    )


@given(samples=st.integers(1, 400), n=st.integers(1, 400))
def test_equal_segments_cover_the_record_evenly_or_are_refused(samples, n):
    if n > samples:
        with pytest.raises(SettingsError, match="do not fit"):
            cuts(np.zeros(samples), equal=n)
        return
    bounds = segment_bounds(np.zeros(samples), PERIOD, SegmentSettings(equal=n))
    assert bounds.shape == (n, 2)
    assert covers(bounds, samples)
    assert np.ptp(bounds[:, 1] - bounds[:, 0]) <= 1


def test_given_times_are_kept():
    assert cuts(np.zeros(1000), times=(1.0, 2.504, 9.99)).tolist() == [100, 250, 999]


@pytest.mark.parametrize("times", [(10.0,), (1e300,), (0.001,), (3.0, 3.001)])
@pytest.mark.filterwarnings("error")
def test_times_that_leave_a_segment_empty_are_refused(times):
    with pytest.raises(SettingsError, match=r"objective\.segments.*do not fit"):
        cuts(np.zeros(1000), times=times)


def strokes(levels, steps):
    """A joint that travels from level to level, smoothly, in `steps` samples each."""
    ramp = (1 - np.cos(np.pi * np.arange(steps) / steps)) / 2
    parts = [a + (b - a) * ramp for a, b in pairwise(levels)]
    return np.concatenate([*parts, levels[-1:]])


LEVELS = np.array([0.0, 20, -5, 30, 9, 25, 0.5, 15, 3])  # no two swings alike
NEAR = 0.05 / 4 * 35  # how far from its peak a cut may lie: a quarter of the least swing that counts


def test_cuts_are_the_peaks_and_troughs():
    y = strokes(LEVELS, 500)
    found = cuts(y, turning_points=8)
    assert np.rint(found / 500).tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert np.abs(y[found] - LEVELS[1:-1]).max() <= NEAR


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_noise_and_quantisation_do_not_make_turns(seed):
    rng = np.random.default_rng(seed)
    clean = strokes(LEVELS, 500)
    noise, quantum = 0.3, 0.2
    noisy = np.round((clean + rng.uniform(-noise, noise, clean.size)) / quantum) * quantum
    found = cuts(noisy, turning_points=8)
    assert np.rint(found / 500).tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert np.abs(clean[found] - LEVELS[1:-1]).max() <= NEAR + 2 * (noise + quantum / 2)


@settings(max_examples=30, deadline=None)
@given(
    plateaus=st.lists(st.integers(0, 300), min_size=7, max_size=7),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_plateau_is_cut_inside(plateaus, seed):
    held = np.ones(8, dtype=int)
    held[1:] += plateaus
    turns = [strokes(LEVELS[k : k + 2], 200)[:-1] for k in range(8)]
    record, inside = [], []
    for k, stroke in enumerate(turns):
        record.append(np.full(held[k], LEVELS[k]))
        inside.append(sum(map(len, record[:-1])) + np.array([0, held[k]]))
        record.append(stroke)
    y = np.concatenate(record)
    y = y + np.random.default_rng(seed).normal(0, 0.1, y.size)
    found = cuts(y, turning_points=8)
    for cut, (first, end) in zip(found, inside[1:], strict=True):
        assert first - 30 <= cut <= end + 30


def test_the_most_prominent_turns_are_chosen():
    #                        peak  small dent   trough
    levels = np.array([0.0, 20, 17, 21, 0, 10, 1])
    y = strokes(levels, 100)
    assert np.rint(cuts(y, turning_points=4) / 100).tolist() == [3, 4, 5]
    assert np.rint(cuts(y, turning_points=6) / 100).tolist() == [1, 2, 3, 4, 5]


@given(data=st.data(), scale=st.floats(1e-3, 1e3), shift=st.floats(-100, 100), n=st.integers(1, 8))
def test_cuts_do_not_depend_on_unit_sign_or_zero(data, scale, shift, n):
    y = strokes(LEVELS, 100)
    sign = data.draw(st.sampled_from([1, -1]))
    moved = cuts(sign * scale * y + shift, turning_points=n) - cuts(y, turning_points=n)
    assert (np.abs(moved) <= 1).all()  # a sample that lies on the edge of a stretch may round either way


@given(
    values=st.lists(st.integers(-5, 5), min_size=1, max_size=60),
    n=st.integers(1, 12),
    swing=st.floats(0.01, 0.9),
)
def test_any_record_is_covered_or_refused(values, n, swing):
    how = SegmentSettings(turning_points=n, swing=swing)
    try:
        bounds = segment_bounds(np.array(values, dtype=float), PERIOD, how)
    except SettingsError:
        assert n > 1  # the whole record is always one segment
        return
    assert len(bounds) == n
    assert covers(bounds, len(values))


def test_too_many_turning_points_says_how_many_there_are():
    y = strokes(LEVELS, 100)
    with pytest.raises(SettingsError, match=r"has 7 .* at most 8 segments"):
        cuts(y, turning_points=9)
    with pytest.raises(SettingsError, match="at most 1 segments"):
        cuts(np.zeros(50), turning_points=2)


def test_each_segment_is_scored_by_its_own_samples():
    rng = np.random.default_rng(0)
    error, measured = rng.normal(size=(5, 90)), rng.normal(size=90)
    bounds = segment_bounds(measured, PERIOD, SegmentSettings(equal=4))
    whole = segment_objectives(error, measured, bounds, ObjectiveSettings(norm=2))
    assert whole.shape == (5, 4)
    # equation (22) is a mean norm: weighted by their lengths, the segments add up to the record
    lengths = bounds[:, 1] - bounds[:, 0]
    np.testing.assert_allclose(whole**2 @ lengths / 90, norm(error, 2) ** 2, rtol=1e-13)
    for s, (a, b) in enumerate(bounds):
        changed = error.copy()
        changed[:, a:b] += 1
        moved = segment_objectives(changed, measured, bounds, ObjectiveSettings(norm=2)) != whole
        assert moved[:, s].all()
        assert not np.delete(moved, s, axis=1).any()


def test_a_member_that_breaks_down_late_is_infeasible_in_every_segment():
    error = np.ones((3, 40))
    error[1, 39] = np.nan
    bounds = segment_bounds(error[0], PERIOD, SegmentSettings(equal=4))
    value = segment_objectives(error, error[0], bounds, ObjectiveSettings())
    assert (value[1] == np.inf).all()
    assert np.isfinite(value[[0, 2]]).all()
