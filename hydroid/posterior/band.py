"""Prediction band: where the samples of a log lie if the model is no worse than on the
fitted logs.

A predicted angle errs by the uncertainty of the parameters, by the delta method, by the
sensor's noise, and by the drift of the error model, which grows from the start on with
time and way. Where several logs were fitted, each of them is predicted without it
(`left_out`): an error beyond all this is the model's, as far as the fit can know it. It
is known from as many errors as there are logs, hence Student's t. What an unseen log
shows beyond all this is a further error of the model.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from hydroid.arrays import Array, record, rms
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.error_model import ErrorModel, travelled
from hydroid.posterior.posterior import (
    COVERAGE,
    NORMAL,
    STEP,
    Posterior,
    stored_posterior,
)
from hydroid.posterior.stored_errors import stored_error_model
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.axes import differentiate


@record
class Band:
    """The 95 % prediction band of one joint's angle in one log, and the error that was
    found.

    Attributes:
        noise: standard deviation of the sensor's noise [rad].
        half: of the band's width [rad], shape (T,); infinite where the parameters leave
            the angle open.
        inside: part of the samples whose error lies within it.
        error: rms error [rad].
        expected: rms error that all of this explains [rad].
    """

    noise: float
    half: Array
    inside: float
    error: float
    expected: float


def fitted_bands(
    problem: Problem, known: Uncertainty, responses: Sequence[Array]
) -> list[dict[int, Band]]:
    """Return the bands of the compared joints around responses [rad], (T, K), to the
    fitted logs."""
    bands: list[dict[int, Band]] = [{} for _ in problem.logs]
    slopes = known.likelihood.errors.errors(known.linear.slopes)
    for number, channel in enumerate(problem.channels):
        if channel.quantity == "angle":
            sd = known.posterior.sd(slopes[:, channel.rows]) / channel.weight
            simulated = responses[channel.log][:, channel.column]
            noise = error_variances(known.errors, number, simulated)
            error = channel.measured - simulated
            bands[channel.log][channel.joint] = _band(
                known.posterior, noise, sd**2, error
            )
    return bands


def error_variances(
    errors: ErrorModel, channel: int, simulated: Array
) -> tuple[float, Array]:
    """Return the variance of a channel's sensor, and that of its drift along a
    simulated way, shape (T,)."""
    course, i = errors.courses[channel], errors.of[channel]
    along = replace(course, way=travelled(simulated, course.period))
    return float(errors.numbers[i, 0]), errors.drift(along, i)


def prediction_bands(
    model: IdentifiedModel, log: Log, response: Array
) -> dict[int, Band]:
    """Return the band of each compared joint, numbered from 1, around a response [rad],
    shape (T, K).

    Empty where the model's values are not those of a fit, which alone knows its
    covariance and errors.
    """
    known, outputs = stored_posterior(model), model.settings.outputs
    if known is None or model.summary is None:
        return {}
    stored, left_out = model.summary.errors, model.summary.left_out_deg
    if any(f"q{joint}" not in stored for joint in outputs):
        return {}
    problem = Problem(model.settings, [log])

    def angles(theta: Array) -> Array:
        return problem.responses(theta)[0].angle.reshape(len(theta), -1)

    errors = stored_error_model(problem, stored)
    slopes = differentiate(angles, known.box, known.axes(STEP))
    parts = known.parts(slopes).reshape(-1, *response.shape)
    slopes = slopes.reshape(parts.shape)
    bands: dict[int, Band] = {}
    for column, joint in enumerate(outputs):
        variance = np.sum(parts[:, :, column] ** 2, axis=0)
        if np.mean(variance) > np.mean(np.sum(slopes[:, :, column] ** 2, axis=0)):
            # no better than from parameters known to 100 % each
            variance = np.full_like(variance, np.inf)
        noise = error_variances(errors, column, response[:, column])
        error = log.angle[:, joint - 1] - response[:, column]
        unseen = np.radians(left_out.get(f"q{joint}", ()))
        explained = np.mean(variance + noise[0] + noise[1])
        wrong = max(np.mean(unseen**2) - explained, 0.0) if unseen.size else 0.0
        widened = (
            wrong
            * float(student.ppf(0.5 + COVERAGE / 2, unseen.size or 1) / NORMAL) ** 2
        )
        bands[joint] = _band(known, noise, variance, error, wrong, widened)
    return bands


def _band(
    known: Posterior,
    noise: tuple[float, Array],
    variance: Array,
    error: Array,
    wrong: float = 0.0,
    widened: float = 0.0,
) -> Band:
    """Return the band of an error [rad] from the variances of sensor and drift, and of
    the rest, (T,).

    wrong: mean square error of the model on unseen logs. widened: the same, as wide as
    it is known.
    """
    sensor, drift = noise
    variance = variance + sensor + drift
    half = np.sqrt(known.quantile**2 * variance + NORMAL**2 * widened)
    inside = float(np.mean(np.abs(error) <= half))
    return Band(
        np.sqrt(sensor), half, inside, rms(error), np.sqrt(np.mean(variance) + wrong)
    )
