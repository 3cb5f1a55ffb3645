"""An effect in some logs alone: estimated with all else, and left out of other predictions."""

from dataclasses import replace

import numpy as np
import pytest
from two_joints import PARAMETERS, TRUTH, drive, two_joints

from hydroid.errors import SettingsError
from hydroid.fitting.refinement import refine
from hydroid.identified_model import identified
from hydroid.prediction import predict
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

EFFECT = {"quantity": "dead_band", "joints": [1], "sd": 3}
EFFECTS = {"day_monday": EFFECT | {"logs": "mon_*.csv"}, "day_tuesday": EFFECT | {"logs": "tue_*"}}
DAY = {"day_monday": 2.0, "day_tuesday": -1.5}
LOGS = {"mon_1.csv": 2.0, "tue_1.csv": -1.5, "tue_2.csv": -1.5, "other.csv": 0.0}


def of_days(folder, **own: object) -> FitSettings:
    return two_joints(folder, log={"period_s": 0.05}, parameters=PARAMETERS | EFFECTS | own)


def shifted(folder, shift: float) -> FitSettings:
    band = {"quantity": "dead_band", "joints": [1], "fixed": 20 + shift}
    return two_joints(folder, parameters=PARAMETERS | {"band": band})


def test_effects_of_two_groups_are_recovered(tmp_path):
    pairs = enumerate(LOGS.items())
    logs = [replace(drive(shifted(tmp_path, by), i), source=name) for i, (name, by) in pairs]
    problem = Problem(of_days(tmp_path), logs)
    start = problem.parameters.started(TRUTH)
    theta = problem.parameters.from_unit(refine(problem, start, RefinementSettings(iterations=20)).point)
    values = problem.parameters.mapping(theta)
    assert {name: values[name] for name in DAY} == pytest.approx(DAY, abs=0.1)
    assert np.degrees(problem.rms(problem.output_errors(theta[None])))[0] == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("name", LOGS)
def test_a_log_is_predicted_with_the_effect_of_its_group_alone(tmp_path, name):
    log = replace(drive(two_joints(tmp_path)), source=f"elsewhere/{name}")
    grouped = predict(identified(of_days(tmp_path), TRUTH | DAY, "a fit"), log, (1, 2))
    alone = predict(identified(shifted(tmp_path, LOGS[name]), TRUTH, "a fit"), log, (1, 2))
    np.testing.assert_array_equal(grouped, alone)


def test_an_effect_needs_a_prior(tmp_path):
    wrong = {"day": {"quantity": "dead_band", "joints": [1], "logs": "mon_*.csv", "bounds": [0, 1]}}
    with pytest.raises(SettingsError, match="an effect in some logs needs sd"):
        of_days(tmp_path, **wrong)
