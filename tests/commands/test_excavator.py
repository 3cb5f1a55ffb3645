"""The shipped example of a real machine: its logs, arm and config work together."""

import logging
from pathlib import Path

import numpy as np
import pytest

import hydroid
from hydroid.fitting.multistart import lone_joints

FOLDER = Path(__file__).parents[2] / "examples" / "excavator"
LOGS = sorted(FOLDER.glob("*_*.csv"))


@pytest.fixture(scope="module")
def settings():
    return hydroid.load_settings(FOLDER / "fit.yaml")


def test_all_logs_are_read_without_repair(settings, caplog: pytest.LogCaptureFixture):
    caplog.set_level(logging.CRITICAL)
    assert len(LOGS) == 18
    logs = hydroid.read_logs(LOGS, settings)
    assert all(log.driven.all() and log.measured.all() for log in logs)
    assert {log.period for log in logs} == {0.05}


def test_a_short_fit_of_two_logs_needs_no_stage_1(tmp_path: Path):
    """What `make excavator` does, on two logs and for a few steps."""
    quick = {
        "search.multistart.iterations": 2,
        "refinement.iterations": 2,
        "parameters": {
            "open_A": {"quantity": "opening_a", "each": True, "within": 4},
            "open_B": {"quantity": "opening_b", "each": True, "within": 4},
            "M_boom": {"quantity": "mass", "link": "boom", "within": 1.5},
        },
    }
    runs = hydroid.fit_hyd(LOGS[6:8], out=tmp_path / "run", config=FOLDER / "fit.yaml", set=quick)
    (result,) = runs.results
    assert lone_joints(result.problem) == (1, 2, 3, 4)
    theta = np.array([result.problem.parameters.start, result.fit.best.theta])
    begun, ended = result.problem.rms(result.problem.residuals(theta))
    assert ended < begun / 2
    quick |= {"search.multistart.iterations": 1, "refinement": None}
    again = hydroid.fit_hyd(
        LOGS[6:7], out=tmp_path / "b", config=FOLDER / "fit.yaml", set=quick, start=tmp_path / "run"
    )
    np.testing.assert_allclose(again.results[0].problem.parameters.start, result.fit.best.theta, rtol=1e-4)
