"""Covariance by log: how much an estimate differs from log to log, whatever the reason.

The pooled covariance trusts the model and the noise that the residuals show. Where the model errs, each log
pulls the estimate its own way, and the pooled covariance is too small. By log, each log is one independent
observation: a sandwich clustered by log. The usual one, from the products of the logs' scores, is useless for
a few logs that differ: the score of a log that alone determines a parameter is zero at the optimum. Instead
let d_g be the change of a parameter when log g is left out (a jackknife; J. G. MacKinnon, M. Ø. Nielsen,
M. D. Webb, 2023). The variance by log is

    (pooled variance) * sum of d_g² / (what the pooled noise would make of this sum on average)

but for the priors' part of it. So it is unbiased where the model is right, and where all logs excite alike it
is the usual sandwich times G / (G - 1). The sum is about chi-square with the degrees of freedom of its first
two moments (R. M. Bell and D. F. McCaffrey, 2002), G - 1 for G logs that excite alike; the interval is
Student's t with these.

The changes d_g are linear. With J = V D U (`decompose`), U_g the columns of log g, r_g its residual and
A_g = U_g U_g', they are V D^-1 (1 - A_g)^-1 U_g r_g. Nothing is simulated. Priors belong to no log, and stay.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from hydroid.parameters import Array
from hydroid.posterior.covariance import COVERAGE, Uncertainty, decompose, ends
from hydroid.posterior.flags import Source
from hydroid.problem.problem import Problem

ALONE = 0.99
"""part of the information on a direction above which a log is called the only one that has it"""
LOST_PART = 0.1
"""part of a parameter's standard deviation; one that owes more to such directions is unknown by log"""
FALSE_ALARMS = 0.05
"""part of the fits with a right model in which any parameter is said to differ between the logs"""
FEW = 5.0
"""degrees of freedom below which a standard deviation by log is rough: to a third, or worse"""


@dataclass(frozen=True, eq=False)
class ByLog:
    """What the differences between the logs say about P parameters.

    Attributes:
        relative: relative standard deviation by log, shape (P,): infinite where one log alone determines the
            parameter, NaN where it is fixed, at a bound, not identifiable, or known from its prior only.
        interval: of 95 %, shape (P, 2).
        freedom: degrees of freedom of the standard deviation, shape (P,).
        differing: parameters that differ from log to log by more than the noise explains: the model errs.
    """

    relative: Array
    interval: Array
    freedom: Array
    differing: tuple[str, ...]


def by_log(problem: Problem, uncertainty: Uncertainty) -> ByLog | None:
    """Return what the differences between the logs say; None for one log."""
    logs = sorted({channel.log for channel in problem.channels})
    inside = uncertainty.free & [status.at_bound is None for status in uncertainty.status]
    if len(logs) < 2 or not inside.any():
        return None
    at = uncertainty.jacobian
    directions, values, effects = decompose(inside, at)
    fitted = values > 0
    rows, effects = directions[:, fitted] / values[fitted], effects[fitted]
    priors = at.prior_weight * effects[:, at.residual.size :]
    size = len(effects)
    shares, scatters, scores = (
        np.zeros((len(logs), size, size)),
        np.zeros((len(logs), size, size)),
        np.zeros((len(logs), size)),
    )
    for channel, noise in zip(problem.channels, uncertainty.noise, strict=True):
        g, own = logs.index(channel.log), effects[:, channel.rows]
        shares[g] += own @ own.T
        scatters[g] += noise.covariance_of(own)
        scores[g] += own @ at.residual[channel.rows]
    share, axes = np.linalg.eigh(shares)
    alone = share > ALONE
    # rows of changes: what a score of log g changes in each parameter when that log is left out, (G, p, k)
    turned = rows @ axes
    lost = np.linalg.norm(np.where(alone[:, None], turned, 0.0), axis=2) > LOST_PART * np.linalg.norm(
        rows, axis=1
    )
    changes = (turned * np.where(alone, 0.0, 1 / (1 - np.minimum(share, ALONE)))[:, None]) @ axes.transpose(
        0, 2, 1
    )
    found = np.sum(np.einsum("gpk,gk->gp", changes, scores) ** 2, axis=0)
    # the noise n of log h reaches d_g by U_h n: minus A_g times it through the fit, and directly if h is g
    through = changes @ shares
    whole = scatters.sum(axis=0) + priors @ priors.T
    expected = np.einsum("gpk,kl,hpl->pgh", through, whole, through)
    direct = np.einsum("gpk,gkl,hpl->pgh", changes, scatters, through)
    expected -= direct + direct.transpose(0, 2, 1)
    expected[:, range(len(logs)), range(len(logs))] += np.einsum(
        "gpk,gkl,gpl->pg", changes, scatters, changes
    )
    mean, square = np.trace(expected, axis1=1, axis2=2), np.sum(expected**2, axis=(1, 2))
    # what the priors say is no less certain where the logs differ
    spread = scatters.sum(axis=0)
    noise, stated = (np.einsum("pk,kl,pl->p", rows, m, rows) for m in (spread, priors @ priors.T))
    relative, freedom = np.full((2, len(inside)), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):  # 0 / 0 of a parameter without effect: not known
        freedom[inside] = mean**2 / square
        ratio = found / mean
        widened = np.sqrt((stated + noise * ratio) / (stated + noise))
    relative[inside] = np.where(lost.any(axis=0), np.inf, uncertainty.relative[inside] * widened)
    prior_only = np.array([status.source is Source.PRIOR for status in uncertainty.status])
    relative[~np.isfinite(uncertainty.relative) | prior_only] = np.nan
    half = student.ppf(0.5 + COVERAGE / 2, freedom) * relative
    chances = np.ones(len(inside))
    chances[inside] = chi2.sf(freedom[inside] * ratio, freedom[inside])
    differing = [
        name
        for name, chance, known in zip(problem.parameters.names, chances, np.isfinite(relative), strict=True)
        if known and chance < FALSE_ALARMS / np.isfinite(relative).sum()
    ]
    return ByLog(
        relative, ends(problem.parameters, uncertainty.theta, at.scale, half), freedom, tuple(differing)
    )
