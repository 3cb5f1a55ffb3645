"""Stage 2 with known mechanics, and fits that recover what made a log."""

from collections.abc import Mapping, Sequence

import numpy as np
from made_logs import noisy, simulate_log

import hydroid
from hydroid.fitting.refinement import refine_from_afar
from hydroid.fitting.step import Step
from hydroid.fitting.summary import account
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.band import Band, prediction_bands
from hydroid.posterior.error_model import make_likelihood
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.prediction import predict
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

NOISE_DEG = 0.02
STOPPED = np.radians([0, -30, -60, 0, 0, 0, 20])
"""the shoulder at the lower end of its range"""


def settings_of(
    parameters: Mapping[str, Mapping[str, object]], **hydraulics: float | None
) -> FitSettings:
    """Stage 2 with known mechanics and the given parameters; other settings of the
    chain by name."""
    known = {
        "D": {"quantity": "damping", "fixed": 231.8},
        "S": {"quantity": "stiffness", "fixed": 53.4},
    }
    changes: dict[str, object] = {
        f"hydraulics.{name}": value for name, value in hydraulics.items()
    }
    changes |= {
        "parameters": known | dict(parameters),
        "hydraulics.substeps": 5,
        "simulation.threads": 1,
    }
    return hydroid.load_settings("article-hyd", changes)


def recover(
    settings: FitSettings,
    logs: Sequence[Log],
    truth: Mapping[str, float],
    start: Mapping[str, float],
) -> Uncertainty:
    rng = np.random.default_rng(0)
    # the start pose is known here; its noise is another test's subject
    problem = Problem(
        settings,
        [noisy(simulate_log(settings, log, truth), NOISE_DEG, rng) for log in logs],
    )
    start_theta = problem.parameters.vector(start, "start")
    return uncertainty(problem, refined(problem, start_theta, RefinementSettings()))


def refined(
    problem: Problem, start: np.ndarray, how: RefinementSettings | None = None
) -> np.ndarray:
    """Where the refinement of an estimate ends, by default as the settings say, shape
    (P,)."""
    how = how or problem.settings.refinement or RefinementSettings()
    result = refine_from_afar(
        make_likelihood(problem), start, how, lambda *_: None, {}, Step("refined")
    )
    return problem.parameters.from_unit(result.point)


def known(
    problem: Problem, truth: Mapping[str, float], rng: np.random.Generator
) -> Uncertainty:
    """What a refinement knows that starts with free parameters moved by up to 5 % from
    the truth."""
    true = problem.parameters.vector(truth, "truth")
    start = true * np.where(
        problem.parameters.free, rng.uniform(0.95, 1.05, len(true)), 1.0
    )
    return uncertainty(problem, refined(problem, start))


def model_of(problem: Problem, theta: np.ndarray) -> IdentifiedModel:
    """The model of a fit that ended at theta, with what its logs determine."""
    return IdentifiedModel(
        problem.settings, theta, "fit", account(problem, uncertainty(problem, theta))
    )


def bands_in(model: IdentifiedModel, log: Log) -> Mapping[int, Band]:
    """What a model expects of a log, by joint."""
    return prediction_bands(model, log, predict(model, log, model.settings.outputs))


def assert_recovered(
    found: Uncertainty, settings: FitSettings, truth: Mapping[str, float]
) -> None:
    """The truth lies within three standard deviations of each estimate, and these are
    below a third of it."""
    known = zip(settings.parameters, found.theta, found.standard_deviation, strict=True)
    for name, estimate, deviation in known:
        if settings.parameters[name].fixed is None:
            what = f"{name}: {estimate:.5g} ± {deviation:.2g}, truth {truth[name]:.5g}"
            assert abs(estimate - truth[name]) < 3 * deviation, what
            assert deviation < abs(truth[name]) / 3, what
