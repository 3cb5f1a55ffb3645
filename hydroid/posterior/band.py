"""Prediction band: where the samples of a log lie if the model is no worse than on the fitted logs.

A predicted angle errs by the uncertainty of the parameters, by the delta method, by the noise of the
measurement as the fit saw it, and because the start of the log is measured with noise too. Where several logs
were fitted, each of them is predicted without it (`left_out`): an error beyond that of noise and parameters
is the model's, as far as the fit can know it. It is known from as many errors as there are logs, hence
Student's t. What an unseen log shows beyond all this is a further error of the model.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from hydroid.arrays import Array, record, rms
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.linear import start_deviations
from hydroid.posterior.noise import error_level
from hydroid.posterior.posterior import COVERAGE, NORMAL, STEP, Posterior, stored_posterior
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.free_start import start_slopes
from hydroid.problem.problem import Problem
from hydroid.search.axes import differentiate


@record
class Band:
    """The 95 % prediction band of one joint's angle in one log, and the error that was found.

    Attributes:
        noise: standard deviation of the fit's noise [rad].
        half: of the band's width [rad], shape (T,); infinite where the parameters leave the angle open.
        inside: part of the samples whose error lies within it.
        error: rms error [rad].
        expected: rms error that all of this explains [rad].
    """

    noise: float
    half: Array
    inside: float
    error: float
    expected: float


def fitted_bands(problem: Problem, known: Uncertainty, responses: Sequence[Array]) -> list[dict[int, Band]]:
    """Return the bands of the compared joints around responses [rad], (T, K), to the fitted logs."""
    bands: list[dict[int, Band]] = [{} for _ in problem.logs]
    for channel, noise in zip(problem.channels, known.noise, strict=True):
        if channel.quantity == "angle":
            slopes = channel.unfiltered(known.linear.slopes[:, channel.rows])
            sd = known.posterior.sd(slopes) / channel.weight
            error = channel.measured - responses[channel.log][:, channel.column]
            level = error_level(channel, noise)
            bands[channel.log][channel.joint] = _band(known.posterior, level, sd**2, error)
    return bands


def prediction_bands(model: IdentifiedModel, log: Log, response: Array) -> dict[int, Band]:
    """Return the band of each compared joint, numbered from 1, around a response [rad], shape (T, K).

    Empty where the model's values are not those of a fit, which alone knows its covariance and noise.
    """
    known, outputs = stored_posterior(model), model.settings.outputs
    if known is None or model.summary is None:
        return {}
    levels, left_out = model.summary.noise_deg, model.summary.left_out_deg
    if any(f"q{joint}" not in levels for joint in outputs):
        return {}
    problem = Problem(model.settings, [log])

    def angles(theta: Array) -> Array:
        return problem.responses(theta)[0].angle.reshape(len(theta), -1)

    slopes = differentiate(angles, known.box, known.axes(STEP))
    noises = {joint: np.radians(levels[f"q{joint}"]) for joint in outputs}
    start = start_effects(problem, model.theta, noises)
    parts = known.parts(slopes).reshape(-1, *response.shape)
    slopes = slopes.reshape(parts.shape)
    bands: dict[int, Band] = {}
    for column, joint in enumerate(outputs):
        variance = np.sum(parts[:, :, column] ** 2, axis=0)
        if np.mean(variance) > np.mean(np.sum(slopes[:, :, column] ** 2, axis=0)):
            variance = np.full_like(variance, np.inf)  # no better than from parameters known to 100 % each
        noise, error = noises[joint], log.angle[:, joint - 1] - response[:, column]
        unseen = np.radians(left_out.get(f"q{joint}", ()))
        wrong = max(np.mean(unseen**2) - np.mean(variance + noise**2), 0.0) if unseen.size else 0.0
        widened = wrong * float(student.ppf(0.5 + COVERAGE / 2, unseen.size or 1) / NORMAL) ** 2
        variance = variance + np.sum(start[joint] ** 2, axis=0)
        bands[joint] = _band(known, noise, variance, error, wrong, widened)
    return bands


def _band(
    known: Posterior, noise: float, variance: Array, error: Array, wrong: float = 0.0, widened: float = 0.0
) -> Band:
    """Return the band of an error [rad] from the level of the noise, and the variance of the rest, (T,).

    wrong: mean square error of the model on unseen logs. widened: the same, as wide as it is known.
    """
    variance = variance + noise**2
    half = np.sqrt(known.quantile**2 * variance + NORMAL**2 * widened)
    inside = float(np.mean(np.abs(error) <= half))
    return Band(noise, half, inside, rms(error), np.sqrt(np.mean(variance) + wrong))


def start_effects(problem: Problem, theta: Array, levels: dict[int, float]) -> dict[int, Array]:
    """What one standard deviation of each start angle does to each compared angle [rad], (k, T), by joint.

    `levels` [rad] are those of the compared angles' noise, by joint. The problem has one log.
    """
    rows = np.zeros((0, len(problem.measured)))
    for each in start_slopes(problem, theta):
        rows = start_deviations(problem.logs[0], each.joints, levels)[:, None] * each.slopes
    angles = (c for c in problem.channels if c.quantity == "angle")
    return {c.joint: c.unfiltered(rows[:, c.rows]) / c.weight for c in angles}
