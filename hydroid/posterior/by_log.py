"""What changes when a log is left out: the covariance by log, and the error on a log that no fit has seen.

The pooled covariance trusts the model and the noise that the residuals show. Where the model errs, each log
pulls the estimate its own way, its parameters make up for the error log by log, and neither covariance nor
noise tell of it. Leaving out one log after the other does (a jackknife; J. G. MacKinnon, M. Ø. Nielsen,
M. D. Webb, 2023). To first order it needs no further fit. With J = V D U (`linearise`), U_g the columns of
log g, r_g its residual and A_g = U_g U_g', leaving out log g changes

    the parameters by  d_g = V D^-1 (1 - A_g)^-1 U_g r_g,
    the residual of g to  r_g + U_g' (1 - A_g)^-1 U_g r_g    (that of D. M. Allen, 1974, for a whole log).

The root mean square of the latter is the error to expect on an unseen log. The variance of a parameter by log
is, but for the priors' part of it, which belongs to no log,

    (pooled variance) * sum of d_g² / (what the pooled noise would make of this sum on average):

unbiased where the model is right. The sum is about chi-square with the degrees of freedom of its first two
moments (R. M. Bell and D. F. McCaffrey, 2002), G - 1 for G logs that excite alike; the interval is Student's
t with these. The usual sandwich, clustered by log, is useless for a few logs that differ: the score of a log
that alone determines a parameter is zero at the optimum.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import t as student

from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty, ends
from hydroid.posterior.flags import Source
from hydroid.posterior.posterior import COVERAGE
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


@dataclass(frozen=True, eq=False)
class _Deletions:
    """The k effects of an estimate, log by log.

    Attributes:
        columns: residuals of each log, G arrays of indices.
        scores: U_g r_g, shape (G, k).
        shares: A_g, shape (G, k, k).
        inverses: (1 - A_g)^-1, but 0 along what log g alone determines, shape (G, k, k).
        alone: unit effects that log g alone determines, zero rows otherwise, shape (G, k, k).
    """

    columns: list[NDArray[np.intp]]
    scores: Array
    shares: Array
    inverses: Array
    alone: Array

    @staticmethod
    def at(problem: Problem, uncertainty: Uncertainty) -> "_Deletions":
        effects, residual = uncertainty.linear.effects, uncertainty.jacobian.residual
        logs = sorted({channel.log for channel in problem.channels})
        columns = [np.concatenate([np.r_[c.rows] for c in problem.channels if c.log == g]) for g in logs]
        scores = np.array([effects[:, own] @ residual[own] for own in columns])
        shares = np.array([effects[:, own] @ effects[:, own].T for own in columns])
        share, axes = np.linalg.eigh(shares)
        alone = share > ALONE
        gain = np.where(alone, 0.0, 1 / (1 - np.minimum(share, ALONE)))
        inverses = (axes * gain[:, None]) @ axes.transpose(0, 2, 1)
        return _Deletions(columns, scores, shares, inverses, np.where(alone[:, None], axes, 0.0))

    @cached_property
    def steps(self) -> Array:
        """How far each effect moves when log g is left out, shape (G, k)."""
        return np.einsum("gkl,gl->gk", self.inverses, self.scores)


def left_out_errors(problem: Problem, uncertainty: Uncertainty) -> dict[int, Array]:
    """Rms error of each compared angle on each log if it is left out [rad], shape (G,), by joint.

    Empty for one log. What one log alone determines stays as it is: the others say nothing of it.
    """
    found = _Deletions.at(problem, uncertainty)
    if len(found.columns) < 2:
        return {}
    row = uncertainty.jacobian.residual.copy()
    for own, step in zip(found.columns, found.steps, strict=True):
        row[own] += step @ uncertainty.linear.effects[:, own]
    angles = [channel for channel in problem.channels if channel.quantity == "angle"]
    return {
        joint: np.array([np.sqrt(np.mean((row[c.rows] / c.weight) ** 2)) for c in angles if c.joint == joint])
        for joint in dict.fromkeys(c.joint for c in angles)
    }


def by_log(problem: Problem, uncertainty: Uncertainty) -> ByLog | None:
    """Return what the differences between the logs say; None for one log."""
    found = _Deletions.at(problem, uncertainty)
    if len(found.columns) < 2:
        return None
    linear, free = uncertainty.linear, uncertainty.linear.varied
    rows = linear.changes  # of the p parameters that vary
    scatters = np.zeros_like(found.shares)
    logs = sorted({channel.log for channel in problem.channels})
    for channel, noise in zip(problem.channels, uncertainty.noise, strict=True):
        scatters[logs.index(channel.log)] += noise.covariance_of(linear.effects[:, channel.rows])
    lost = np.linalg.norm(rows @ found.alone, axis=2) > LOST_PART * np.linalg.norm(rows, axis=1)
    observed = np.sum((found.steps @ rows.T) ** 2, axis=0)
    expected = _expected(found, rows, scatters, linear.prior_scatter)
    mean, square = np.trace(expected, axis1=1, axis2=2), np.sum(expected**2, axis=(1, 2))
    # what the priors say is no less certain where the logs differ
    noise, stated = (
        np.einsum("pk,kl,pl->p", rows, m, rows) for m in (scatters.sum(axis=0), linear.prior_scatter)
    )
    relative, freedom, ratio = np.full((3, len(free)), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):  # 0 / 0 of a parameter without effect: not known
        freedom[free], ratio[free] = mean**2 / square, observed / mean
        widened = np.sqrt((stated + noise * ratio[free]) / (stated + noise))
    relative[free] = np.where(lost.any(axis=0), np.inf, uncertainty.relative[free] * widened)
    out = [s.at_bound is not None or s.source is Source.PRIOR for s in uncertainty.status]
    relative[~np.isfinite(uncertainty.relative) | out] = np.nan
    half = student.ppf(0.5 + COVERAGE / 2, freedom) * relative
    known = np.isfinite(relative)
    differing = known & (chi2.sf(freedom * ratio, freedom) < FALSE_ALARMS / max(known.sum(), 1))
    names = tuple(n for n, differs in zip(problem.parameters.names, differing, strict=True) if differs)
    scale = uncertainty.jacobian.scale
    return ByLog(relative, ends(problem.parameters, uncertainty.theta, scale, half), freedom, names)


def _expected(found: _Deletions, rows: Array, scatters: Array, priors: Array) -> Array:
    """Covariance of the changes d_g of each parameter for the pooled noise, shape (p, G, G).

    The noise n of log h reaches d_g by U_h n: minus A_g times it through the fit, and directly if h is g.
    """
    changes = rows @ found.inverses  # of each parameter per score of log g when it is left out, (G, p, k)
    through = changes @ found.shares
    whole = scatters.sum(axis=0) + priors
    expected = np.einsum("gpk,hpk->pgh", through @ whole, through)
    direct = np.einsum("gpk,hpk->pgh", changes @ scatters, through)
    expected -= direct + direct.transpose(0, 2, 1)
    logs = range(len(scatters))
    expected[:, logs, logs] += np.einsum("gpk,gpk->pg", changes @ scatters, changes)
    return expected
