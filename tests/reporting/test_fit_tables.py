"""The numbers and words of a fit's tables are the fit's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from linear_problem import ar1
from report_fits import MODEL, make_fit, make_problem, make_record, make_uncertainty

from hydroid import load_settings
from hydroid.commands.fit import fit_result
from hydroid.estimate import QuantityEstimate
from hydroid.findings import OF_OPTIMUM, Finding
from hydroid.fitting import verdict as verdict_of
from hydroid.fitting.summary import summarise
from hydroid.reporting.held_values import held_table
from hydroid.reporting.knowledge_report import (
    error_section,
    every_quantity_section,
    quantity_section,
    quantity_table,
    unknown_section,
)
from hydroid.reporting.merged_report import merged_tables
from hydroid.reporting.page import Table, log_names
from hydroid.reporting.parameters_report import parameter_table, short_table
from hydroid.reporting.stated_values import in_heading
from hydroid.search.descent import Ending

FEWER = {name: bounds for name, bounds in MODEL.items() if name != "M2"}


def column(table: Table, name: str) -> list:
    return [row[table.header.index(name)] for row in table.rows]


def with_theta(fit, problem, effects=None, **values: float):
    theta = fit.best.theta.copy()
    for name, value in values.items():
        theta[problem.parameters.names.index(name)] = value
    estimates = fit.estimates | {fit.final: replace(fit.best, theta=theta)}
    return replace(
        fit, estimates=estimates, uncertainty=make_uncertainty(problem, theta, effects)
    )


def test_every_parameter_is_in_the_table():
    problem = make_problem()
    fit = make_fit(problem)
    table = parameter_table(problem.settings, summarise(problem, fit))
    assert column(table, "symbol") == list(MODEL)
    assert column(table, "value") == list(fit.best.theta)
    assert column(table, "from") == pytest.approx(fit.uncertainty.interval[:, 0])
    assert column(table, "to") == pytest.approx(fit.uncertainty.interval[:, 1])
    assert set(table.optional) & set(table.header)


def test_flags_and_findings_name_what_the_data_cannot_tell():
    problem = make_problem(fixed={"D": 100.0})
    effects = (1e-3, 0.0, 0.0, 1e-3)
    fit = make_fit(problem, effects=effects)
    summary = summarise(problem, fit)
    assert column(parameter_table(problem.settings, summary), "source") == [
        "data",
        "fixed",
        "no effect",
        "data",
    ]
    assert Finding("no effect", "note", ("M1",)) in summary.findings
    at = with_theta(fit, problem, effects, K=MODEL["K"][0], M2=MODEL["M2"][1])
    expected = ["at lower bound", "fixed", "no effect", "at upper bound"]
    assert (
        column(parameter_table(problem.settings, summarise(problem, at)), "source")
        == expected
    )
    assert (
        Finding("at bound", "warning", ("M2",), {"side": "upper"})
        in summarise(problem, at).findings
    )


def test_nobody_is_asked_to_widen_what_has_no_larger_value():
    """A share of 1 is the largest there is; a share of 0.5 is a bound that somebody has
    set."""
    problem = make_problem()
    share = {"quantity": "compensation", "joints": (2,), "link": None}
    for upper, kind in ((1.0, "at limit"), (0.5, "at bound")):
        changed = problem.settings.parameters["M1"].changed(
            share | {"bounds": (0.0, upper)}
        )
        other = problem.varied(problem.settings.with_parameters({"M1": changed}))
        fit = with_theta(
            make_fit(other, effects=(1e-3,) * 4), other, (1e-3,) * 4, M1=upper
        )
        kinds = {
            one.kind for one in summarise(other, fit).findings if "M1" in one.subjects
        }
        assert kinds & {"at limit", "at bound"} == {kind}


def test_what_the_logs_move_far_from_its_prior_is_one_finding():
    own, stated = (
        make_problem().settings,
        {"K": (0.25, 0.05), "D": (100.0, 50.0), "M1": (5.0, 1.0)},
    )
    free = {
        n: own.parameters[n].changed({"nominal": v, "sd": sd})
        for n, (v, sd) in stated.items()
    }
    problem, effects = (
        make_problem().varied(own.with_parameters(free)),
        (1e-2, 1e-2, 1e-9, 1e-3),
    )
    fit = with_theta(
        make_fit(problem, effects=effects), problem, effects, K=0.1, D=300.0, M1=9.0
    )
    (finding,) = [
        one for one in summarise(problem, fit).findings if one.kind == "strained prior"
    ]
    assert finding.what.startswith(
        "D (4.0 above) and K (3.0 below) are far from their priors "
    )


def test_how_sure_a_prediction_can_be_is_said_of_each_joint():
    problem = make_problem(outputs=(2, 3))
    summary = summarise(problem, make_fit(problem))
    one = summary.errors["q2"].changed(
        {
            "sensor_deg": 0.3,
            "lasting_deg": 0.0,
            "after_10_s_deg": 0.5,
            "lasts_s": 0.0,
        }
    )
    two = one.changed({"after_10_s_deg": 1.3, "lasts_s": 1.4})
    section = error_section(
        problem.settings, summary.changed({"errors": {"q2": one, "q3": two}})
    )
    assert section is not None
    said = "expected after 10 s: shoulder 0.58 deg and elbow 1.3 deg"
    assert section.answer == said
    table = section.tables["prediction_errors"]
    # how far a joint moves has the noise of both ends
    expected = [np.hypot(0.3, after) for after in (0.5, 1.3)]
    assert table.rows == (
        ("shoulder", "deg", 0.3, pytest.approx(expected[0]), None),
        ("elbow", "deg", 0.3, pytest.approx(expected[1]), 1.4),
    )
    assert error_section(problem.settings, summary.changed({"errors": {}})) is None


def test_what_is_expected_of_a_prediction_stands_beside_what_unseen_logs_show():
    problem = make_problem()
    fit = make_fit(problem)
    summary = summarise(problem, fit)
    (verdict,) = make_record(problem, fit).verdict
    ahead = {verdict_of.THE_FIT: (0.1, 0.2, 0.3, 0.4, 7.25)}
    seen = verdict.changed({"horizons_deg": ahead, "inside_percent": 91.0})
    section = error_section(problem.settings, summary, [seen])
    assert section is not None
    assert "(measured 7.2)" in section.answer
    assert section.answer.endswith("inside the 95 % bands: shoulder 91 %")
    row = section.tables["prediction_errors"].rows[0]
    assert row[4:] == (7.25, row[5], 91.0)


def test_every_quantity_of_a_compared_joint_is_in_the_table():
    problem = make_problem()
    summary = summarise(problem, make_fit(problem))
    made = {
        "a": QuantityEstimate(
            label="dead time",
            joint=2,
            value=0.1,
            unit="s",
            interval=(0.08, None),
            data_share=0.6,
        ),
        "b": QuantityEstimate(
            label="of another", joint=3, value=1.0, unit="s", interval=(0.0, 2.0)
        ),
    }
    section = every_quantity_section(
        problem.settings, summary.changed({"quantities": made})
    )
    table = section.tables["quantities"]
    source = "60 % data, 40 % prior"
    assert table.rows == (("shoulder", "dead time", "0.1", "s", "from 0.08", source),)
    exact = quantity_table(problem.settings, summary.changed({"quantities": made}))
    assert exact.rows == (("shoulder", "dead time", 0.1, "s", 0.08, None, source),)
    none = summary.changed({"quantities": {}})
    assert every_quantity_section(problem.settings, none) is None


def known(label: str, value: float, half: float, **more: float) -> QuantityEstimate:
    ends = (value - half, value + half)
    return QuantityEstimate(
        label=label, joint=2, value=value, unit="", interval=ends, **more
    )


def test_the_card_of_a_joint_has_both_directions_and_how_it_swings():
    """An extrapolated quantity gives way to one that is not, damping is stated however
    wide its interval is, and an interval that is the prior's is called so."""
    problem = make_problem()
    summary = summarise(problem, make_fit(problem))
    made = {
        "shoulder_speed_50_positive": known("50 % up", 10.0, 1.0),
        "shoulder_speed_100_positive": known("100 % up", 20.0, 0.01, reach=60.0),
        "shoulder_speed_100_negative": known("100 % down", 25.0, 1.0, reach=60.0),
        "shoulder_dead_time_positive": known("late up", 0.1, 0.02),
        "shoulder_dead_time_negative": known("late down", 0.1, 0.01, data_share=0.05),
        "shoulder_gain_positive": known("vague", 1.0, 0.9),
        "shoulder_damping_ratio": known("damping", 0.1, 0.09),
    }
    section = quantity_section(problem.settings, summary.changed({"quantities": made}))
    assert section is not None
    rows = section.cards["known_shoulder"].rows
    assert [(row[0], row[3]) for row in rows] == [
        ("50 % up", "± 10 %"),
        ("100 % down (extrapolated: the logs reach 60 %)", "± 4 %"),
        ("late down", "± 10 % (95 % prior)"),
        ("damping", "0.010 to 0.19"),
    ]


