"""What is known besides the logs: linear statements about parameters, each with its standard deviation.

A search stays where every statement holds within REACH standard deviations; the refinement and the uncertainty
take a statement as one more measurement.
"""

from collections.abc import Mapping

import numpy as np

from hydroid.errors import SettingsError
from hydroid.parameters import Array, ParameterSet
from hydroid.settings.problem import PriorSettings

REACH = 2.0
"""standard deviations that a search may be off a statement"""
EXACT = 1e-5
"""an exact statement's standard deviation, as a part of what its parameters' bounds leave open"""
SWEEPS = 200
"""projections on all statements in turn; two that are nearly parallel take the most"""


class Priors:
    """M statements about P parameters; those about fixed ones only say nothing here.

    Args:
        settings: the statements by name.
        parameters: the parameters.

    Attributes:
        names: of the M statements.

    Raises:
        SettingsError: a parameter that does not exist, or statements that the bounds contradict.
    """

    def __init__(self, settings: Mapping[str, PriorSettings], parameters: ParameterSet) -> None:
        self._parameters = parameters
        for name, statement in settings.items():
            for parameter in statement.factors:
                if parameter not in parameters.names:
                    hint = f"known: {', '.join(parameters.names)}"
                    raise SettingsError(f"no parameter {parameter!r}", where=f"priors.{name}", hint=hint)
        free = {n for n, is_free in zip(parameters.names, parameters.free, strict=True) if is_free}
        active = {name: s for name, s in settings.items() if free & set(s.factors)}
        self.names = tuple(active)
        self._factors = np.array(
            [[s.factors.get(n, 0.0) for n in parameters.names] for s in active.values()]
        ).reshape(len(active), len(parameters.names))
        self._value = np.array([0.0 if s.ratio else s.value for s in active.values()])
        # of a ratio: the column of what is divided by, which turns a - value b into a / b - value
        self._divisor = [parameters.names.index(s.ratio[1]) if s.ratio else None for s in active.values()]
        width = np.where(parameters.free, parameters.upper - parameters.lower, 0.0)
        open_ = np.abs(self._factors) @ width
        self._sd = np.array([s.sd or EXACT * o for s, o in zip(active.values(), open_, strict=True)])
        self._steps = np.zeros_like(self._factors)
        if len(active):
            # the shortest way in the box of the free parameters that changes a statement by 1
            self._steps = self._factors * width**2 / np.sum((self._factors * width) ** 2, axis=1)[:, None]
        self._refuse_contradictions()

    def __len__(self) -> int:
        return len(self.names)

    def scores(self, theta: Array) -> Array:
        """Return (what theta makes of each statement - what is known) / sd; (n, P) -> (n, M)."""
        scores = np.empty((len(theta), len(self)))
        for m, divisor in enumerate(self._divisor):
            scores[:, m] = self._excess(theta, m) / self._tolerance(theta, m, divisor)
        return scores

    def project(self, theta: Array) -> Array:
        """Return theta, (n, P), moved by the shortest ways to within REACH sd of every statement.

        Projections on the statements in turn (Kaczmarz), within the bounds; a row depends on itself alone.
        """
        if not len(self):
            return theta
        theta, free = theta.copy(), self._parameters.free
        low, high = self._parameters.lower[free], self._parameters.upper[free]
        for _ in range(SWEEPS):
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
        # a sum along the last axis: a matrix product may round by the number of rows
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
                "cannot hold within the bounds and beside the other statements",
                where=f"priors.{self.names[worst]}",
                hint="widen the bounds, correct the value, or give it a larger sd",
            )
