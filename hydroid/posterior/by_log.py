"""What changes when a log is left out: the covariance by log, and the error on a log
that no fit has seen.

The pooled covariance trusts the model and the noise that the residuals show. Where the
model errs, each log pulls the estimate its own way, its parameters make up for the
error log by log, and neither covariance nor noise tell of it. Leaving out one log after
the other does (a jackknife; J. G. MacKinnon, M. Ø. Nielsen, M. D. Webb, 2023). To first
order it needs no further fit. With J = V D U (`Linear`), U_g the columns of log g, r_g
its residual and A_g = U_g U_g', leaving out log g changes

    the parameters by  d_g = V D^-1 (1 - A_g)^-1 U_g r_g,
    the residual of g to  r_g + U_g' (1 - A_g)^-1 U_g r_g

(that of D. M. Allen, 1974, for a whole log).

The root mean square of the latter is the error to expect on an unseen log. The variance
of a parameter by log is, but for the priors' part of it, which belongs to no log,

    (pooled variance) * sum of d_g² / (what the pooled noise would make of this sum on
    average):

unbiased where the model is right. The sum is about chi-square with the degrees of
freedom of its first two moments (R. M. Bell and D. F. McCaffrey, 2002), G - 1 for G
logs that excite alike; the interval is Student's t with these. The usual sandwich,
clustered by log, is useless for a few logs that differ: the score of a log that alone
determines a parameter is zero at the optimum.
"""

from collections import defaultdict

import numpy as np
from scipy.stats import chi2, t as student

from hydroid.arrays import Array, Ints, Mask, record, rms
from hydroid.posterior.posterior import COVERAGE
from hydroid.posterior.uncertainty import Source, Uncertainty, ends
from hydroid.problem.problem import Problem


@record
class ByLog:
    """What the differences between the G logs say about P parameters.

    Attributes:
        relative: relative standard deviation by log, shape (P,): infinite where one log
            alone determines the parameter, NaN where it is fixed, at a bound, not
            identifiable, or known from its prior only.
        interval: of 95 %, shape (P, 2).
        freedom: degrees of freedom of the standard deviation, shape (P,).
        differing: parameters that differ from log to log by more than the noise
            explains: the model errs.
        left_out: rms error of each compared angle on each of the G logs if it is left
            out [deg]; `q2` of joint 2. What one log alone determines stays as it is:
            the others say nothing of it.
    """

    relative: Array
    interval: Array
    freedom: Array
    differing: tuple[str, ...]
    left_out: dict[str, list[float]]


def by_log(problem: Problem, uncertainty: Uncertainty) -> ByLog:
    """Return what the differences between the logs say: nothing of one log."""
    log_of_channel = np.array([channel.log for channel in problem.channels])
    logs = np.unique(log_of_channel)
    if len(logs) < 2:
        unknown = np.full(len(uncertainty.theta), np.nan)
        no_ends = np.stack([unknown, unknown], axis=1)
        return ByLog(unknown, no_ends, unknown, (), {})
    left_out = _left_out(problem, uncertainty, logs)
    linear = uncertainty.linear
    relative, freedom, ratio = _deviations(uncertainty, left_out, log_of_channel, logs)
    for i, parameter in enumerate(uncertainty.status):
        # what a bound or a prior says does not differ from log to log
        if parameter.at_bound is not None or parameter.source is Source.PRIOR:
            relative[i] = np.nan
    half = student.ppf(0.5 + COVERAGE / 2, freedom) * relative
    # in 5 % of the fits with a right model any parameter is said to differ
    stated = np.isfinite(relative)
    level = 0.05 / max(stated.sum(), 1)
    chance = chi2.sf(freedom * ratio, freedom)
    differing = stated & (chance < level)
    return ByLog(
        relative=relative,
        interval=ends(problem.parameters, linear.box, half),
        freedom=freedom,
        differing=problem.parameters.named(differing),
        left_out=_angle_errors(problem, uncertainty, left_out.row),
    )


@record
class _LeftOut:
    """What leaving out each of G logs does to p effects.

    Attributes:
        shares: A_g, shape (G, p, p).
        axes: of these, in columns, shape (G, p, p).
        alone: directions on which only this log has information, shape (G, p).
        inverses: (1 - A_g)^-1, without the directions that log g alone determines,
            shape (G, p, p).
        steps: of the effects, (1 - A_g)^-1 U_g r_g, shape (G, p).
        row: the innovations, those of each log where it is left out, shape (R,).
    """

    shares: Array
    axes: Array
    alone: Mask
    inverses: Array
    steps: Array
    row: Array


