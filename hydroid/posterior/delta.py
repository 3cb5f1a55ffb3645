"""The delta method: how precisely functions of the parameters are known.

Let g, shape (p,), be the derivatives of a quantity per relative change of the free parameters, and C their
covariance. To first order its variance is g' C g (G. W. Oehlert, *A note on the delta method*, 1992). With
C^-1 = G' G and G = U D V this is the sum of (V g)_i² / D_i² over the measured directions. A direction that
nothing measures has D_i = 0: it does no harm where the quantity does not change along it, and leaves the
quantity undetermined where it does.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm as normal

from hydroid.errors import RunError
from hydroid.estimate import Covariance
from hydroid.identified_model import IdentifiedModel
from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.axes import RANK_TOLERANCE, changed, covariance_axes, room
from hydroid.posterior.covariance import COVERAGE, NULL_COMPONENT, Uncertainty
from hydroid.posterior.flags import UNIDENTIFIABLE_ABOVE

STEP = 0.1
"""step of the differences in standard deviations: wide enough for the small jumps that events make"""
GIVEN_BELOW = 1e-3
"""relative change per relative change of any free parameter, below which the settings give a quantity"""
_NORMAL = float(normal.ppf(0.5 + COVERAGE / 2))


@dataclass(frozen=True, eq=False)
class Known:
    """Some quantities at an estimate.

    Attributes:
        value: shape (m,); NaN where it does not exist.
        sd: standard deviation, shape (m,): infinite where not determined, NaN where unknown.
        interval: of 95 %, shape (m, 2); infinite where not determined.
        given: quantities that no free parameter changes, shape (m,).
        slopes: derivatives per relative change of the free parameters, shape (p, m).
    """

    value: Array
    sd: Array
    interval: Array
    given: NDArray[np.bool_]
    slopes: Array


@dataclass(frozen=True, eq=False)
class Precision:
    """What is known of P parameters, p of them free, at an estimate.

    Attributes:
        parameters: names and bounds.
        theta: the estimate, shape (P,).
        scale: what a relative change of 1 is, shape (P,).
        root: G of C^-1 = G' G, shape (p, p).
        quantile: half a 95 % interval, in standard deviations.
    """

    parameters: ParameterSet
    theta: Array
    scale: Array
    root: Array
    quantile: float

    def covariance(self) -> Covariance:
        """Return what a file keeps of it."""
        free = self.parameters.free
        names = tuple(n for n, each in zip(self.parameters.names, free, strict=True) if each)
        root = tuple(tuple(row) for row in self.root.tolist())
        scale = tuple(self.scale[free].tolist())
        return Covariance(parameters=names, scale=scale, root=root, quantile=self.quantile)

    def propagate(
        self,
        function: Callable[[Array], Array],
        positive: NDArray[np.bool_] | bool,
        concerned: NDArray[np.bool_] | None = None,
    ) -> Known:
        """Return the quantities that a function of the parameters, (n, P) -> (n, m), gives at the estimate.

        Args:
            function: is called with the estimate, and with all points of the differences at once.
            positive: which quantities cannot be negative, shape (m,).
            concerned: parameters on which any of them can depend, shape (P,); None: all.
        """
        free = self.parameters.free
        varied = np.flatnonzero(free if concerned is None else free & concerned)
        value = function(self.theta[None])[0]
        slopes = np.zeros((int(free.sum()), len(value)))
        if len(varied):
            inside = np.isin(np.flatnonzero(free), varied)
            within = room(self.parameters, self.theta, self.scale)[:, inside]
            axes = covariance_axes(self._root_of(inside), within, STEP)

            def moved(relative: Array) -> Array:
                changes = np.zeros((len(relative), len(self.theta)))
                changes[:, varied] = relative * self.scale[varied]
                return function(changed(self.parameters, self.theta, changes))

            slopes[inside] = axes.by_parameter(axes.slopes(moved, value))
        return self.known(value, slopes, positive)

    def _root_of(self, inside: NDArray[np.bool_]) -> Array:
        """Return G, shape (p, k), of the covariance of some of the free parameters, shape (p,)."""
        left, values, _ = np.linalg.svd(self.root[:, ~inside], full_matrices=False)
        left = left[:, values > RANK_TOLERANCE * values.max(initial=0.0)]
        own = self.root[:, inside]
        return own - left @ (left.T @ own)  # what the others cannot do as well

    def parts(self, slopes: Array) -> Array:
        """What each independent, known direction does, shape (k, m), from derivatives, shape (p, m).

        The sum of their squares is the variance along the known directions.
        """
        _, values, directions = np.linalg.svd(self.root)
        measured = values > RANK_TOLERANCE * values.max(initial=0.0)
        return (directions[measured] @ slopes) / values[measured, None]

    def deviation(self, slopes: Array) -> Array:
        """Standard deviations, shape (m,), from derivatives per relative change, shape (p, m)."""
        _, values, directions = np.linalg.svd(self.root)
        measured = values > RANK_TOLERANCE * values.max(initial=0.0)
        parts, known = directions @ slopes, np.linalg.norm(self.parts(slopes), axis=0)
        lost = np.linalg.norm(parts[~measured], axis=0) > NULL_COMPONENT * np.linalg.norm(slopes, axis=0)
        return np.where(lost, np.inf, known)

    def known(self, value: Array, slopes: Array, positive: NDArray[np.bool_] | bool) -> Known:
        """Return quantities, (m,), with intervals from their derivatives, (p, m).

        The interval of a `positive` quantity, (m,), is multiplicative. It has no limits where the standard
        deviation exceeds the value, as that of a parameter: a first-order interval then means nothing.
        """
        sd = self.deviation(slopes)
        half = self.quantile * sd
        interval = np.stack([value - half, value + half], axis=1)
        logarithmic = positive & (value > 0)
        with np.errstate(over="ignore"):
            factor = np.exp(half[logarithmic] / value[logarithmic])
        interval[logarithmic] = np.stack([value[logarithmic] / factor, value[logarithmic] * factor], axis=1)
        lost = logarithmic & (half > UNIDENTIFIABLE_ABOVE * _NORMAL * value)
        sd[lost] = np.inf
        interval[np.isposinf(sd)] = -np.inf, np.inf
        interval[np.isposinf(sd) & positive] = 0.0, np.inf
        return Known(value, sd, interval, np.all(abs(slopes) <= GIVEN_BELOW * abs(value), axis=0), slopes)


def precision(parameters: ParameterSet, uncertainty: Uncertainty) -> Precision:
    """Return the precision of a fit's estimate."""
    quantile = float(np.nanmax(uncertainty.quantile))  # a quantity may depend on the least known direction
    scale = uncertainty.jacobian.scale
    return Precision(parameters, uncertainty.theta, scale, uncertainty.root, quantile)


def stored_precision(model: IdentifiedModel) -> Precision | None:
    """Return the precision that a fit kept; None where there is none for these parameters.

    Parameters that the settings no longer free, or whose values changed, are not the fit's.
    """
    covariance = None if model.summary is None else model.summary.covariance
    if model.summary is None or covariance is None:
        return None
    parameters, values = model.settings.parameter_set(), model.summary.values
    free = [n for n, each in zip(parameters.names, parameters.free, strict=True) if each]
    if tuple(free) != covariance.parameters or any(model.values[n] != values.get(n) for n in free):
        return None
    scale = np.zeros(len(model.theta))
    scale[parameters.free] = covariance.scale
    return Precision(parameters, model.theta, scale, np.array(covariance.root), covariance.quantile)


def required_precision(model: IdentifiedModel) -> Precision:
    """Return the precision that a fit kept.

    Raises:
        RunError: there is none for these parameters.
    """
    found = stored_precision(model)
    if found is None:
        hint = "name the folder of a fit, with the settings that it used"
        raise RunError("holds no covariance of these parameters", where=model.source, hint=hint)
    return found
