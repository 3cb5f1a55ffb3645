"""What changes when a log is left out: the covariance by log, and the error on a log
that no fit has seen.

The pooled covariance trusts the model and the noise that the residuals show. Where the
model errs, each log pulls the estimate its own way, its parameters make up for the
error log by log, and neither covariance nor noise tell of it. Leaving out one log after
the other does (a jackknife; J. G. MacKinnon, M. Ø. Nielsen, M. D. Webb, 2023). To first
order it needs no further fit. With J = V D U (`Linear`), U_g the columns of log g, r_g
its residual and A_g = U_g U_g', leaving out log g changes

    the parameters by  d_g = V D^-1 (1 - A_g)^-1 U_g r_g,
    the residual of g to  r_g + U_g' (1 - A_g)^-1 U_g r_g    (that of D. M. Allen, 1974, for a whole log).

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

from hydroid.arrays import Array, record, rms
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
    of = np.array([channel.log for channel in problem.channels])
    logs, number = (
        np.unique(of),
        np.repeat(of, [len(channel.measured) for channel in problem.channels]),
    )
    if len(logs) < 2:
        unknown = np.full(len(uncertainty.theta), np.nan)
        return ByLog(unknown, np.stack([unknown, unknown], axis=1), unknown, (), {})
    linear, row = uncertainty.linear, uncertainty.linear.innovations.copy()
    columns = [np.flatnonzero(number == g) for g in logs]
    effects = [linear.effects[:, own] for own in columns]
    shares = np.array([u @ u.T for u in effects])  # A_g
    scatters = np.array([uncertainty.scatters[of == g].sum(axis=0) for g in logs])
    share, axes = np.linalg.eigh(shares)
    alone = share > 0.99  # only this log has information on the direction
    gain = np.where(alone, 0.0, 1 / (1 - np.minimum(share, 0.99)))
    # of each effect when log g is left out: (1 - A_g)^-1 U_g r_g
    inverses = (axes * gain[:, None]) @ axes.transpose(0, 2, 1)
    steps = np.array(
        [m @ u @ row[own] for m, u, own in zip(inverses, effects, columns, strict=True)]
    )
    for own, step, u in zip(columns, steps, effects, strict=True):
        row[own] += step @ u
    left_out = defaultdict[str, list[float]](list)
    errors = uncertainty.likelihood.errors.errors(row[None])[0]
    for channel in problem.channels:
        if channel.quantity == "angle":
            error = rms(errors[channel.rows]) / channel.weight
            left_out[f"q{channel.joint}"].append(float(np.degrees(error)))

    rows, pooled = linear.changes, scatters.sum(axis=0)  # of the p parameters that vary
    expected = _expected(rows @ inverses, shares, scatters, linear.prior_scatter)
    mean, square = (
        np.trace(expected, axis1=1, axis2=2),
        np.sum(expected**2, axis=(1, 2)),
    )
    # what the priors say is no less certain where the logs differ
    noise = np.sum(rows @ pooled * rows, axis=1) / uncertainty.posterior.deviations**2
    with np.errstate(all="ignore"):  # 0 / 0 of a parameter without effect: not known
        freedom, ratio = mean**2 / square, np.sum((steps @ rows.T) ** 2, axis=0) / mean
        widened = np.sqrt(1 - noise + noise * ratio)
    # a parameter that owes a tenth of its deviation to what one log alone has is
    # unknown by log
    owed = np.linalg.norm(rows @ np.where(alone[:, None], axes, 0.0), axis=2)
    widened[(owed > 0.1 * np.linalg.norm(rows, axis=1)).any(axis=0)] = np.inf
    freedom, ratio = linear.spread(freedom), linear.spread(ratio)
    relative = uncertainty.relative * linear.spread(widened)
    out = [
        s.at_bound is not None or s.source is Source.PRIOR for s in uncertainty.status
    ]
    relative[~np.isfinite(uncertainty.relative) | out] = np.nan
    half = student.ppf(0.5 + COVERAGE / 2, freedom) * relative
    # in 5 % of the fits with a right model any parameter is said to differ
    known = np.isfinite(relative)
    differing = known & (chi2.sf(freedom * ratio, freedom) < 0.05 / max(known.sum(), 1))
    interval = ends(problem.parameters, linear.box, half)
    return ByLog(
        relative, interval, freedom, problem.parameters.named(differing), left_out
    )


def _expected(changes: Array, shares: Array, scatters: Array, priors: Array) -> Array:
    """Covariance of the changes d_g of each parameter for the pooled noise, shape (p,
    G, G).

    The noise n of log h reaches d_g by U_h n: minus A_g times it through the fit, and
    directly if h is g. `changes` are of each parameter per score of log g when it is
    left out, (G, p, k).
    """
    through = changes @ shares
    direct = np.einsum("gpk,hpk->pgh", changes @ scatters, through)
    expected = np.einsum(
        "gpk,hpk->pgh", through @ (scatters.sum(axis=0) + priors), through
    )
    expected -= direct + direct.transpose(0, 2, 1)
    logs = range(len(scatters))
    expected[:, logs, logs] += np.einsum("gpk,gpk->pg", changes @ scatters, changes)
    return expected
