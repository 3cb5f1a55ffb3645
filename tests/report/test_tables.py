"""What the tables of a fit say is what the fit holds."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import MODEL, make_fit, make_problem, make_uncertainty

from hydroid.fitting.validation import error_indices, pooled_indices
from hydroid.report.channels import channels, log_names
from hydroid.report.table import Table
from hydroid.report.tables import (
    SeedResult,
    ValidationRow,
    objective_table,
    parameter_table,
    pareto_table,
    runs_table,
    validation_table,
)
from hydroid.report.words import cautions, flags


def column(table: Table, name: str) -> list[object]:
    return [row[table.header.index(name)] for row in table.rows]


def with_theta(fit, problem, effects=None, **values: float):
    theta = fit.best.theta.copy()
    for name, value in values.items():
        theta[problem.parameters.names.index(name)] = value
    told = make_uncertainty(problem, theta, effects)
    estimates = fit.estimates | {fit.final: replace(fit.best, theta=theta)}
    return replace(fit, estimates=estimates, uncertainty=told)


def test_every_estimate_of_every_parameter_is_in_the_table():
    problem = make_problem()
    fit = make_fit(problem)
    table = parameter_table(problem, fit)
    assert column(table, "name") == list(MODEL)
    for name, header in {"average": "search (average)", "best": "best", "refined": "refined"}.items():
        assert column(table, header) == list(fit.estimates[name].theta)
    assert column(table, "effect [deg]") == pytest.approx(np.degrees(fit.effects))
    assert "does not prove" in table.note


def test_flags_name_what_the_data_cannot_tell():
    problem = make_problem(fixed={"D": 100.0})
    effects = (1e-3, 0.0, 0.0, 1e-3)
    fit = make_fit(problem, effects=effects)
    low, high = MODEL["K"]
    assert flags(fit) == ("", "fixed", "no effect", "")
    at = with_theta(fit, problem, effects, K=low + 1e-4 * (high - low), M2=MODEL["M2"][1])
    assert flags(at) == (
        "at lower bound",
        "fixed",
        "no effect",
        "at upper bound",
    )
    off = with_theta(fit, problem, effects, K=low + 2e-3 * (high - low))
    assert flags(off)[0] == ""
    assert any(sentence.startswith("M1: no effect") for sentence in cautions(problem, fit))
    assert any("M2 (12.75 kg): at the upper bound" in sentence for sentence in cautions(problem, at))


def test_truth_brings_relative_errors_and_their_sum():
    problem = make_problem()
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    truth = dict(zip(MODEL, fit.best.theta * [1.0, 2.0, 4.0, 1.0], strict=True))
    table = parameter_table(problem, fit, truth)
    assert column(table, "relative error, refined") == pytest.approx([0.0, 0.5, 0.75, 0.0, 1.25, 0.5])
    assert column(table, "name")[-2:] == ["sum", "sum without M1"]
    assert all(len(row) == len(table.header) for row in table.rows)


def test_truth_may_know_only_some_parameters():
    problem = make_problem()
    fit = make_fit(problem)
    table = parameter_table(problem, fit, {"K": float(fit.best.theta[0]) * 2})
    assert column(table, "relative error, refined") == pytest.approx([0.5, None, None, None, 0.5])


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
    for c in channels(problem):
        error += np.sum((c.measured - c.simulated(fit.best.responses)) ** 2)
        spread += np.sum((c.measured - np.mean(c.measured)) ** 2)
    assert everything[6] == pytest.approx(100 * (1 - np.sqrt(error / spread)))


def test_the_fit_of_all_joints_does_not_change_with_where_they_stand():
    rng = np.random.default_rng(2)
    pairs = [(y, y + 0.1 * rng.normal(size=50)) for y in rng.normal(size=(3, 50))]
    moved = [(y + shift, s + shift) for (y, s), shift in zip(pairs, (0.0, 5.0, -70.0), strict=True)]
    assert pooled_indices(moved).fit == pytest.approx(pooled_indices(pairs).fit)


def test_a_joint_that_moves_by_rounding_has_no_fit():
    rest = 0.3 + 1e-16 * np.arange(1000)
    assert np.ptp(rest) > 0
    for indices in (error_indices(rest, rest + 0.1), pooled_indices([(rest, rest + 0.1)] * 2)):
        assert np.isnan(indices.fit)
    table = validation_table([ValidationRow("ga", "a.csv", 2, error_indices(rest, rest + 0.1))])
    assert "| – |" in table.markdown()


def test_a_relative_objective_has_no_unit():
    problem = make_problem(relative=True, norm=2)
    fit = make_fit(problem)
    assert column(objective_table(problem, fit), "objective [-]") == [
        e.overall for e in fit.estimates.values()
    ]
    assert "relative rms error" in pareto_table(problem, fit).note


def test_pareto_table_holds_the_front_best_first():
    problem = make_problem()
    fit = make_fit(problem)
    table = pareto_table(problem, fit)
    overall = column(table, "whole record")
    assert overall == sorted(overall)
    assert overall == pytest.approx(np.degrees(np.sort(fit.front[1].overall)))
    assert {row[0] for row in table.rows} == set(fit.front[0][:, 0])


def test_channels_cut_the_long_row_apart_again():
    problem = make_problem(("a.csv", "b.csv", "c.csv"), outputs=(2, 5))
    known = channels(problem)
    assert np.array_equal(np.concatenate([c.measured for c in known]), problem.measured)
    numbers = [number for c in known for number, _, _ in c.segments]
    assert numbers == list(range(1, len(problem.bounds) + 1))
    assert all(c.segments[0][1] == 0 and c.segments[-1][2] == len(c.time) for c in known)


@pytest.mark.parametrize(
    "sources",
    [["x/a.csv", "y/a.csv", "a.csv"], ["a.csv (2)", "b/a.csv", "a.csv"], ["n\n\x01.csv"], ["W" * 300]],
)
def test_names_of_logs_are_different_short_and_printable(sources: list[str]):
    names = log_names(sources)
    assert len(set(names)) == len(sources)
    assert all(name.isprintable() and len(name) <= 50 for name in names)


def test_validation_has_a_row_a_fit_log_and_joint():
    indices = error_indices(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.9]))
    table = validation_table(
        [ValidationRow("ga", "a.csv", 2, indices), ValidationRow("b|c", "a.csv", 3, indices)]
    )
    assert column(table, "joint") == [2, 3]
    assert column(table, "largest [deg]") == pytest.approx([np.degrees(0.1)] * 2)


def test_runs_give_median_and_spread_whatever_the_order():
    problem = make_problem()
    theta = problem.parameters.from_unit(np.random.default_rng(1).uniform(0, 1, (9, 4)))
    results = [SeedResult(seed, t, 0.01 * seed) for seed, t in enumerate(theta)]
    table = runs_table(problem.parameters, results)
    assert column(table, "median")[:4] == pytest.approx(np.median(theta, axis=0))
    assert column(table, "lowest")[:4] == list(theta.min(axis=0))
    assert column(table, "highest")[-1] == pytest.approx(np.degrees(0.08))
    assert runs_table(problem.parameters, results[::-1]).rows == table.rows


def test_runs_keep_the_flags():
    problem = make_problem(fixed={"D": 80.0})
    theta = problem.parameters.from_unit(np.array([[1.0, 0.3, 0.0], [1.0, 0.3, 0.4], [1.0, 0.5, 0.4]]))
    table = runs_table(
        problem.parameters, [SeedResult(s, t, 0.1) for s, t in enumerate(theta)], ignore=["M1"]
    )
    assert column(table, "flag") == [
        "at upper bound in 3 of 3 runs",
        "fixed",
        "no effect",
        "at lower bound in 1 of 3 runs",
        "",
    ]


def test_runs_sum_relative_errors_seed_by_seed():
    problem = make_problem()
    truth = dict.fromkeys(MODEL, 2.0)
    results = [SeedResult(s, np.array([2.0, 2.0 + s, 9.0, 2.0]), 0.0) for s in range(3)]
    table = runs_table(problem.parameters, results, truth, ignore=["M1"])
    last = dict(zip(table.header, table.rows[-1], strict=True))
    assert last["name"] == "sum of relative errors without M1"
    assert (last["lowest"], last["median"], last["highest"]) == pytest.approx((0.0, 0.5, 1.0))
