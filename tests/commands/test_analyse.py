"""`analyse` at values that are no optimum: a better one is found, and all is about that."""

from dataclasses import replace

import numpy as np
import pytest
from small_fits import TRUTH, steps_of

import hydroid
from hydroid import load_settings
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.problem.problem import Problem

CHANGES = {f"parameters.{name}.fixed": TRUTH[name] for name in TRUTH if name.startswith("M")}


@pytest.fixture(scope="module")
def case() -> tuple[IdentifiedModel, Log]:
    """A log with noise, and a model that is several standard deviations off its optimum."""
    settings = load_settings("article-mech", CHANGES | {"simulation.other_joints": "locked"})
    log = steps_of(settings, TRUTH, {2: [60.0, -80.0]}, noise_deg=0.1)
    off = TRUTH | {"D": 1.04 * TRUTH["D"], "S": 0.97 * TRUTH["S"]}
    return identified(settings, off, "a model that is off"), log


def test_a_better_optimum_is_refined_and_reported(case):
    model, log = case
    study = hydroid.analyse(log, fit=model, profile=["D"], out=None)
    result = study.result
    (moved,) = result.moved
    assert str(moved) in study.page.warnings
    problem = Problem(model.settings, [log])
    before, after = problem.rms(problem.residuals(np.vstack([model.theta, result.uncertainty.theta])))
    assert after < 0.99 * before
    assert np.degrees(after) == pytest.approx(0.1, rel=0.1)
    inside = (result.uncertainty.interval[:3, 0] < [0.2, 231.8, 53.4]) & (
        result.uncertainty.interval[:3, 1] > [0.2, 231.8, 53.4]
    )
    assert inside.all()
    assert not any(profile.better_optimum for profile in result.profiles)
    # from there nothing better is found
    again = hydroid.analyse(log, fit=replace(model, theta=result.uncertainty.theta), profile="D", out=None)
    assert again.result.moved == ()
    np.testing.assert_array_equal(again.result.uncertainty.theta, result.uncertainty.theta)
