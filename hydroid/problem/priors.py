"""Priors: linear combinations or ratios of parameters that are known besides the logs.

Each has a value and a standard deviation; without one it is a constraint. A search stays where every prior
holds within REACH standard deviations. The refinement and the uncertainty take it as one more measurement.
"""

from collections.abc import Mapping

import numpy as np

from hydroid.errors import SettingsError
from hydroid.parameters import Array, ParameterSet
from hydroid.settings.problem import PriorSettings

REACH = 2.0
"""standard deviations that a candidate of a search may be away from a prior"""
CONSTRAINT_SD = 1e-5
"""standard deviation of a constraint, as a part of the range that its parameters' bounds allow"""
MAX_SWEEPS = 200
"""projections on all priors in turn; two that are nearly parallel need the most"""


class Priors:
    """M priors about P parameters, named `names`; those about fixed parameters only are left out.

    Raises:
        SettingsError: a parameter that does not exist, or priors that the bounds contradict.
    """

    def __init__(self, settings: Mapping[str, PriorSettings], parameters: ParameterSet) -> None:
        self._parameters = parameters
        for name, prior in settings.items():
            for parameter in prior.factors:
                if parameter not in parameters.names:
                    hint = f"parameters: {', '.join(parameters.names)}"
                    raise SettingsError(f"no parameter {parameter!r}", where=f"priors.{name}", hint=hint)
        free = {n for n, is_free in zip(parameters.names, parameters.free, strict=True) if is_free}
        active = {name: s for name, s in settings.items() if free & set(s.factors)}
        self.names = tuple(active)
        self._factors = np.array(
            [[s.factors.get(n, 0.0) for n in parameters.names] for s in active.values()]
        ).reshape(len(active), len(parameters.names))
        self._value = np.array([0.0 if s.ratio else s.value for s in active.values()])
        # column of a ratio's denominator b, which turns a - value b into a / b - value
        self._divisor = [parameters.names.index(s.ratio[1]) if s.ratio else None for s in active.values()]
        width = np.where(parameters.free, parameters.upper - parameters.lower, 0.0)
        open_ = np.abs(self._factors) @ width
        self._sd = np.array([s.sd or CONSTRAINT_SD * o for s, o in zip(active.values(), open_, strict=True)])
        self._steps = np.zeros_like(self._factors)
        if len(active):
            # the shortest step in the box of the free parameters that changes a prior's left side by 1
            self._steps = self._factors * width**2 / np.sum((self._factors * width) ** 2, axis=1)[:, None]
        self._refuse_contradictions()

    def __len__(self) -> int:
        return len(self.names)

    def scores(self, theta: Array) -> Array:
        """Return (left side at theta - value) / sd of each prior; (n, P) -> (n, M)."""
        scores = np.empty((len(theta), len(self)))
        for m, divisor in enumerate(self._divisor):
            scores[:, m] = self._excess(theta, m) / self._tolerance(theta, m, divisor)
        return scores

    def project(self, theta: Array) -> Array:
        """Return theta, (n, P), moved by the shortest steps to within REACH sd of every prior.

        Projections on the priors in turn (S. Kaczmarz, 1937), within the bounds. Each row is moved by itself.
        """
        if not len(self):
            return theta
        theta, free = theta.copy(), self._parameters.free
        low, high = self._parameters.lower[free], self._parameters.upper[free]
        for _ in range(MAX_SWEEPS):
            before = theta.copy()
            for m, divisor in enumerate(self._divisor):
                excess, slack = self._excess(theta, m), REACH * self._tolerance(theta, m, divisor)
                beyond = excess - np.clip(excess, -slack, slack)
                theta -= beyond[:, None] * self._steps[m]
                theta[:, free] = np.clip(theta[:, free], low, high)
            if np.array_equal(theta, before):
                break
        return theta

    def _excess(self, theta: Array, m: int) -> Array:
        # the sum along the last axis is the same for any number of rows; a matrix product may not be
        return (theta * self._factors[m]).sum(axis=1) - self._value[m]

    def _tolerance(self, theta: Array, m: int, divisor: int | None) -> Array:
        return self._sd[m] * (np.ones(len(theta)) if divisor is None else theta[:, divisor])

    def _refuse_contradictions(self) -> None:
        divisors = {d for d in self._divisor if d is not None}
        for column in divisors:
            p = self._parameters.parameters[column]
            if (p.lower if p.fixed is None else p.fixed) <= 0:
                raise SettingsError(f"a ratio divides by {p.name}, which may be 0", where="priors")
        if not len(self):
            return
        centre = self._parameters.from_unit(np.full((1, int(self._parameters.free.sum())), 0.5))
        off = np.abs(self.scores(self.project(centre))[0])
        worst = int(np.argmax(off))
        if off[worst] > 1.5 * REACH:
            raise SettingsError(
                "cannot hold within the bounds together with the other priors",
                where=f"priors.{self.names[worst]}",
                hint="widen the bounds, correct the value, or give it a larger sd",
            )
