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
from hydroid.posterior.course import travelled
from hydroid.posterior.error_model import ErrorModel
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

GATHERS = 5.0
"""time from the start of a log within which a model's error gathers [s]; as long as a
block that is left out (ours)"""


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
    problem: Problem, uncertainty: Uncertainty, responses: Sequence[Array]
) -> list[dict[int, Band]]:
    """Return the bands of the compared joints around responses [rad], (T, K), to the
    fitted logs."""
    bands: list[dict[int, Band]] = [{} for _ in problem.logs]
    posterior = uncertainty.posterior
    slopes = uncertainty.likelihood.errors.errors(uncertainty.linear.slopes)
    for number, channel in enumerate(problem.channels):
        if channel.quantity != "angle":
            continue
        # residuals are weighted; bands are in the angle's own unit
        sd = posterior.sd(slopes[:, channel.rows]) / channel.weight
        simulated = responses[channel.log][:, channel.column]
        sensor, drift = error_variances(uncertainty.errors, number, simulated)
        error = channel.measured - simulated
        spread = Spread(sd**2, sensor, drift)
        period = problem.logs[channel.log].period
        bands[channel.log][channel.joint] = _band(posterior, spread, error, period)
    return bands


def error_variances(
    errors: ErrorModel, channel: int, simulated: Array
) -> tuple[float, Array]:
    """Return the variance of a channel's sensor, and that of its drift along a
    simulated way, shape (T,)."""
    course = errors.courses[channel]
    i = errors.of[channel]
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
    posterior = stored_posterior(model)
    if posterior is None or model.summary is None:
        return {}
    outputs = model.settings.outputs
    stored = model.summary.errors
    if any(f"q{joint}" not in stored for joint in outputs):
        return {}
    problem = Problem(model.settings, [log])
    errors = stored_error_model(problem, stored)
    variances = _angle_variances(problem, posterior, response.shape)
    left_out = model.summary.left_out_deg
    bands: dict[int, Band] = {}
    for column, joint in enumerate(outputs):
        sensor, drift = error_variances(errors, column, response[:, column])
        spread = Spread(variances[:, column], sensor, drift)
        error = log.angle_of(joint) - response[:, column]
        unseen = np.radians(left_out.get(f"q{joint}", ()))
        bands[joint] = _band(posterior, spread, error, log.period, unseen)
    return bands


def _angle_variances(
    problem: Problem, posterior: Posterior, shape: tuple[int, ...]
) -> Array:
    """Return the variances of the angles simulated for the problem's only log, of shape
    (T, K), that the uncertainty of the parameters gives."""

    def angles(theta: Array) -> Array:
        return problem.responses(theta)[0].angle.reshape(len(theta), -1)

    slopes = differentiate(angles, posterior.box, posterior.axes(STEP))
    parts = posterior.parts(slopes)
    variance = np.sum(parts.reshape(-1, *shape) ** 2, axis=0)
    # as large if each parameter was known to 100 % by itself
    unknown = np.sum(slopes.reshape(-1, *shape) ** 2, axis=0)
    for column in range(shape[1]):
        if np.mean(variance[:, column]) > np.mean(unknown[:, column]):
            variance[:, column] = np.inf
    return variance


@record
class Spread:
    """Variances of what a predicted angle errs by [rad²].

    Attributes:
        parameters: of their uncertainty, shape (T,).
        sensor: of its noise.
        drift: of the error model's drift, shape (T,).
    """

    parameters: Array
    sensor: float
    drift: Array


def _band(
    posterior: Posterior,
    spread: Spread,
    error: Array,
    period: float,
    unseen: Sequence[float] | Array = (),
) -> Band:
    """Return the band of an error [rad], (T,), of the period [s], with the rms errors
    of logs that were left out, `unseen` [rad]."""
    variance = spread.parameters + spread.sensor + spread.drift
    # what is beyond all this on logs that were left out is the model's
    wrong = 0.0
    widened = np.zeros(variance.shape)
    if len(unseen):
        wrong = max(np.mean(np.square(unseen)) - np.mean(variance), 0.0)
        quantile = float(student.ppf(0.5 + COVERAGE / 2, len(unseen)))
        # at the start of a log nothing is wrong yet
        share = np.minimum(period * np.arange(len(variance)) / GATHERS, 1.0)
        widened = wrong * share / np.mean(share) * (quantile / NORMAL) ** 2
    half = np.sqrt(posterior.quantile**2 * variance + NORMAL**2 * widened)
    return Band(
        noise=np.sqrt(spread.sensor),
        half=half,
        inside=float(np.mean(np.abs(error) <= half)),
        error=rms(error),
        expected=np.sqrt(np.mean(variance) + wrong),
    )
