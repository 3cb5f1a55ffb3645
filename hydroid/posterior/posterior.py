"""What is known of the parameters: one Gaussian posterior, and what follows from it by
the delta method.

It is about relative changes v of the parameters that vary, with C^-1 = G' G: a change
is |G v| standard deviations long. A weak prior on every parameter (`WEAK_PRIOR`) makes G regular. A
direction that nothing measures keeps the prior's standard deviation, which no result
can be mistaken for.

Let g be the derivatives of a quantity per relative change. To first order its variance
is g' C g = |G^-T g|² (G. W. Oehlert, *A note on the delta method*, 1992).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import norm as normal

from hydroid.arrays import Array, Ints, Mask, record
from hydroid.estimate import Covariance
from hydroid.identified_model import IdentifiedModel
from hydroid.parameters import ParameterSet
from hydroid.search.axes import Axes, Box, covariance_axes, differentiate

# relative standard deviation above which a linear interval means nothing
UNIDENTIFIABLE_ABOVE = 1.0
COVERAGE = 0.95  # probability with which an interval covers the true value
NORMAL = float(normal.ppf(0.5 + COVERAGE / 2))
"""half the interval of a normal estimate of known variance, in standard deviations"""
# relative standard deviation of every parameter before any log and any stated prior
# (ours)
WEAK_PRIOR = 10.0
# step of the differences in standard deviations: wide enough for the small jumps that
# events make
STEP = 0.1


@record
class Estimated:
    """Some quantities at an estimate, shape (m,), NaN where one does not exist.

    `sd` is infinite where not determined, NaN where unknown; `interval` is of 95 %, (m,
    2); no parameter changes those that are `given`. `slopes` are derivatives per relative
    change of the p parameters that vary, (p, m).
    """

    value: Array
    sd: Array
    interval: Array
    given: Mask
    slopes: Array


@record
class Posterior:
    """What is known of p parameters that vary together at an estimate.

    `root` is G, upper triangular and regular, (p, p); `quantile` half a 95 % interval
    in standard deviations.
    """

    box: Box
    root: Array
    quantile: float = NORMAL

    @cached_property
    def covariance(self) -> Array:
        """Of relative changes, shape (p, p)."""
        inverse = solve_triangular(self.root, np.eye(len(self.root)))
        return inverse @ inverse.T

    @property
    def deviations(self) -> Array:
        """Relative standard deviation of each parameter that varies, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def parts(self, slopes: Array) -> Array:
        """Return what each of p independent directions does to quantities, (p, m), from
        derivatives, (p, m).

        The sum of their squares is the variance.
        """
        return solve_triangular(self.root.T, slopes, lower=True)

    def sd(self, slopes: Array) -> Array:
        """Return the standard deviations of quantities, shape (m,), from derivatives
        per relative change, (p, m).

        NaN of a quantity with a derivative that is not finite: a change of a parameter
        leads where it has no value.
        """
        finite = np.isfinite(slopes).all(axis=0)
        deviations = np.linalg.norm(self.parts(np.where(finite, slopes, 0.0)), axis=0)
        return np.where(finite, deviations, np.nan)

    def add(self, rows: Array) -> "Posterior":
        """Return it with information rows' rows, (k, p): derivatives per relative
        change over their sd."""
        return replace(self, root=regular(np.vstack([self.root, rows])))

    def axes(self, step: float, owner: Ints | None = None) -> Axes:
        """Return steps of so many standard deviations along the axes of the covariance,
        of all parameters, or of each owner's, (p,), by `covariance_axes`."""
        return covariance_axes(self.box, self.root, step, owner)

    def marginal(self, chosen: Mask) -> "Posterior":
        """Return what is known of some of the parameters, shape (P,), whatever the
        others are."""
        inside = chosen[self.box.varied]
        # with the others first, the last block of the triangle is the root of what is
        # left (Schur complement)
        others_first = np.argsort(inside, kind="stable")
        triangle = regular(self.root[:, others_first])
        others = np.sum(~inside)
        root = triangle[others:, others:]
        return replace(self, box=self.box.restricted(inside), root=root)

    def propagate(
        self,
        function: Callable[[Array], Array],
        positive: Mask | bool,
        concerned: Mask | None = None,
    ) -> Estimated:
        """Return the quantities that a function of the parameters, (n, P) -> (n, m),
        gives at the estimate.

        It is called with the estimate, and with all points of the differences at once.
        The interval of a `positive` quantity, (m,), is multiplicative. A quantity is
        not determined where parameters known to 100 % each would determine it as well,
        or where the standard deviation of a positive one exceeds the value: a
        first-order interval then means nothing. `concerned` are parameters on which any
        can depend, shape (P,); None: all.
        """
        if concerned is None:
            concerned = np.ones_like(self.box.varied)
        marginal = self.marginal(concerned)
        inside = concerned[self.box.varied]
        value = function(self.box.at[None])[0]
        slopes = np.zeros((len(inside), len(value)))
        if inside.any():
            axes = marginal.axes(STEP)
            slopes[inside] = differentiate(function, marginal.box, axes, value)
        sd = self.sd(slopes)
        logarithmic = positive & (value > 0)
        lost = sd > UNIDENTIFIABLE_ABOVE * np.linalg.norm(slopes, axis=0)
        half = self.quantile * sd
        lost |= logarithmic & (half > UNIDENTIFIABLE_ABOVE * NORMAL * value)
        sd[lost] = np.inf
        ends = interval(value, self.quantile * sd, logarithmic)
        ends[lost & positive, 0] = 0.0
        # a relative change by less than a thousandth of a parameter's: the settings
        # give it
        given = np.all(abs(slopes) <= 1e-3 * abs(value), axis=0)
        return Estimated(value, sd, ends, given, slopes)

    def stored(self, parameters: ParameterSet) -> Covariance:
        """Return what a file keeps of it."""
        varied = self.box.varied
        return Covariance(
            parameters=parameters.named(varied),
            scale=tuple(self.box.scale[varied].tolist()),
            root=tuple(map(tuple, self.root.tolist())),
            quantile=self.quantile,
        )


