"""The numbers and words of a fit's tables are the fit's."""

from dataclasses import replace

import pytest
from report_fits import MODEL, make_fit, make_problem, make_record, make_uncertainty

from hydroid.estimate import JointVerdict
from hydroid.findings import Finding
from hydroid.fitting.summary import summarise
from hydroid.reporting.page import Table, log_names
from hydroid.reporting.parameters_report import fitted_errors, merged_tables, parameter_table
from hydroid.run.record import Record


def column(table: Table, name: str) -> list:
    return [row[table.header.index(name)] for row in table.rows]


def with_theta(fit, problem, effects=None, **values: float):
    theta = fit.best.theta.copy()
    for name, value in values.items():
        theta[problem.parameters.names.index(name)] = value
    estimates = fit.estimates | {fit.final: replace(fit.best, theta=theta)}
    return replace(fit, estimates=estimates, uncertainty=make_uncertainty(problem, theta, effects))


def test_every_parameter_is_in_the_table():
    problem = make_problem()
    fit = make_fit(problem)
    table = parameter_table(problem.settings, summarise(problem, fit))
    assert column(table, "name") == list(MODEL)
    assert column(table, "value") == list(fit.best.theta)
    assert column(table, "from") == pytest.approx(fit.uncertainty.interval[:, 0])
    assert column(table, "to") == pytest.approx(fit.uncertainty.interval[:, 1])
    assert set(table.optional) & set(table.header)


def test_flags_and_findings_name_what_the_data_cannot_tell():
    problem = make_problem(fixed={"D": 100.0})
    effects = (1e-3, 0.0, 0.0, 1e-3)
    fit = make_fit(problem, effects=effects)
    summary = summarise(problem, fit)
    assert column(parameter_table(problem.settings, summary), "flag") == ["", "fixed", "no effect", ""]
    assert Finding("no effect", "note", ("M1",)) in summary.findings
    at = with_theta(fit, problem, effects, K=MODEL["K"][0], M2=MODEL["M2"][1])
    expected = ["at lower bound", "fixed", "no effect", "at upper bound"]
    assert column(parameter_table(problem.settings, summarise(problem, at)), "flag") == expected
    assert Finding("at bound", "warning", ("M2",), {"side": "upper"}) in summarise(problem, at).findings


def test_what_the_logs_move_far_from_its_prior_is_one_finding():
    own, stated = make_problem().settings, {"K": (0.25, 0.05), "D": (100.0, 50.0), "M1": (5.0, 1.0)}
    free = {n: own.parameters[n].changed({"nominal": v, "sd": sd}) for n, (v, sd) in stated.items()}
    problem, effects = make_problem().varied(own.with_parameters(free)), (1e-2, 1e-2, 1e-9, 1e-3)
    fit = with_theta(make_fit(problem, effects=effects), problem, effects, K=0.1, D=300.0, M1=9.0)
    (finding,) = [one for one in summarise(problem, fit).findings if one.kind == "strained prior"]
    assert finding.what.endswith("in standard deviations: D (4.0 above) and K (3.0 below).")


@pytest.mark.parametrize(
    "sources",
    [["x/a.csv", "y/a.csv", "a.csv"], ["a.csv (2)", "b/a.csv", "a.csv"], ["n\n\x01.csv"], ["W" * 300]],
)
def test_names_of_logs_are_different_short_and_printable(sources: list[str]):
    names = log_names(sources)
    assert len({*names.values()}) == len(sources)
    assert all(name.isprintable() and len(name) <= 50 for name in names.values())


def test_a_run_that_diverged_has_no_error_and_the_others_have_a_spread():
    problem = make_problem()
    whole = make_record(problem, make_fit(problem))
    runs: list[Record] = []
    for error in 0.7, None:
        verdict = JointVerdict(joint=2, name="shoulder", verdict="", fitted_deg=error, tolerance_deg=1.0)
        runs.append(replace(whole, summary=whole.summary.changed({"verdict": (verdict,)})))
    assert [fitted_errors(run) for run in runs] == [[0.7], [None]]
    tables = merged_tables(runs)
    assert [row[2] for row in tables["runs"].rows] == [0.7, None]
    assert tables["spread"].rows[0][2:7] == (0.7,) * 5
