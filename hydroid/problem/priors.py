"""Priors: single parameters, and linear combinations or ratios of them, that are known besides the logs.

Each has a value and a standard deviation; a combination without one is a constraint. A search stays where
every prior holds within REACH standard deviations. The refinement and the uncertainty take each as one more
measurement.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, record
from hydroid.errors import SettingsError
from hydroid.parameters import ParameterSet, Prior
from hydroid.settings.problem import PriorSettings

REACH = 2.0  # standard deviations that a candidate of a search may be away from a prior
CONSTRAINT_SD = 1e-5
"""standard deviation of a constraint, as a part of the range that its parameters' bounds allow"""
MAX_SWEEPS = 200  # projections on all priors in turn; two that are nearly parallel need the most


@record
class _Combination:
    """A prior on factors·theta, or on a ratio a / b.

    A ratio has the factors of a - value b and the column of b as `divisor`.
    step: the shortest change in the box of the free parameters that raises factors·theta by 1, shape (P,).
    """

    name: str
    factors: Array
    value: float
    sd: float
    divisor: int | None
    step: Array

    def excess(self, theta: Array) -> Array:
        """Distance from the value, shape (n,), times the divisor if any."""
        # the sum along the last axis is the same for any number of rows; a matrix product may not be
        return (theta * self.factors).sum(axis=1) - self.value

    def tolerance(self, theta: Array) -> Array:
        """Excess of one standard deviation, shape (n,)."""
        return self.sd * (np.ones(len(theta)) if self.divisor is None else theta[:, self.divisor])


class Priors:
    """M priors about P parameters, named `names`; those about fixed parameters only are left out.

    Those of single parameters come first. `searched` are the parameters with bounds within REACH of these.
    """

    def __init__(self, settings: Mapping[str, PriorSettings], parameters: ParameterSet) -> None:
        self._own, narrowed = dict[int, Prior](), list(parameters.parameters)
        for column, p in enumerate(parameters.parameters):
            if p.prior is not None and p.fixed is None:
                self._own[column] = p.prior
                low, high = max(p.lower, p.prior.value(-REACH)), min(p.upper, p.prior.value(REACH))
                narrowed[column] = replace(p, lower=low, upper=high)
        self.searched = ParameterSet(tuple(narrowed))
        self._combinations = [
            combination
            for name, prior in settings.items()
            if (combination := _combination(name, prior, self.searched)) is not None
        ]
        self.names = (
            *(parameters.names[column] for column in self._own),
            *(combination.name for combination in self._combinations),
        )
        if self._combinations:
            off = np.abs(self.scores(self.project(self.searched.start[None]))[0])
            worst = np.argmax(off)
            if off[worst] > 1.5 * REACH:
                raise SettingsError(
                    "cannot hold within the bounds together with the other priors",
                    f"priors.{self.names[worst]}",
                    "widen the bounds, correct the value, or give it a larger sd",
                )

    def __len__(self) -> int:
        return len(self.names)

    def scores(self, theta: Array) -> Array:
        """Return the distance from each prior's value in standard deviations; (n, P) -> (n, M)."""
        own = [prior.score(theta[:, column]) for column, prior in self._own.items()]
        return np.array(
            [*own, *(c.excess(theta) / c.tolerance(theta) for c in self._combinations)]
        ).T.reshape(len(theta), len(self))

    def project(self, theta: Array) -> Array:
        """Return theta, (n, P), moved by the shortest steps to within REACH sd of every combination.

        Projections on them in turn (S. Kaczmarz, 1937), within the bounds of `searched`. Each row is moved by
        itself.
        """
        if not self._combinations:
            return theta
        theta, free = theta.copy(), self.searched.free
        low, high = self.searched.lower[free], self.searched.upper[free]
        for _ in range(MAX_SWEEPS):
            before = theta.copy()
            for combination in self._combinations:
                excess, slack = combination.excess(theta), REACH * combination.tolerance(theta)
                beyond = excess - np.clip(excess, -slack, slack)
                theta -= beyond[:, None] * combination.step
                theta[:, free] = np.clip(theta[:, free], low, high)
            if np.array_equal(theta, before):
                break
        return theta


def _combination(name: str, prior: PriorSettings, parameters: ParameterSet) -> _Combination | None:
    """Return a combination; None where all of its parameters are fixed."""
    names, free = parameters.names, parameters.free
    for parameter in prior.factors:
        if parameter not in names:
            hint = f"parameters: {', '.join(names)}"
            raise SettingsError(f"no parameter {parameter!r}", f"priors.{name}", hint)
    factors = np.array([prior.factors.get(n, 0.0) for n in names])
    if not factors[free].any():
        return None
    width = np.where(free, parameters.upper - parameters.lower, 0.0)
    step = factors * width**2 / np.sum((factors * width) ** 2)
    sd = prior.sd or CONSTRAINT_SD * float(np.abs(factors) @ width)
    if prior.ratio is None:
        return _Combination(name, factors, prior.value, sd, None, step)
    divisor = names.index(prior.ratio[1])
    p = parameters.parameters[divisor]
    if (p.lower if p.fixed is None else p.fixed) <= 0:
        raise SettingsError(f"a ratio divides by {p.name}, which may be 0", "priors")
    return _Combination(name, factors, 0.0, sd, divisor, step)
