"""Sensitivities and error surfaces, held to laws."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import TRUTH

from hydroid import load_settings
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.posterior.sweep import Sweep, surface, sweep
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.reporting.analysis_report import analysis_page
from hydroid.reporting.page_file import write_page

THETA = np.array(list(TRUTH.values()))


def make_problem(log: Log, **changes: object) -> Problem:
    """Noise-free data at the truth."""
    settings = load_settings("article-mech", {"simulation.other_joints": "locked"} | changes)
    return Problem(settings, [simulate_log(settings, log, TRUTH, "truth")])


@pytest.fixture(scope="module")
def problem(study_log: Log) -> Problem:
    return make_problem(study_log)


@pytest.fixture(scope="module")
def swept(problem: Problem) -> Sweep:
    return sweep(problem, THETA)


def test_a_slope_is_what_simulate_shows_for_one_percent(problem: Problem, swept: Sweep, study_log: Log):
    for name in ("K", "M3"):
        up, down = (
            simulate_log(problem.settings, study_log, TRUTH | {name: f * TRUTH[name]}, "t").angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = swept.slopes[0][list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def test_a_parameter_without_effect_moves_nothing_within_its_bounds(problem: Problem, swept: Sweep):
    idle = list(TRUTH).index("M1")
    assert np.abs(swept.slopes[0][idle]).max() < 1e-9 * np.abs(swept.slopes[0]).max()
    assert np.ptp(swept.responses[0][idle], axis=0).max() < 1e-9
    assert swept.responses[0].shape == (9, 20, len(problem.logs[0].time))


def test_sensitivity_of_free_parameters_is_written_in_the_readers_units(study_log: Log, tmp_path: Path):
    held = {f"parameters.{name}.fixed": TRUTH[name] for name in list(TRUTH)[2:]}
    problem = make_problem(study_log, **held)
    result = sweep(problem, THETA)
    assert result.free.tolist() == [0, 1]
    page = analysis_page(problem, THETA, sweep=result)
    write_page(page, tmp_path)
    data = np.genfromtxt(tmp_path / "sensitivity_steps_q2.csv", delimiter=",", names=True)
    assert data["K_deg_per_pct"] == pytest.approx(np.degrees(result.slopes[0][0]))
    assert data["q2_deg"] == pytest.approx(np.degrees(problem.channels[0].measured))
    rms = {row["parameter"]: row["rms per 1 %"] for row in page.tables["sensitivity"].records()}
    assert rms["K"] == pytest.approx(np.sqrt(np.mean(data["K_deg_per_pct"] ** 2)))
    (tab,) = page.sections[0].tabs
    (panel,) = tab.plots[0].draw().panels
    assert [mark.label.partition(" ")[0] for mark in panel.marks] == sorted(rms, key=lambda name: -rms[name])


def test_the_surface_of_noise_free_data_is_lowest_at_the_truth(problem: Problem):
    result = surface(problem, THETA, ("K", "D"), 5, 0.2)
    assert result.lowest == pytest.approx((0.2, 231.8, 0.0), abs=1e-9)
    assert result.estimate_error == pytest.approx(0.0, abs=1e-9)
    # each point is the objective there, whatever batch it was in
    theta = THETA.copy()
    theta[0], theta[1] = result.values[0][0], result.values[1][3]
    assert result.error[0, 3] == problem.evaluate(theta[None]).overall[0]
    error = result.error.copy()
    error[0, 0] = np.inf  # infeasible points are not the lowest
    assert np.isfinite(replace(result, error=error).lowest[2])


@pytest.mark.parametrize(
    ("names", "message"),
    [(("K", "X"), "no parameter 'X'"), (("K", "K"), "stands there twice"), (("K", "M2"), "M2 has no range")],
)
def test_a_surface_that_cannot_be_drawn_is_refused(study_log: Log, names: tuple[str, str], message: str):
    problem = make_problem(
        study_log, **{"parameters.M2": {"quantity": "mass", "link": "link2", "fixed": 5.1}}
    )
    with pytest.raises(SettingsError, match=message):
        surface(problem, THETA, names, 3, None)
