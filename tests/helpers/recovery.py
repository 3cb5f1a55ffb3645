"""Stage 2 with known mechanics, logs that are commands alone, and fits that recover what made a log."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import hydroid
from hydroid.log import Log
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

NOISE_DEG = 0.02


def duties(pose: np.ndarray, levels: Mapping[int, Sequence[float]], dwell: float = 1.0) -> Log:
    """A log without motion: commands [%] from its first sample, each held `dwell` [s], by joint (from 1)."""
    period = 0.01
    length = round(dwell * max(map(len, levels.values())) / period) + 1
    command = np.zeros((length, len(pose)))
    for joint, values in levels.items():
        held = np.repeat(values, round(dwell / period))
        command[: len(held), joint - 1] = held
    time = np.arange(length) * period
    return Log("duties", time, command, np.tile(pose, (length, 1)), period)


def settings_of(parameters: Mapping[str, Mapping[str, object]], **hydraulics: float | None) -> FitSettings:
    """Stage 2 with known mechanics and the given parameters; other settings of the chain by name."""
    known = {
        "D": {"quantity": "damping", "fixed": 231.8},
        "S": {"quantity": "stiffness", "fixed": 53.4},
    }
    changes: dict[str, object] = {f"hydraulics.{name}": value for name, value in hydraulics.items()}
    changes |= {"parameters": known | dict(parameters), "hydraulics.substeps": 5, "simulation.threads": 1}
    return hydroid.load_settings("article-hyd", changes)


def recover(
    settings: FitSettings, logs: Sequence[Log], truth: Mapping[str, float], start: Mapping[str, float]
) -> Uncertainty:
    """Fit logs that the settings simulate with `truth`, noise added, from another start."""
    rng = np.random.default_rng(0)
    measured = [simulate_log(settings, log, truth, "truth") for log in logs]
    noisy = [
        replace(log, angle=log.angle + rng.normal(0, np.radians(NOISE_DEG), log.angle.shape))
        for log in measured
    ]
    # the start pose is known here; its noise is another test's subject
    for log, exact in zip(noisy, measured, strict=True):
        log.angle[0] = exact.angle[0]
    problem = Problem(settings, noisy)
    begin = problem.parameters.vector(start, "start")

    def residuals(unit: np.ndarray) -> np.ndarray:
        return problem.residuals(problem.parameters.from_unit(unit))

    ended = least_squares(problem.parameters.to_unit(begin[None])[0], residuals, RefinementSettings())
    return uncertainty(problem, problem.parameters.from_unit(ended.point[None])[0])


def assert_recovered(found: Uncertainty, settings: FitSettings, truth: Mapping[str, float]) -> None:
    """The truth lies within three standard deviations of each estimate, and these are below a third of it."""
    for name, estimate, deviation in zip(
        settings.parameters, found.theta, found.standard_deviation, strict=True
    ):
        if settings.parameters[name].fixed is None:
            what = f"{name}: {estimate:.5g} ± {deviation:.2g}, truth {truth[name]:.5g}"
            assert abs(estimate - truth[name]) < 3 * deviation, what
            assert deviation < abs(truth[name]) / 3, what