def interval(value: Array, half: Array, multiplicative: Mask) -> Array:
    """Return ends, (m, 2), value ± half, or value times and over exp(half / value),
    from shapes (m,)."""
    with np.errstate(all="ignore"):
        factor = np.exp(np.where(multiplicative, half / value, 0.0))
    change = np.where(multiplicative, 0.0, half)
    low = value / factor - change
    high = value * factor + change
    return np.stack([low, high], axis=1)


def regular(rows: Array) -> Array:
    """Return the upper triangle G, (p, p), of G' G = rows' rows, from rows of full
    rank, shape (k, p)."""
    triangle = np.asarray(np.linalg.qr(rows, mode="r"), dtype=float)
    # the factorisation leaves the rows' signs open
    signs = np.where(np.diag(triangle) < 0, -1.0, 1.0)
    return triangle * signs[:, None]


def stored_posterior(model: IdentifiedModel) -> Posterior | None:
    """Return the posterior that a fit kept; None where there is none for these
    parameters.

    Those that the settings no longer free, or whose values changed, are not the fit's.
    """
    summary = model.summary
    if summary is None or summary.covariance is None:
        return None
    parameters = model.settings.parameter_set()
    covariance = summary.covariance
    fitted = summary.estimate
    free = {*parameters.named(parameters.free)}
    for name in free:
        if name not in fitted or model.values[name] != fitted[name].value:
            return None
    # those at a bound were held, so that no covariance has them
    held = {name for name in free if fitted[name].at_bound}
    if not free - held <= set(covariance.parameters) <= free:
        return None
    varied = np.isin(parameters.names, covariance.parameters)
    scale = np.zeros(len(varied))
    scale[varied] = covariance.scale
    box = Box(model.theta, parameters.lower, parameters.upper, scale, varied)
    return Posterior(box, np.array(covariance.root), covariance.quantile)
