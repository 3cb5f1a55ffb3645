"""What a control engineer looks for: each plot holds what it claims, whatever a fit
looks like."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import make_fit, make_problem, make_record

from hydroid.estimate import Covariance
from hydroid.findings import Finding
from hydroid.fitting.summary import summarise
from hydroid.fitting.validation import fitted
from hydroid.log import Log
from hydroid.parameters import Prior
from hydroid.posterior.identifiability import Profile
from hydroid.reporting.actuator_report import (
    measured_speeds,
    speed_section,
    step_section,
)
from hydroid.reporting.actuator_tables import RESPONSE_HEADER
from hydroid.reporting.analysis import analysis_page
from hydroid.reporting.chart import Chart
from hydroid.reporting.correlation_report import (
    correlation_section,
    correlations,
    strongest,
)
from hydroid.reporting.figure import figure, saved, style
from hydroid.reporting.parameters_report import direction_word, prior_chart, short_table
from hydroid.reporting.residual_report import residual_section
from hydroid.reporting.search_report import search_section, starts
from hydroid.settings.problem import ParameterSettings

PROBLEM = make_problem(outputs=(2, 3), samples=400)
FIT = make_fit(PROBLEM, effects=(1e-3, 1e-3, 0.0, 1e-3))
SUMMARY = summarise(PROBLEM, FIT)
SETTINGS = PROBLEM.settings


def drawn(chart: Chart) -> None:
    with style():
        assert all(saved(figure(chart)))


def test_a_step_of_the_command_gives_its_speed_and_what_is_late_is_not_mixed_up():
    """A joint whose speed follows the command 0.2 s later."""
    time = 0.01 * np.arange(3000)
    command = np.where(time % 4.0 < 2.0, 40.0, -20.0)
    late = np.roll(command, 20)
    late[:20] = 0.0
    # a command acts until the next sample
    angle = 1e-4 * np.append(0.0, np.cumsum(late)[:-1])
    columns = [np.zeros_like(time), command]
    log = Log(
        "a",
        time,
        np.column_stack(columns),
        np.column_stack([np.zeros_like(time), angle]),
        0.01,
    )
    commands, speeds = measured_speeds(log, 2, 0.2)
    assert {*commands} == {40.0, -20.0}
    assert speeds == pytest.approx(1e-2 * commands, abs=1e-9)
    unshifted, _ = measured_speeds(log, 1, 0.0)
    assert len(unshifted) == 0  # never driven


def test_speeds_that_still_change_are_not_taken_for_those_of_their_command():
    time = 0.01 * np.arange(2000)
    command = np.where(time % 5.0 < 2.5, 40.0, -40.0)
    # of first order, with a time constant of 0.5 s
    speed = np.zeros_like(time)
    for k in range(1, len(time)):
        speed[k] = speed[k - 1] + 0.02 * (0.01 * command[k - 1] - speed[k - 1])
    angle = np.cumsum(0.01 * speed)
    log = Log("a", time, command[:, None], angle[:, None], 0.01)
    commands, speeds = measured_speeds(log, 1, 0.0)
    assert len(speeds) > 10
    ratio = speeds / (0.01 * commands)
    # a fifth between halves 0.125 s apart: what is to come is at most 0.8 of the speed
    assert ratio.min() > 0.5
    assert np.median(ratio) == pytest.approx(1.0, abs=0.2)


def test_speeds_have_a_tab_for_each_joint_with_what_was_measured():
    section = speed_section(SETTINGS, SUMMARY, PROBLEM.logs)
    assert section is not None
    assert [tab.button for tab in section.tabs] == ["shoulder", "elbow"]
    # linear between the curve's points: 0.24 deg/s per %
    said = list[str]()
    for joint, name in ((1, "shoulder"), (2, "elbow")):
        ends = PROBLEM.logs[0].command[:, joint]
        tops = [
            f"{word} {0.24 * abs(end):.2g}{unit} at {sign}{abs(end):.0f} %"
            for word, sign, end, unit in (
                ("positive", "+", ends.max(), " deg/s"),
                ("negative", "-", ends.min(), ""),
            )
        ]
        said.append(f"{name} {', '.join(tops)}")
    start = "the model's speed at the logs' largest commands: "
    assert section.answer == start + "; ".join(said)
    chart = section.tabs[0].make()
    labels = {mark.label for panel in chart.panels for mark in panel.marks}
    assert labels >= {
        "measured",
        "model, side A: positive commands",
        "model, side B: negative commands",
    }
    drawn(chart)
    assert (
        speed_section(SETTINGS, SUMMARY.changed({"curves": {}}), PROBLEM.logs) is None
    )


def test_the_valve_s_dead_bands_stand_beside_its_heading():
    """Of the settings where the fit has none, and without what a group adds to them."""
    curves = dict(SUMMARY.curves)
    for joint in ("shoulder", "elbow"):
        curves[f"{joint}_opening"] = curves[f"{joint}_speed"]
    bands = {"a_late": -3.0, "a": 12.0, "b": 8.5}
    parameters = {
        "a_late": {"quantity": "dead_band_a", "per": "late", "sd": 2.0},
        "a": {"quantity": "dead_band_a", "bounds": (0.0, 50.0)},
        "b": {"quantity": "dead_band_b", "fixed": 8.5},
    }
    settings = SETTINGS.changed({"hydraulics.dead_band_b": 5.0}).with_parameters(
        {
            name: ParameterSettings.model_validate(stated | {"joints": [2]})
            for name, stated in parameters.items()
        }
    )
    one = SUMMARY.estimate["K"]
    estimate = {
        name: one.changed({"value": value, "interval": (value - 2.0, value + 2.0)})
        for name, value in bands.items()
    }
    summary = SUMMARY.changed({"curves": curves, "estimate": estimate})
    section = speed_section(settings, summary, PROBLEM.logs)
    assert section is not None
    assert section.title.startswith("Valve: dead band")
    said = "dead band [%]: shoulder +12 ± 2 and -8.5, elbow +0 and -5 (fixed)"
    # the logs have no command of the shoulder from 12 to 16 %
    assert section.answer == f"{said}; extrapolated below 16"
    stated = SUMMARY.quantities["shoulder_dead_band"].changed(
        {"value": 15.0, "interval": (5.0, 40.0), "data_share": 0.2}
    )
    quantities = {"shoulder_dead_band_positive": stated}
    section = speed_section(
        settings, summary.changed({"quantities": quantities}), PROBLEM.logs
    )
    assert section is not None
    said = "dead band [%]: shoulder +15 (5.0 to 40) (mostly prior) and -8.5, elbow"
    assert section.answer.startswith(said)


def test_step_and_frequency_response_stand_where_a_fit_states_them():
    assert step_section(SETTINGS, SUMMARY) is None
    speed = SUMMARY.curves["shoulder_speed"]
    points = {
        "at": (0.5, 1.0, 2.0),
        "value": (3.0, 2.0, 1.0),
        "interval": ((2.0, 4.0), (None, None), (0.5, 2.0)),
    }
    step = speed.changed(
        {
            "label": "any words",
            "along": "time [s]",
            "step": 50.0,
            "moves": "raising",
            **points,
        }
    )
    turned = step.changed({"along": "frequency [Hz]"})
    kinds = {"step": step, "amplitude": turned, "phase": turned}
    curves = {f"shoulder_{kind}_positive": curve for kind, curve in kinds.items()}
    summary = SUMMARY.changed({"curves": curves})
    assert direction_word(summary, "shoulder", "positive") == "raising"
    assert direction_word(summary, "shoulder", "negative") == ""
    section = step_section(SETTINGS, summary)
    assert section is not None
    # a phase of 3 to 1 deg turns no further
    assert section.answer == "lag 90° at over 0.5 Hz (shoulder)"
    # from 3 to 3 / √2, between 0.5 and 1 Hz
    row = dict(zip(RESPONSE_HEADER, section.tables["responses"].rows[0], strict=True))
    assert row["bandwidth (-3 dB) [Hz]"] == "0.9"
    (tab,) = section.tabs
    chart = tab.make()
    assert [(panel.log_x, panel.log_y) for panel in chart.panels] == [
        (False, False),
        (True, True),
        (True, False),
    ]
    assert {mark.label for panel in chart.panels for mark in panel.marks} == {
        "50 % command, raising"
    }
    drawn(chart)


def test_residuals_are_tested_of_each_joint_and_of_none_that_diverged():
    predictions = fitted(FIT)
    section = residual_section(SETTINGS, SUMMARY, predictions)
    assert section is not None
    assert [tab.button for tab in section.tabs] == ["shoulder", "elbow"]
    assert [row[0] for row in section.tables["residuals"].rows] == ["shoulder", "elbow"]
    drawn(section.tabs[0].make())
    lost = [
        replace(one, response=np.full_like(one.response, np.nan)) for one in predictions
    ]
    assert residual_section(SETTINGS, SUMMARY, lost) is None
    assert (
        residual_section(SETTINGS, SUMMARY.changed({"errors": {}}), predictions) is None
    )


def test_the_residuals_heading_says_how_long_what_is_left_of_an_error_lasts():
    """Where they are not white, of the joint whose error lasts longest."""
    predictions = fitted(FIT)
    slow = np.sin(0.05 * np.arange(len(predictions[0].log.time)))[:, None]
    wrong = [replace(one, response=one.response + slow) for one in predictions]

    def answer(*seconds: float) -> str:
        lasting = {
            name: error.changed({"lasts_s": time})
            for (name, error), time in zip(SUMMARY.errors.items(), seconds, strict=True)
        }
        summary = SUMMARY.changed({"errors": lasting})
        section = residual_section(SETTINGS, summary, wrong)
        assert section is not None
        return section.answer

    start = "no, so intervals may be too narrow; "
    assert answer(0.2, 1.4) == f"{start}what is left of the elbow's error lasts 1.4 s"
    assert answer(0.0, 0.0).startswith(f"{start}autocorrelation up to ")


def test_a_prior_and_what_the_logs_made_of_it_are_in_its_standard_deviations():
    free = {"K": {"nominal": 0.25, "sd": 0.05}, "D": {"nominal": 100.0, "within": 3.0}}
    parameters = {
        name: SETTINGS.parameters[name].changed(stated) for name, stated in free.items()
    }
    settings = SETTINGS.with_parameters(parameters)
    estimate = dict(SUMMARY.estimate)
    estimate["K"] = estimate["K"].changed(
        {"value": 0.3, "sd": 0.01, "interval": (0.28, None)}
    )
    estimate["D"] = estimate["D"].changed(
        {"value": 300.0, "sd": 9.0, "interval": (100.0, 300.0)}
    )
    chart = prior_chart(settings, SUMMARY.changed({"estimate": estimate}))
    beside = chart.panels[0]
    assert beside.rows == ("K", "D")
    prior, bars = (mark for mark in beside.marks if mark.kind == "bars")
    points = next(mark for mark in beside.marks if mark.kind == "points")
    # the factor 3 is 1.96 standard deviations
    assert points.x == pytest.approx([1.0, 1.96], rel=1e-2)
    assert prior.x == pytest.approx([-1.96, -1.96])
    assert bars.x == pytest.approx([0.6, 0.0], abs=1e-6)
    # without an end, as far as is drawn
    assert bars.end == pytest.approx([5.0, 1.96], rel=1e-2)
    assert set(chart.panels[1].rows) <= {"M1", "M2"}
    assert Prior(0.25, 0.05).score(np.array(0.3)) == pytest.approx(1.0)
    drawn(chart)


def test_correlations_are_those_of_the_covariance_and_the_strongest_pair_is_named():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(30, 3))
    rows[:, 2] = rows[:, 0] + 0.05 * rows[:, 2]
    root = np.linalg.qr(rows, mode="r")
    names = ("K", "D", "M1")
    known = Covariance(
        parameters=names,
        scale=(1.0,) * 3,
        root=tuple(map(tuple, root.tolist())),
        quantile=2.0,
    )
    expected = np.linalg.inv(rows.T @ rows)
    deviations = np.sqrt(np.diag(expected))
    found = correlations(known)
    assert found == pytest.approx(expected / np.outer(deviations, deviations))
    ((first, second, value),) = strongest(found, names)
    assert {first, second} == {"K", "M1"}
    assert value == pytest.approx(found[0, 2])
    section = correlation_section(SETTINGS, SUMMARY.changed({"covariance": known}))
    assert section is not None
    assert section.answer.startswith("strongest: ")
    drawn(section.tabs[0].make())
    alone = known.changed({"parameters": ("K",), "root": ((1.0,),), "scale": (1.0,)})
    assert correlation_section(SETTINGS, SUMMARY.changed({"covariance": alone})) is None


def test_too_many_parameters_for_one_map_have_one_for_each_joint():
    """With those of other joints that they trade with."""
    count = 42
    names = tuple(f"p{i}" for i in range(count))
    joints = [2 if i < 21 else 3 for i in range(count)]
    rows = np.random.default_rng(1).normal(size=(2000, count))
    rows[:, 30] = rows[:, 5] + 0.3 * rows[:, 30]
    root = np.linalg.qr(rows, mode="r")
    known = Covariance(
        parameters=names,
        scale=(1.0,) * count,
        root=tuple(map(tuple, root.tolist())),
        quantile=2.0,
    )
    stated = SETTINGS.parameters["K"]
    parameters = {
        name: stated.changed({"joints": (joint,)})
        for name, joint in zip(names, joints, strict=True)
    }
    settings = SETTINGS.changed({"parameters": parameters})
    section = correlation_section(settings, SUMMARY.changed({"covariance": known}))
    assert section is not None
    assert [tab.button for tab in section.tabs] == ["shoulder", "elbow"]
    (panel,) = section.tabs[0].make().panels
    assert set(panel.rows) == {*names[:21], "p30"}
    drawn(section.tabs[0].make())


def test_a_parameter_is_one_line_of_words_with_its_interval():
    estimate = dict(SUMMARY.estimate)
    estimate["K"] = estimate["K"].changed(
        {"value": 0.25, "interval": (0.2, 0.31), "source": "data"}
    )
    table = short_table(SETTINGS, SUMMARY.changed({"estimate": estimate}))
    row = dict(zip(table.header, table.shown[0], strict=True))
    expected = {
        "quantity": "torque per command",
        "symbol": "K",
        "value": "0.25",
        "interval": "0.20 to 0.31",
    }
    assert row.items() >= expected.items()
    assert len(table.rows) == len(SUMMARY.estimate)


def test_where_starts_ended_is_above_the_best_of_each_joint():
    chart = starts(("base", "boom"), {2: (5.0, 3.0, np.inf), 0: (7.0, 7.0)})
    (panel,) = chart.panels
    assert panel.rows == ("boom", "all joints")
    assert panel.marks[0].x.tolist() == [2.0, 0.0, 0.0, 0.0]
    drawn(chart)


def test_only_a_search_over_generations_has_curves_of_it():
    record = make_record(PROBLEM, FIT)
    assert {plot.name for plot in search_section(record).plots} == {
        "learning",
        "pareto",
    }
    once = replace(
        record.result, history=record.result.history[-1:], starts={0: (1.0, 2.0)}
    )
    assert {
        plot.name for plot in search_section(replace(record, result=once)).plots
    } == {"starts"}


def test_whether_the_optimum_was_reached_is_said_beside_the_heading():
    record = make_record(PROBLEM, FIT)
    assert search_section(record).answer.startswith("yes: no step promises a gain")
    stopped = {"converged": False, "ending": "its time was up"}
    several = Finding("several optima", "note", ("elbow",))
    behind = Finding("behind nine numbers", "warning", ("elbow",))
    for changes, said in (
        (stopped, "no: its time was up"),
        ({"converged": None}, "not known"),
        (
            {"findings": (several,)},
            "not known: starts of elbow ended at different optima",
        ),
        ({"findings": (several, behind)}, "no, or the model is wrong: nine numbers"),
    ):
        other = replace(record, summary=record.summary.changed(changes))
        assert search_section(other).answer.startswith(said)


def test_a_profile_is_a_curve_with_the_line_that_ends_its_interval():
    values = np.array([0.1, 0.2, 0.3, 0.4])
    points = np.column_stack([values, 25.0 * (values - 0.25) ** 2 * 100])
    page = analysis_page(SETTINGS, SUMMARY, {"K": Profile((0.2, 0.3), 0.0, points)})
    assert {"parameters", "correlations"} <= set(page.tables)
    (tab,) = next(
        section for section in page.sections if section.title == "Profiles"
    ).tabs
    assert tab.caption == "torque per command (K)"
    rule, line, _ = tab.make().panels[0].marks
    assert rule.y == pytest.approx([1.96**2], rel=1e-3)
    assert np.array_equal(line.x, values)
    drawn(tab.make())
    bare = analysis_page(SETTINGS, SUMMARY, {})
    assert "Profiles" not in [section.title for section in bare.sections]
