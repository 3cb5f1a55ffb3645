"""Parts of the logs left out: each is predicted by a fit that has not seen it.

The parts are blocks of time. The parameters without each block follow from the Jacobian
of the fit to all of them, which costs no simulation.

Models are compared by the predictive likelihood of these parts, a sum over blocks of
time whose differences also tell how certain the comparison is. Errors over a whole log
would be a lottery: the drift of a joint in one log is one draw.
"""

import math

import numpy as np
from scipy.stats import norm as normal

from hydroid.arrays import Array, Ints, record
from hydroid.estimate import finite
from hydroid.fitting.refinement import Refinement, refine_from_afar
from hydroid.fitting.step import Step
from hydroid.posterior.error_model import (
    LEAST_NOISE,
    Likelihood,
    likelihood_at,
    make_likelihood,
)
from hydroid.problem.problem import Problem
from hydroid.search.descent import derivatives
from hydroid.settings.search import RefinementSettings

BLOCK = 5.0
"""length of a block [s]: longer than what is left of an error lasts (ours)"""
LEAST_BLOCKS = 8
"""that all logs together have; those of short logs are shorter: from a few, a standard
error is a guess"""
BOX = 12.0
"""what a parameter's bounds tell of it: 1 over the variance of what is as likely
anywhere in the unit box"""
LEVEL = 0.05
"""probability that a gain without a reason counts as one"""
LEAST_GAIN = 3.0
"""of the log-likelihood, however certain it is: strong evidence by R. E. Kass and A. E.
Raftery (1995)"""

COMPARED = RefinementSettings(iterations=60, gain_tolerance=1e-4)
"""of a fit that only serves a comparison"""

Gain = tuple[float, float]
"""by how much a model foretells parts of the logs left out better than another, and the
standard error of that (`gain`)"""


@record
class LeftOut:
    """Predictions of the parts of a problem's logs.

    Attributes:
        problem: with all logs.
        theta: of the fit to all of them, shape (P,).
        thetas: of the fit without each part, shape (G, P).
        errors: weighted output errors of each part in the fit without it [rad], shape
            (R,).
        judged: the same, no larger than what the other parts leave open lets them count
            (R,).
        open: by how much that spreads the prediction of each part, as half the
            logarithm of a determinant, shape (G,).
    """

    problem: Problem
    theta: Array
    thetas: Array
    errors: Array
    judged: Array
    open: Array

    @property
    def by_joint(self) -> dict[str, float | None]:
        """Rms error of each compared joint by name [deg]."""
        settings = self.problem.settings
        errors = dict[str, float | None]()
        for joint in settings.outputs:
            (rms,) = self.problem.rms(self.errors[None], [joint])
            errors[settings.arm.name_of(joint)] = finite(np.degrees(rms))
        return errors


def not_fitted(problem: Problem, theta: Array, errors: Array) -> LeftOut:
    """Return the parts of logs as a model predicts them that was fitted to none.

    Args:
        problem: of the logs.
        theta: of the model, shape (P,).
        errors: its weighted output errors [rad], shape (R,).
    """
    nothing = np.zeros(int(blocks(problem).max()) + 1)
    return LeftOut(problem, theta, theta[None], errors, errors, nothing)


def refit(problem: Problem, theta: Array) -> LeftOut:
    """Fit a problem from theta, shape (P,), and predict each block of its logs by the
    fit without it.

    Nothing of the fit is shown or stored.
    """
    return predict_blocks(problem, compared_fit(problem, theta))


def compared_fit(problem: Problem, theta: Array) -> Refinement:
    """Fit a problem from theta, shape (P,), as far as a comparison needs it; nothing of
    it is shown or stored."""
    step = Step("compared")
    likelihood = make_likelihood(problem)
    return refine_from_afar(likelihood, theta, COMPARED, lambda *_: False, {}, step)


def predict_blocks(problem: Problem, end: Refinement) -> LeftOut:
    """Predict each block of time by the parameters that least squares would find
    without it.

    They follow to first order from the normal equations without the block's rows (R. D.
    Cook, 1977), within the bounds. All logs keep a share in each fit: one of two logs
    alone may leave a parameter open, and then tells nothing of a model.

    A parameter that only this block shows is then undetermined, and the block's errors
    may be very large. That is no fault of the model: the prediction is as uncertain.
    With J the block's slopes, C the covariance of the parameters without it and r its
    residual in the fit to all, the residual left out is S r with S = 1 + J C Jᵀ, and S
    is also its covariance. So its density has rᵀ S r and log |S| (G. A. F. Seber and A. J.
    Lee, *Linear Regression Analysis*, 2003, chapter 10), and neither needs a matrix of the block's size.
    """
    theta = problem.parameters.from_unit(end.point)
    weighing = likelihood_at(problem, theta, end.numbers)
    jacobian = end.jacobian
    if not len(jacobian):
        rows = weighing.rows(theta[None])[0]
        jacobian = derivatives(
            lambda unit: weighing.rows(problem.parameters.from_unit(unit)),
            end.point,
            rows,
        ).T
    # a parameter at a bound stays there, and one beside which no simulation holds
    moves = (end.point > 0.0) & (end.point < 1.0) & np.isfinite(jacobian).all(axis=0)
    slopes = np.where(moves, jacobian, 0.0)
    errors = problem.output_errors(theta[None])[0]
    innovations = weighing.errors.innovations(errors[None])[0]
    by_error = weighing.errors.errors(slopes[: errors.size].T)
    normal = slopes.T @ slopes + BOX * np.eye(end.point.size)
    number = blocks(problem)
    thetas = np.empty((int(number.max()) + 1, theta.size))
    spread = np.empty(len(thetas))
    predicted = errors.copy()
    judged = errors.copy()
    for block in range(len(thetas)):
        own = np.flatnonzero(number == block)
        of_block = slopes[own]
        inner = of_block.T @ of_block
        gradient = of_block.T @ innovations[own]
        change = np.linalg.solve(normal - inner, gradient)
        change = np.clip(end.point + change, 0.0, 1.0) - end.point
        thetas[block] = problem.parameters.from_unit(end.point + change)
        effect = change @ by_error[:, own]
        predicted[own] += effect
        judged[own] += effect * _share(gradient @ change, change @ inner @ change)
        spread[block] = 0.5 * (_log_size(normal) - _log_size(normal - inner))
    return LeftOut(problem, theta, thetas, predicted, judged, spread)


