"""Parts of the logs left out: each is predicted by a fit that has not seen it.

Models are compared by the predictive likelihood of these parts, a sum over blocks of time whose differences
also tell how certain the comparison is. Errors over a whole log would be a lottery: the drift of a joint in
one log is one draw.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, Ints, record
from hydroid.estimate import finite
from hydroid.fitting.refinement import Refinement
from hydroid.posterior.error_model import Likelihood, make_likelihood
from hydroid.problem.problem import Problem

BLOCK = 5.0
"""length of a block [s]: longer than what is left of an error lasts (ours)"""
CERTAIN = 1.64
"""standard errors that a gain must exceed: in 5 % of the cases one without a reason does"""

Refit = Callable[[Likelihood, Array, int], Refinement]
"""refines an estimate, shape (P,), by a likelihood; takes the number of the part left out, from 1"""


@record
class LeftOut:
    """Predictions of the parts of a problem's logs.

    Attributes:
        problem: with all logs.
        thetas: of the fit without each part, shape (G, P).
        errors: weighted output errors of each part in the fit without it [rad], shape (R,).
    """

    problem: Problem
    thetas: Array
    errors: Array

    @property
    def by_joint(self) -> dict[str, float | None]:
        """Rms error of each compared joint by name [deg]."""
        settings = self.problem.settings
        names, rms = settings.arm.joint_names, self.problem.rms
        return {names[j - 1]: finite(np.degrees(rms(self.errors[None], [j])[0])) for j in settings.outputs}


def predict_parts(problem: Problem, starts: Array, refit: Refit) -> LeftOut:
    """Fit a problem without each of its G parts, and predict these parts.

    `starts`, shape (G, P), are where each fit starts: estimates that have not seen the part, or one that is
    far from an optimum.
    """
    number = parts(problem)
    several = len(problem.logs) > 1
    thetas = np.empty((len(np.unique(number)), len(problem.parameters.names)))
    errors = np.full(number.size, np.nan)
    for g, start in enumerate(starts):
        out = number == g
        rest = _of_logs(problem, ~out) if several else problem
        likelihood = make_likelihood(rest)
        if not several:
            likelihood = replace(likelihood, shown=likelihood.shown.without(out))
        end = refit(likelihood, start, g + 1)
        thetas[g] = problem.parameters.from_unit(end.point)
        unseen = _of_logs(problem, out) if several else problem
        row = unseen.output_errors(thetas[g][None])[0]
        errors[out] = row if several else row[out]
    return LeftOut(problem, thetas, errors)


def parts(problem: Problem) -> Ints:
    """Return which part each sample is in, from 0, shape (R,).

    The parts are the logs, in three groups at most, or the halves of one log.
    """
    number = np.empty(problem.measured.size, dtype=np.int64)
    for c in problem.channels:
        halves = np.arange(len(c.measured)) >= len(c.measured) // 2
        number[c.rows] = c.log % 3 if len(problem.logs) > 1 else halves
    return number


def gain(after: LeftOut, before: LeftOut) -> tuple[float, float]:
    """Return by how much one model foretells the parts better than another, and the standard error of that.

    It is a difference of log-likelihoods, by the weights of errors that the one before shows on the parts. By
    the weights of its fit a part that it errs on by degrees would be impossible, and one such part would
    decide. The error is infinite where there is one block only, or where either model cannot be simulated.
    """
    problem = before.problem
    able = [bool(np.isfinite(one.errors).all()) for one in (after, before)]
    if not all(able):
        return float(np.inf if able[0] else -np.inf), np.inf
    weighing = make_likelihood(problem).estimated(before.errors).errors
    squares = weighing.innovations(np.stack([after.errors, before.errors])) ** 2
    change = 0.5 * (squares[1] - squares[0])
    sums = np.bincount(blocks(problem), change)
    if len(sums) < 2:
        return float(np.sum(sums)), np.inf
    return float(sums.sum()), float(np.sqrt(len(sums) * np.var(sums, ddof=1)))


def is_better(after: LeftOut, before: LeftOut) -> bool:
    """Whether one model foretells the parts better than another by more than the uncertainty of that.

    So does one that can be simulated where the other cannot.
    """
    rise, error = gain(after, before)
    return rise > CERTAIN * error or rise == np.inf


def blocks(problem: Problem) -> Ints:
    """Return which block of time each sample is in, over all logs, shape (R,)."""
    number = np.empty(problem.measured.size, dtype=np.int64)
    firsts = np.cumsum([0, *(1 + int(log.duration // BLOCK) for log in problem.logs)])
    for c in problem.channels:
        number[c.rows] = firsts[c.log] + (problem.logs[c.log].time // BLOCK).astype(np.int64)
    return number


def _of_logs(problem: Problem, samples: Sequence[bool] | Array) -> Problem:
    """Return the problem of the logs that some samples, (R,), are of; parts are whole logs."""
    kept = sorted({c.log for c in problem.channels if samples[c.rows.start]})
    return problem.varied(problem.settings, [problem.logs[i] for i in kept])