def _left_out(problem: Problem, uncertainty: Uncertainty, logs: Ints) -> _LeftOut:
    """Leave out each of the logs, given by their indices, (G,)."""
    linear = uncertainty.linear
    log_of_channel = [channel.log for channel in problem.channels]
    lengths = [len(channel.measured) for channel in problem.channels]
    log_of_sample = np.repeat(log_of_channel, lengths)
    samples = [np.flatnonzero(log_of_sample == log) for log in logs]
    effects = [linear.effects[:, of_log] for of_log in samples]
    shares = np.array([u @ u.T for u in effects])
    share, axes = np.linalg.eigh(shares)
    alone = share > 0.99
    # along what only this log determines nothing is left without it: no step
    gain = np.where(alone, 0.0, 1 / (1 - np.minimum(share, 0.99)))
    scaled = axes * gain[:, None]
    inverses = scaled @ axes.transpose(0, 2, 1)
    row = linear.innovations.copy()
    steps = np.empty((len(logs), len(linear.slopes)))
    for g, (of_log, u) in enumerate(zip(samples, effects, strict=True)):
        steps[g] = inverses[g] @ u @ row[of_log]
        row[of_log] += steps[g] @ u
    return _LeftOut(shares, axes, alone, inverses, steps, row)


def _angle_errors(
    problem: Problem, uncertainty: Uncertainty, row: Array
) -> dict[str, list[float]]:
    """Return the rms error of each compared angle in each log [deg] from a row of
    innovations, (R,)."""
    by_angle = defaultdict[str, list[float]](list)
    errors = uncertainty.likelihood.errors.errors(row[None])[0]
    for channel in problem.channels:
        if channel.quantity == "angle":
            error = rms(errors[channel.rows]) / channel.weight
            by_angle[f"q{channel.joint}"].append(float(np.degrees(error)))
    return by_angle


def _deviations(
    uncertainty: Uncertainty, left_out: _LeftOut, log_of_channel: Ints, logs: Ints
) -> tuple[Array, Array, Array]:
    """Return relative standard deviations by log, infinite where one log alone
    determines a parameter, their degrees of freedom, and the variance of the changes
    over that of the pooled noise, (P,) each."""
    linear = uncertainty.linear
    changes = linear.changes
    by_channel = uncertainty.scatters
    of_logs = [by_channel[log_of_channel == log].sum(axis=0) for log in logs]
    scatters = np.array(of_logs)
    steps = changes @ left_out.inverses
    expected = _expected(steps, left_out.shares, scatters, linear.prior_scatter)
    mean = np.trace(expected, axis1=1, axis2=2)
    square = np.sum(expected**2, axis=(1, 2))
    changed = np.sum((left_out.steps @ changes.T) ** 2, axis=0)
    # what the priors say is no less certain where the logs differ
    pooled = np.sum(changes @ scatters.sum(axis=0) * changes, axis=1)
    noise = pooled / uncertainty.posterior.deviations**2
    with np.errstate(all="ignore"):  # 0 / 0 of a parameter without effect: not known
        freedom = mean**2 / square
        ratio = changed / mean
        widened = np.sqrt(1 - noise + noise * ratio)
    # a parameter that owes a tenth of its deviation to what one log alone has is
    # unknown by log
    of_one_log = np.where(left_out.alone[:, None], left_out.axes, 0.0)
    owed = np.linalg.norm(changes @ of_one_log, axis=2)
    whole = np.linalg.norm(changes, axis=1)
    owes_much = (owed > 0.1 * whole).any(axis=0)
    widened[owes_much] = np.inf
    relative = uncertainty.relative * linear.spread(widened)
    relative[~np.isfinite(uncertainty.relative)] = np.nan
    return relative, linear.spread(freedom), linear.spread(ratio)


def _expected(changes: Array, shares: Array, scatters: Array, priors: Array) -> Array:
    """Covariance of the changes d_g of each parameter for the pooled noise, shape (p,
    G, G).

    The noise n of log h reaches d_g by U_h n: minus A_g times it through the fit, and
    directly if h is g. `changes` are of each parameter per score of log g when it is
    left out, (G, p, k).
    """
    through = changes @ shares
    direct = np.einsum("gpk,hpk->pgh", changes @ scatters, through)
    pooled = scatters.sum(axis=0) + priors
    expected = np.einsum("gpk,hpk->pgh", through @ pooled, through)
    expected -= direct + direct.transpose(0, 2, 1)
    logs = range(len(scatters))
    expected[:, logs, logs] += np.einsum("gpk,gpk->pg", changes @ scatters, changes)
    return expected