def test_a_mass_that_is_held_at_another_value_than_the_arm_s_is_said():
    problem = make_problem(fixed={"M1": 9.0})
    summary = summarise(problem, make_fit(problem))
    said = unknown_section(problem.settings, summary).points[-1]
    assert said.startswith(
        "This fit holds the mass (link1: M1) at 9 kg; the arm's file"
    )
    own = make_problem(fixed={"M1": 4.6})
    assert not [
        point
        for point in unknown_section(own.settings, summary).points
        if "holds" in point
    ]


def test_what_is_left_of_an_error_and_lasts_is_a_finding():
    """Innovations of a second or so, where they should be white."""
    problem = make_problem(samples=3000)
    fit = make_fit(problem)
    assert "error lasts" not in {one.kind for one in summarise(problem, fit).findings}
    row = ar1(np.random.default_rng(1), len(problem.measured), np.exp(-0.01), 1.0)
    known = replace(fit.uncertainty, innovations=row)
    summary = summarise(problem, replace(fit, uncertainty=known))
    (finding,) = [one for one in summary.findings if one.kind == "error lasts"]
    assert finding.level == "note"
    time = summary.errors["q2"].lasts_s
    assert time == pytest.approx(1.0, rel=0.5)
    words = f"Part of the shoulder's error lasts {time:.2g} s, so it is the model's and not the sensor's."
    assert finding.what == words


