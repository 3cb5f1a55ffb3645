"""An engine that is throttled, and oil that warms: a fit finds what they do, predicts
other logs by it, and claims nothing where they do not vary."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import noisy, simulate_log, step_log
from recovery import NOISE_DEG, assert_recovered, refined

import hydroid
from hydroid.advice.terms import terms
from hydroid.posterior.uncertainty import Flag, uncertainty
from hydroid.problem.problem import Problem

DUTIES = [60, -40, 90, -80, 40, 0, -30, 70, -60, 30]
OTHERS = [-50, 80, 30, -90, 70, -60, 0, 90, -30, -70]
VALVE = {
    "A": {"quantity": "opening_a", "nominal": 0.3, "within": 2},
    "B": {"quantity": "opening_b", "nominal": 0.3, "within": 2},
}
ENGINE = {
    "e": {"quantity": "engine_exponent", "nominal": 0, "sd": 0.5, "bounds": [0, 2]}
}
OIL = {"k": {"quantity": "temperature_effect", "nominal": 0, "sd": 2}}
TRUTH = {"A": 0.35, "B": 0.28, "e": 0.7, "k": 1.2}
IDLE, FULL = 0.5, 1.3
"""throttle of an engine, over its reference"""


def settings_of(rows, model="quasi-static", **changes):
    """The shoulder under both columns, with known mechanics."""
    known = {
        "D": {"quantity": "damping", "fixed": 231.8},
        "S": {"quantity": "stiffness", "fixed": 53.4},
    }
    how = {
        "parameters": known
        | {name: one | {"joints": [2]} for name, one in rows.items()},
        "log.engine_speed": {"column": "n", "reference": 1800.0},
        "log.oil_temperature": {"column": "T", "reference": 45.0},
        "hydraulics.substeps": 5,
        "simulation.threads": 1,
        "simulation.model": model,
    }
    return hydroid.load_settings("article-hyd", how | changes)


def log_of(settings, levels, seed, *, engine=(IDLE, FULL), warmer=(-15.0, 15.0)):
    """A log in which engine and oil go from one value to another, and back; its angles
    are the truth's, with noise."""
    log = step_log(settings.arm.pose("study"), levels)
    there = 0.5 - 0.5 * np.cos(np.linspace(0.0, 5.0 + seed, len(log.time)))
    conditions = [low + (high - low) * there for low, high in (engine, warmer)]
    log = replace(log, conditions=np.stack(conditions, axis=1))
    truth = {name: TRUTH[name] for name in TRUTH if name in settings.parameters}
    return noisy(simulate_log(settings, log, truth), NOISE_DEG, seed)


def fitted(settings, log):
    problem = Problem(settings, [log])
    return problem, refined(problem, problem.parameters.start)


def rms(settings, log, theta):
    """Error of a log [deg]."""
    own = Problem(settings, [log])
    return float(np.degrees(own.rms(own.output_errors(theta[None]))[0]))


@pytest.mark.parametrize("model", ["quasi-static", "dynamic"])
def test_the_effects_are_recovered_and_predict_other_logs(model):
    settings = settings_of(VALVE | ENGINE | OIL, model)
    log, unseen = (
        log_of(settings, levels, k) for k, levels in enumerate((DUTIES, OTHERS))
    )
    problem, theta = fitted(settings, log)
    assert_recovered(uncertainty(problem, theta), settings, TRUTH)
    without = settings_of(VALVE, model)
    _, alone = fitted(without, log)
    assert rms(settings, unseen, theta) < 1.2 * NOISE_DEG
    assert rms(without, unseen, alone) > 20 * rms(settings, unseen, theta)


@pytest.mark.parametrize("engine", [1.0, 0.8])
def test_an_engine_that_turns_evenly_tells_nothing_and_nothing_is_claimed(engine):
    settings = settings_of(VALVE | ENGINE)
    log = log_of(settings, DUTIES, 0, engine=(engine, engine))
    problem, theta = fitted(settings, log)
    known = dict(
        zip(problem.parameters.names, uncertainty(problem, theta).status, strict=True)
    )
    assert known["e"].flag in (Flag.NO_EFFECT, Flag.UNIDENTIFIABLE)
    assert known["A"].flag is Flag.IDENTIFIABLE or engine != 1.0
    if engine == 1.0:
        assert problem.parameters.mapping(theta)["e"] == 0.0


def test_what_varies_is_a_term_of_the_model():
    settings = settings_of(VALVE)
    log = log_of(settings, DUTIES, 0)
    problem = Problem(settings, [log])
    named = {one.name for one in terms(problem, problem.parameters.start)}
    assert {"engine_exponent", "temperature_effect"} <= named
    steady = log_of(settings, DUTIES, 0, warmer=(1.0, 2.0))
    problem = Problem(settings, [steady])
    named = {one.name for one in terms(problem, problem.parameters.start)}
    assert "engine_exponent" in named
    assert "temperature_effect" not in named
