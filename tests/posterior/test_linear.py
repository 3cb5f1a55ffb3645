"""Sensitivities, held to laws."""

from pathlib import Path

import numpy as np
import pytest
from conftest import TRUTH

from hydroid import load_settings
from hydroid.log import Log
from hydroid.posterior.linear import Linear, linearised
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.reporting.analysis_report import sensitivity_section
from hydroid.reporting.page import Page
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
def effects(problem: Problem) -> Linear:
    return linearised(problem, THETA)


def test_a_slope_is_what_simulate_shows_for_one_percent(problem: Problem, effects: Linear, study_log: Log):
    for name in ("K", "M3"):
        up, down = (
            simulate_log(problem.settings, study_log, TRUTH | {name: f * TRUTH[name]}, "t").angle[:, 1]
            for f in (1.005, 0.995)
        )
        slope = -0.01 * effects.slopes[list(TRUTH).index(name)]
        assert slope == pytest.approx(up - down, abs=1e-3 * np.abs(slope).max())


def test_a_parameter_without_effect_has_a_slope_of_zero(effects: Linear):
    assert effects.slopes.any(axis=1).tolist() == [name != "M1" for name in TRUTH]


def test_sensitivity_of_free_parameters_is_written_in_the_readers_units(study_log: Log, tmp_path: Path):
    held = {f"parameters.{name}.fixed": TRUTH[name] for name in list(TRUTH)[2:]}
    problem = make_problem(study_log, **held)
    result = linearised(problem, THETA)
    assert len(result.slopes) == 2
    files: dict[str, str] = {}
    section = sensitivity_section(problem, result, files)
    write_page(Page("p", "t", "l", (section,), data=files), tmp_path)
    data = np.genfromtxt(tmp_path / "sensitivity_steps_q2.csv", delimiter=",", names=True)
    assert data["K_deg_per_pct"] == pytest.approx(np.degrees(-0.01 * result.slopes[0]))
    assert data["q2_deg"] == pytest.approx(np.degrees(problem.channels[0].measured))
    rms = {row["parameter"]: row["rms per 1 %"] for row in section.more["sensitivity"].records()}
    assert rms["K"] == pytest.approx(np.sqrt(np.mean(data["K_deg_per_pct"] ** 2)))
    (tab,) = section.tabs
    (panel,) = tab.plots[0].draw().panels
    assert [mark.label.partition(" ")[0] for mark in panel.marks] == sorted(
        rms, key=lambda name: rms[name], reverse=True
    )
