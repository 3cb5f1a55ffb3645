"""The numbers and words of a fit's tables are the fit's."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import MODEL, make_fit, make_problem, make_uncertainty

from hydroid.findings import Finding
from hydroid.fitting.findings import fit_findings
from hydroid.fitting.validation import error_indices
from hydroid.posterior.directions import identifiability
from hydroid.report.fit_tables import objective_table, parameter_table
from hydroid.report.page import log_names
from hydroid.report.phrases import parameter_advice
from hydroid.report.responses import joint_responses
from hydroid.report.spread import spread_table
from hydroid.report.table import Table
from hydroid.report.uncertainty_report import UncertaintyStudy, interval_table
from hydroid.report.validation_report import Validation, validation_page
from hydroid.run.collection import RunEstimate


def column(table: Table, name: str) -> list:
    return [row[table.header.index(name)] for row in table.rows]


def with_theta(fit, problem, effects=None, **values: float):
    theta = fit.best.theta.copy()
    for name, value in values.items():
        theta[problem.parameters.names.index(name)] = value
    estimates = fit.estimates | {fit.final: replace(fit.best, theta=theta)}
    return replace(fit, estimates=estimates, uncertainty=make_uncertainty(problem, theta, effects))


def test_every_estimate_of_every_parameter_is_in_the_table():
    problem = make_problem()
    fit = make_fit(problem)
    table = parameter_table(problem, fit)
    assert column(table, "name") == list(MODEL)
    for name, header in {"average": "search (average)", "best": "best", "refined": "refined"}.items():
        assert column(table, header) == list(fit.estimates[name].theta)
    assert column(table, "effect [deg]") == pytest.approx(np.degrees(fit.effects))
    assert column(table, "from") == pytest.approx(fit.uncertainty.interval[:, 0])
    assert column(table, "to") == pytest.approx(fit.uncertainty.interval[:, 1])
    assert set(table.optional) < set(table.header)


def test_flags_name_what_the_data_cannot_tell():
    problem = make_problem(fixed={"D": 100.0})
    effects = (1e-3, 0.0, 0.0, 1e-3)
    fit = make_fit(problem, effects=effects)
    low, high = MODEL["K"]
    assert column(parameter_table(problem, fit), "flag") == ["", "fixed", "no effect", ""]
    at = with_theta(fit, problem, effects, K=low + 1e-4 * (high - low), M2=MODEL["M2"][1])
    expected = ["at lower bound", "fixed", "no effect", "at upper bound"]
    assert column(parameter_table(problem, at), "flag") == expected
    off = with_theta(fit, problem, effects, K=low + 2e-3 * (high - low))
    assert column(parameter_table(problem, off), "flag")[0] == ""
    assert any(sentence.startswith("M1: no effect") for sentence in parameter_advice(problem, fit))
    assert Finding("at bound", "warning", ("M2",), {"side": "upper"}) in fit_findings(problem, at)
    assert not fit_findings(problem, replace(off, estimates={"refined": off.best}))


def test_errors_are_those_of_the_responses():
    problem = make_problem(("a.csv", "b.csv"), outputs=(2, 3))
    fit = make_fit(problem)
    table = objective_table(problem, fit)
    assert len(table.rows) == len(fit.estimates) * (4 + 1)
    everything = [row for row in table.rows if row[1] == "all"]
    for row, estimate in zip(everything, fit.estimates.values(), strict=True):
        assert row[4] == pytest.approx(np.degrees(estimate.rms))
        assert row[-1] == pytest.approx(np.degrees(estimate.overall))
        assert row[5] == pytest.approx(row[-1])  # the norm is the largest error


def test_the_fit_of_all_joints_measures_each_about_its_own_mean():
    problem = make_problem(("a.csv", "b.csv"), outputs=(2, 3))
    fit = make_fit(problem, names=("best",))
    *_, everything = objective_table(problem, fit).rows
    error = spread = 0.0
    for response in joint_responses(problem, fit):
        error += np.sum((response.measured - response.simulated["search (best)"]) ** 2)
        spread += np.sum((response.measured - np.mean(response.measured)) ** 2)
    assert everything[6] == pytest.approx(100 * (1 - np.sqrt(error / spread)))


def test_a_joint_that_moves_by_rounding_has_no_fit():
    log = make_problem().logs[0]
    rest = 0.3 + 1e-16 * np.arange(len(log.time))
    indices = {2: error_indices(rest, rest + 0.1)}
    table = validation_page([Validation("ga", log, rest[:, None] + 0.1, indices)]).tables["validation"]
    assert "| – |" in table.markdown()


def test_a_relative_objective_has_no_unit():
    problem = make_problem(relative=True, norm=2)
    fit = make_fit(problem)
    overall = [e.overall for e in fit.estimates.values()]
    assert column(objective_table(problem, fit), "objective [-]") == overall


def test_joint_responses_cut_the_long_row_apart_again():
    problem = make_problem(("a.csv", "b.csv", "c.csv"), outputs=(2, 5))
    records = joint_responses(problem, make_fit(problem))
    assert np.array_equal(np.concatenate([r.measured for r in records]), problem.measured)
    assert [r.joint for r in records] == [2, 5] * 3
    assert all(len(half) == len(r.time) for r in records for half in r.bands.values())


@pytest.mark.parametrize(
    "sources",
    [["x/a.csv", "y/a.csv", "a.csv"], ["a.csv (2)", "b/a.csv", "a.csv"], ["n\n\x01.csv"], ["W" * 300]],
)
def test_names_of_logs_are_different_short_and_printable(sources: list[str]):
    log = make_problem().logs[0]
    names = log_names([replace(log, source=source) for source in sources])
    assert len(set(names)) == len(sources)
    assert all(name.isprintable() and len(name) <= 50 for name in names)


def test_the_spread_over_runs_is_median_quartiles_and_flags_whatever_the_order():
    problem = make_problem(fixed={"D": 80.0})
    unit = np.array([[1.0, 0.3, 0.0], [1.0, 0.3, 0.4], [1.0, 0.5, 0.4]])
    theta = problem.parameters.from_unit(unit)
    runs = [RunEstimate(seed, t, 0.01 * seed) for seed, t in enumerate(theta)]
    table = spread_table(problem.parameters, runs, ["M1"], "refined")
    assert column(table, "median")[:4] == pytest.approx(np.median(theta, axis=0))
    assert column(table, "lowest")[:4] == list(theta.min(axis=0))
    assert column(table, "highest")[-1] == pytest.approx(np.degrees(0.02))
    bounds = ["at upper bound in 3 of 3 runs", "fixed", "no effect", "at lower bound in 1 of 3 runs", ""]
    assert column(table, "flag") == bounds
    assert spread_table(problem.parameters, runs[::-1], ["M1"], "refined").rows == table.rows


@pytest.mark.parametrize("refits", [5, 200])
def test_a_bootstrap_says_its_size_and_why_it_gives_no_interval(refits: int):
    problem = make_problem(fixed={"D": 100.0})
    uncertainty = make_uncertainty(problem, make_fit(problem).best.theta, (1e-3, 0.0, 0.0, 1e-3))
    rng = np.random.default_rng(0)
    drawn = uncertainty.theta * rng.uniform(0.9, 1.1, (refits, 4))
    study = UncertaintyStudy(problem, "t", uncertainty, identifiability(problem, uncertainty), refits=drawn)
    table = interval_table(study)
    low = column(table, "bootstrap from")
    assert low[0] == pytest.approx(np.quantile(drawn[:, 0], 0.025))
    assert low[1:3] == [None, -np.inf]  # fixed; no effect, shown as a dash
    assert f"{refits} refits" in table.note
    assert ("too few" in table.note) == (refits == 5)
