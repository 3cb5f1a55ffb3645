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
from hydroid.reporting.actuator_tables import (
    bandwidth,
    far_commands,
    phase_crossing,
    settling_time,
    speed_table,
)
from hydroid.reporting.oil_report import oil_section
from hydroid.settings.problem import ParameterSettings

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


def phase_of_a_delay(delay: float, low: float, high: float) -> CurveEstimate:
    """Return the phase of a delay [s] from 0.2 to 5 Hz, with its interval."""
    at = np.geomspace(0.2, 5.0, 60)
    of = [tuple((-360.0 * at * seconds).tolist()) for seconds in (delay, high, low)]
    phase = curve(tuple(at.tolist()), of[0], "deg")
    return phase.changed({"interval": tuple(zip(*of[1:], strict=True))})


def test_a_quarter_of_a_turn_is_late_at_a_quarter_of_the_delay_s_frequency():
    found = phase_crossing(phase_of_a_delay(0.25, low=0.2, high=0.5))
    assert found is not None
    assert found.frequency == pytest.approx(1.0, rel=1e-2)
    assert found.interval == pytest.approx((0.5, 1.25), rel=1e-2)
    assert found.cell == "1.00 (0.50 to 1.25)"
    # beyond the logs' rate, or below the lowest frequency, there is none
    early = phase_crossing(phase_of_a_delay(0.01, low=0.005, high=0.02))
    assert early is not None
    assert early.cell == "over 5"
    assert phase_crossing(phase_of_a_delay(2.0, low=1.9, high=2.1)) is None


def test_measured_medians_that_the_model_misses_by_far_are_named():
    speed = curve((20.0, 40.0, 60.0), (1.0, 10.0, 20.0), "deg/s")
    # a fifth off, near; a half off, far; and so slow that it does not matter
    medians = {20.0: 0.2, 40.0: 8.0, 60.0: 10.0}
    pairs = [(command, value) for command, value in medians.items() for _ in range(5)]
    measured = np.array(pairs).T
    assert far_commands(speed, measured) == [60.0]


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
        "pump at most 150 L/min (fixed); no log measures pressures"
    )
    # what limits them, and whether the fit says so
    assert "at most 150 L/min (fixed)" in section.text
    assert "at most 150 bar (fixed), where the relief valve opens" in section.text


def test_a_pump_that_is_mostly_the_prior_s_is_called_so_beside_its_interval():
    first, _ = fitted(FIT)
    parameter = {"quantity": "pump_flow", "bounds": (10.0, 500.0), "joints": None}
    settings = PROBLEM.settings.changed({"hydraulics.pump_flow": 150.0})
    settings = settings.with_parameters(
        {"flow": ParameterSettings.model_validate(parameter)}
    )
    known = {"value": 116.0, "interval": (62.0, 217.0), "data_share": 0.18}
    flow = SUMMARY.estimate["K"].changed(known | {"interval_by_log": (53.0, 254.0)})

    def answer(**changes) -> str:
        summary = SUMMARY.changed({"estimate": {"flow": flow.changed(changes)}})
        section = oil_section(settings, summary, [with_oil(first, 1e-3, 90e5)], None)
        assert section is not None
        return section.answer.partition(";")[0]

    assert answer() == "pump at most 116 (62 to 217) L/min (mostly prior)"
    from_logs = {"data_share": 0.9, "interval": (110.0, 120.0)}
    assert answer(**from_logs) == "pump at most 116 ± 6 L/min"


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