def _share(along: float, squared: float) -> float:
    """Return the part t of a change of a block's residual r, for which |r + t J d|² is
    rᵀ S r: `along` is rᵀ J d, and `squared` is |J d|²."""
    if along <= 0.0:
        return 0.0
    return along / (along + np.sqrt(along * (along + squared)))


def _log_size(matrix: Array) -> float:
    """Logarithm of the determinant of a positive definite matrix."""
    return float(np.linalg.slogdet(matrix).logabsdet)


def gain(after: LeftOut, before: LeftOut) -> Gain:
    """Return by how much one model foretells the parts better than another, and the
    standard error of that.

    It is a difference of predictive log-likelihoods by blocks, half by the weights that
    the errors of the one show on the parts, half by those of the other. By the weights
    of one alone, the other's errors would seem impossible wherever it errs a little
    more. The standard error is infinite where there is one block only, or where either
    model cannot be simulated.
    """
    problem = before.problem
    able = [bool(np.isfinite(one.judged).all()) for one in (after, before)]
    if not all(able):
        return float(np.inf if able[0] else -np.inf), np.inf
    errors = np.stack([before.judged, after.judged])
    likelihood = make_likelihood(problem)
    sums = before.open - after.open
    for of_one in errors:
        sums += 0.5 * _gains(likelihood.estimated(of_one), errors, of_one)
    if len(sums) < 2:
        return float(np.sum(sums)), np.inf
    variance = len(sums) * np.var(sums, ddof=1)
    return float(sums.sum()), float(np.sqrt(variance))


def _gains(likelihood: Likelihood, errors: Array, own: Array) -> Array:
    """Return by how much the second row of output errors, (2, R), is more likely than
    the first, by blocks, shape (G,).

    A model that errs does so more in one block than in another: where commands are
    that it does not know, a block may err ten times as much, and would alone decide.
    So the errors of a signal have a scale of their own in each block. It is integrated
    out, which leaves logarithms of sums of squares (A. Zellner, *An Introduction to
    Bayesian Inference in Econometrics*, 1971, chapter 3). A block counts as the number
    of independent errors that tell as much as the errors `own`, (R,), which last. No
    sum is below what a sensor's least noise leaves.
    """
    number = blocks(likelihood.problem)
    # each signal by its own errors, in stage 1, too
    weighing = likelihood.shown.weighing(likelihood.memory, alike=False)
    squares = weighing.innovations(np.vstack([errors, own])) ** 2
    gains = np.zeros(int(number.max()) + 1)
    for i, signal in enumerate(weighing.signals):
        of_signal = np.zeros(number.size, dtype=bool)
        for course in weighing.courses_of(i):
            of_signal[course.rows] = course.used
        if not of_signal.any():
            continue
        inside = number[of_signal]
        count = np.bincount(inside, minlength=len(gains))
        before, after = (
            np.bincount(inside, row[of_signal], len(gains)) for row in squares[:2]
        )
        counted = float(np.mean(squares[2, of_signal])) * count
        least = LEAST_NOISE[signal.quantity] ** 2 / weighing.numbers[i, 0] * count
        known = count > 0
        ratio = (before + least)[known] / (after + least)[known]
        gains[known] += 0.5 * counted[known] * np.log(ratio)
    return gains


def is_better(after: LeftOut, before: LeftOut, among: int = 1) -> bool:
    """Return whether one model foretells the parts better than another by more than the
    uncertainty of that.

    So does one that can be simulated where the other cannot. `among` is the number of
    models that are tried: the best of many seems better by chance.
    """
    return is_clear(*gain(after, before), among)


def is_clear(rise: float, error: float, among: int = 1) -> bool:
    """Return whether a gain and its standard error, as `gain` returns them, say that a
    model is better, one `among` several."""
    # C. E. Bonferroni, 1936
    certain = float(normal.isf(LEVEL / among))
    return rise > max(certain * error, LEAST_GAIN) or rise == np.inf


def blocks(problem: Problem) -> Ints:
    """Return which block of time each sample is in, over all logs, shape (R,)."""
    length = min(BLOCK, sum(log.duration for log in problem.logs) / LEAST_BLOCKS)
    counts = [max(math.ceil(log.duration / length), 1) for log in problem.logs]
    firsts = np.cumsum([0, *counts])
    number = np.empty(problem.measured.size, dtype=np.int64)
    for c in problem.channels:
        own = (problem.logs[c.log].time / length).astype(np.int64)
        number[c.rows] = firsts[c.log] + np.minimum(own, counts[c.log] - 1)
    return number
