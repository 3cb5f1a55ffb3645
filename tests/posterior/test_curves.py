"""Curves of a joint by laws: a valve from shut to open, a lag whose frequency response
is known."""

import numpy as np
import pytest
from made_logs import HYDRAULIC, step_log

from hydroid import load_settings
from hydroid.identified_model import identified
from hydroid.posterior.bench import Direction, actuator, make_bench
from hydroid.posterior.curves import (
    OPENING_COMMANDS,
    frequency_response,
    opening_curve,
    step_curves,
)
from hydroid.problem.bindings import Bindings

OVERLAPS = {"hydraulics.overlap_a": 0.4, "hydraulics.overlap_b": 0.3}


def shoulder(**changes: object):
    """The article's shoulder on the bench, and its true values."""
    values = {
        name: value for name, value in HYDRAULIC.items() if name not in ("F1", "x1")
    }
    settings = load_settings("article-hyd", {"parameters.S.fixed": 0.0} | changes)
    model = identified(settings, values, "test")
    # two sizes a direction: commands that are on or off would tell of no others
    log = step_log(settings.arm.pose("study"), {2: [50.0, 100.0, -50.0, -100.0]})
    log.angle[-1, 1] += 0.6  # the travel
    return make_bench(settings, [log], 2), Bindings(settings).candidates(
        model.theta[None]
    )


@pytest.mark.parametrize("late", [0.0, 0.137])
def test_the_frequency_response_of_a_late_lag_is_the_analytic_one(late: float):
    lag, period = 0.2, 0.01
    edges = period * np.arange(301)
    since = np.maximum(edges - late, 0.0)
    way = since - lag * (1.0 - np.exp(-since / lag))  # the integral of the speed
    speeds = np.diff(way)[None] / period
    frequencies = np.geomspace(0.2, 12.0, 9)
    amplitude, phase = frequency_response(speeds, frequencies, period)
    turned = 2 * np.pi * frequencies
    assert amplitude[0] == pytest.approx(1 / np.sqrt(1 + (turned * lag) ** 2), rel=0.02)
    expected = -np.degrees(np.arctan(turned * lag) + turned * late)
    assert phase[0] == pytest.approx(expected, abs=1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_valve_with_an_overlap_is_shut_then_opens_to_its_largest_opening(sign: float):
    bench, estimate = shoulder(**OVERLAPS)
    points = [
        (column.at, float(area[0]))
        for column, area in opening_curve(bench, estimate, sign)
    ]
    at, areas = np.array(points).T
    assert at == pytest.approx(sign * np.array(OPENING_COMMANDS))
    c, *_ = actuator(bench, estimate)
    largest = 1e6 * float((c.a if sign > 0 else c.b).opening[0])
    assert areas[0] == 0.0
    assert np.all(np.diff(areas) >= 0.0)
    assert 0.2 * largest < areas[-1] <= largest


def test_a_step_is_shown_up_to_the_end_of_the_range_and_slow_commands_are_followed():
    bench, estimate = shoulder()
    step = bench.movement(50.0, 3.0)
    speeds = step.speeds(estimate)
    curves = step_curves(step, estimate, Direction(1.0, "positive", "raising"))(speeds)
    points = [(column, float(value[0])) for column, value in curves]
    answered = {(column.step, column.moves) for column, _ in points}
    assert answered == {(50.0, "raising")}
    times = np.array(
        [column.at for column, _ in points if column.name == "step_positive"]
    )
    angles = step.angles(estimate)[0]
    upper = bench.settings.arm.stops(2)[1]
    assert np.all(
        np.interp(times, bench.period * np.arange(len(angles)), angles) < upper
    )
    amplitudes = [
        value for column, value in points if column.name == "amplitude_positive"
    ]
    phases = [value for column, value in points if column.name == "phase_positive"]
    settled = np.interp(1.0, bench.period * np.arange(speeds.shape[1]), speeds[0])
    assert amplitudes[0] == pytest.approx(settled / 50.0, rel=0.05)
    assert -15.0 < phases[0] < 0.0