def test_runs_of_several_seeds_have_no_value_where_there_is_none():
    """One seed has led to a further term, and in another the joint diverged."""
    problem, more = make_problem(parameters=FEWER), make_problem()
    first, second = (
        make_record(problem, make_fit(problem)),
        make_record(more, make_fit(more), folder="TWO"),
    )
    verdict = [one.changed({"fitted_deg": None}) for one in second.verdict]
    good = replace(
        first, summary=first.summary.changed({"verdict": first.verdict, "rms_deg": 0.1})
    )
    bad = replace(
        second, summary=second.summary.changed({"verdict": verdict, "rms_deg": 0.2})
    )
    tables = merged_tables([bad, good])
    assert [column(tables["runs"], name) for name in ("run", "M2 [kg]")] == [
        ["RUN", "TWO"],
        [None, bad.summary.values["M2"]],
    ]
    error = first.verdict[0].fitted_deg
    assert column(tables["runs"], "error of shoulder [deg]") == [error, None]
    spread = {row[0]: row[2:5] for row in tables["spread"].rows}
    assert spread["error of shoulder"] == (error, error, error)
    assert spread["M2"] == (bad.summary.values["M2"],) * 3
    nowhere = merged_tables([bad])["spread"].rows[0]
    assert nowhere[:3] == ("error of shoulder", "deg", None)


@pytest.mark.parametrize(
    "sources",
    [
        ["x/a.csv", "y/a.csv", "a.csv"],
        ["a.csv (2)", "b/a.csv", "a.csv"],
        ["n\n\x01.csv"],
        ["W" * 300],
    ],
)
def test_names_of_logs_are_different_short_and_printable(sources: list[str]):
    names = log_names(sources)
    assert len({*names.values()}) == len(sources)
    assert all(name.isprintable() and len(name) <= 50 for name in names.values())


@pytest.mark.parametrize("ending", [Ending.ITERATIONS, Ending.TIME])
def test_a_fit_whose_time_was_up_gives_no_advice_that_holds_only_of_an_optimum(
    monkeypatch: pytest.MonkeyPatch, ending: Ending
) -> None:
    lagging = [Finding("behind nine numbers", "warning", ("shoulder",))]
    monkeypatch.setattr(verdict_of, "behind", lambda *_: lagging)
    problem = make_problem()
    fit = make_fit(problem)
    stopped = replace(fit.refinements["refined"], ending=ending)
    fit = replace(fit, refinements={"refined": stopped}, ends={0: (1.0, 90.0)})
    found = fit_result(problem, fit, Path("RUN"))
    kinds = {finding.kind for finding in found.summary.findings}
    is_up = ending is Ending.TIME
    assert kinds.isdisjoint(OF_OPTIMUM) == is_up
    assert {"behind nine numbers", "several optima"}.isdisjoint(kinds) == is_up
    # the way on is said once
    said = " ".join(map(str, found.lines))
    assert said.count("--resume") == is_up
    assert said.count("time was up") == is_up
    assert "The time for the fit was up" not in said


def test_where_logs_disagree_intervals_by_log_stand_first_and_are_the_heading_s():
    problem = make_problem()
    one = summarise(problem, make_fit(problem)).changed(
        {"left_out_deg": {"q2": (1.0, 2.0)}}
    )
    disagree = one.changed({"findings": (Finding("logs disagree", "warning", ("K",)),)})
    orders = {False: ("interval", "by log"), True: ("by log", "interval")}
    for summary, is_first in ((one, False), (disagree, True)):
        header = short_table(problem.settings, summary).header
        assert header[-3:-1] == orders[is_first]
        header = parameter_table(problem.settings, summary).header
        assert (header.index("by log from") < header.index("from")) == is_first
    known = {"value": 40.0, "interval": (38.0, 42.0), "interval_by_log": (30.0, 50.0)}
    wide = one.estimate["K"].changed(known)
    assert in_heading(one, wide) == "40 ± 2"
    assert in_heading(disagree, wide, "%") == "40 ± 10 %"


def test_the_settings_hold_what_no_parameter_states():
    settings = load_settings(
        "fit-hyd", {"hydraulics.pump_flow": 90.0, "hydraulics.bulk_modulus": 9e3}
    )
    rows = {row[0]: row[1:] for row in held_table(settings).rows}
    assert rows["largest flow of the pump"] == (90.0, "L/min", "settings")
    assert rows["supply pressure"][2] == "default"
    # what is off, and what is a parameter, is not among them
    assert "dead band of the pilot stage" not in rows
    assert "transport delay of the command" not in rows
