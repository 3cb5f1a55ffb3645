"""Tables of speeds, responses, pressures and flows state what the curves and traces
have."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import make_fit, make_problem

from hydroid.estimate import CurveEstimate, FitSummary
from hydroid.fitting.summary import summarise
from hydroid.fitting.validation import Prediction, fitted
from hydroid.prediction import OilTrace
from hydroid.reporting.actuator_tables import bandwidth, settling_time, speed_table
from hydroid.reporting.oil_report import oil_section

PROBLEM = make_problem(outputs=(2, 3), samples=200, sources=("a.csv", "b.csv"))
FIT = make_fit(PROBLEM)
SUMMARY = summarise(PROBLEM, FIT)


def curve(at: tuple[float, ...], value: tuple[float, ...], unit: str) -> CurveEstimate:
    interval = tuple((y - 0.1 * abs(y), y + 0.1 * abs(y)) for y in value)
    return CurveEstimate(
        label="speed",
        joint=2,
        unit=unit,
        along="command [%]",
        at=at,
        value=value,
        interval=interval,
    )


def test_speeds_stand_at_every_tenth_per_cent_beside_the_median_of_measured_ones():
    speed = curve((-20.0, -5.0, 10.0, 20.0), (-8.0, -1.0, 0.0, 9.0), "deg/s")
    opening = curve((10.0, 20.0), (0.0, 4.0), "mm²")
    near = [[18.0, 19.0, 20.0, 21.0, 22.0], [7.0, 8.0, 8.5, 9.0, 30.0]]
    table = speed_table("boom", speed, opening, np.array(near))
    assert table.header == (
        "command [%]",
        "speed [deg/s]",
        "95 %",
        "measured",
        "valve [mm²]",
    )
    assert table.rows == (
        ("-20", "-8.0", "-8.8 to -7.2", None, None),
        ("+10", "0", None, None, "0"),
        ("+20", "9.0", "8.1 to 9.9", "8.5", "4"),
    )


def test_a_bandwidth_is_where_the_amplitude_has_fallen_by_3_db():
    lag = 0.5 / np.pi  # of first order: 1 Hz
    at = np.geomspace(0.01, 10.0, 200)
    gain = 1.0 / np.hypot(1.0, 2.0 * np.pi * at * lag)
    known = curve(tuple(at.tolist()), tuple(gain.tolist()), "deg/s per %")
    assert bandwidth(known) == pytest.approx(1.0, rel=1e-2)
    short = curve((0.01, 0.02), (1.0, 0.99), "deg/s per %")
    assert bandwidth(short) is None


def after_a_step(at: np.ndarray, speed: np.ndarray, onset: float) -> FitSummary:
    """Return a summary of a boom whose speed after a step is known, with a dead time, and a
    time constant of 0.2 s."""
    known = SUMMARY.quantities["shoulder_dead_band"]
    step = curve(tuple(at.tolist()), tuple(speed.tolist()), "deg/s")
    quantities = {
        "boom_dead_time_positive": known.changed({"value": onset}),
        "boom_time_constant_positive": known.changed({"value": 0.2}),
    }
    curves = {"boom_step_positive": step}
    return SUMMARY.changed({"curves": curves, "quantities": quantities})


def test_a_step_has_settled_where_its_speed_stays_within_5_per_cent():
    at = np.arange(0.0, 3.0, 0.01)
    late = np.maximum(at - 0.3, 0.0)
    # of first order: ln 20 time constants behind the delay
    lag = after_a_step(at, 8.0 * (1.0 - np.exp(-late / 0.2)), 0.3)
    found = settling_time("boom", "positive", lag)
    assert found is not None
    assert found.seconds == pytest.approx(0.3 + 0.2 * np.log(20.0), abs=0.03)
    # a pose that changes later on is none of the step
    leaves = after_a_step(
        at, 8.0 * (1.0 - np.exp(-late / 0.2)) + 5.0 * np.maximum(at - 1.4, 0.0), 0.3
    )
    assert settling_time("boom", "positive", leaves) == found
    # the first and the last pass through 5 % tell nothing of one that rings
    rings = after_a_step(at, 8.0 + 4.0 * np.cos(20.0 * at), 0.3)
    found = settling_time("boom", "positive", rings)
    assert str(found) == "over 1.3"
    assert settling_time("boom", "negative", lag) is None


def with_oil(prediction: Prediction, flow: float, lowest: float) -> Prediction:
    """Give a prediction oil whose flow peaks, and whose pump falls, at its tenth
    sample."""
    shape = (*prediction.response.shape, 2)
    flows = np.zeros(shape)
    flows[10, 0] = flow, -flow
    line = np.full(shape[0], 200e5)
    line[10] = lowest
    return replace(prediction, oil=OilTrace(np.full(shape, 50e5), flows, line))


def test_the_largest_flow_and_the_lowest_pressure_of_the_pump_have_their_log_and_time():
    first, second = fitted(FIT)
    predictions = [with_oil(first, 1e-3, 90e5), with_oil(second, 2e-3, 120e5)]
    settings = PROBLEM.settings.changed({"hydraulics.pump_flow": 150.0})
    section = oil_section(settings, SUMMARY, predictions, None)
    assert section is not None
    row = ("shoulder", "50", "50", "120", "b.csv", "0.1")
    assert section.tables["oil"].rows[0] == row
    assert section.tables["pump"].rows == (
        ("pump's line", "200", "90", "a.csv", "0.1"),
    )
    assert section.answer == (
        "the pump gives at most 150 L/min, and its line falls from 200 to 90 bar; "
        "no log measures pressures"
    )
    # what limits them, and whether the fit says so
    assert "at most 150 L/min (fixed)" in section.text
    assert "at most 150 bar (fixed), where the relief valve opens" in section.text


def test_without_hydraulics_or_a_pump_nothing_is_said_of_them():
    first, _ = fitted(FIT)
    assert oil_section(PROBLEM.settings, SUMMARY, [first], None) is None
    alone = with_oil(first, 1e-3, 90e5)
    assert alone.oil is not None
    alone = replace(alone, oil=replace(alone.oil, line=None))
    section = oil_section(PROBLEM.settings, SUMMARY, [alone], None)
    assert section is not None
    assert "pump" not in section.tables
    assert section.answer.startswith("flow in up to: shoulder 60 L/min")
