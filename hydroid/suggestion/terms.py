"""Terms: quantities of the model that a fit holds or has switched off, each as one more parameter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.hydraulics.records import nominal_parameters
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.settings.hydraulics import QUANTITIES, SPANS
from hydroid.settings.problem import MECHANICAL_SPANS, ParameterSettings

HELD_SPAN = 4.0
"""a parameter that is held without bounds is tested from a quarter to four times its value"""


@dataclass(frozen=True)
class Term:
    """One quantity that is not estimated.

    Attributes:
        name: of the parameter that it is, or would be.
        settings: of that parameter, free, with the span of its values as bounds.
        value: that the model has now; inf of a limit that is switched off.
        named: whether it is a parameter of the fit, held fixed.
    """

    name: str
    settings: ParameterSettings
    value: float
    named: bool

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest value."""
        assert self.settings.bounds is not None
        return self.settings.bounds

    @property
    def lowest_change(self) -> float:
        """Change that leads to the nearer end of the span, from -1; 0 where the value lies there."""
        low, high = self.span
        if math.isinf(self.value):
            return 0.0
        one, other = high - self.value, self.value - low
        return -min(one, other) / max(one, other)

    def at(self, change: float) -> float:
        """Return the value after a change: 1 is the whole way to the farther end of the span.

        A limit that is switched off changes by its reciprocal.
        """
        low, high = self.span
        if math.isinf(self.value):
            return low / change if change > 0 else math.inf
        end = high if high - self.value >= self.value - low else low
        return min(max(self.value + change * (end - self.value), low), high)


def terms(problem: Problem) -> tuple[Term, ...]:
    """List the terms of a problem: its fixed parameters, then what it does not name, joint by joint."""
    settings = problem.settings
    held = [
        Term(name, p.model_copy(update={"fixed": None, "bounds": span}), p.fixed, named=True)
        for name, p in settings.parameters.items()
        if p.fixed is not None and (span := _span(p))
    ]
    everyone = range(1, len(settings.arm.joints) + 1)
    taken = {(p.quantity, j) for p in settings.parameters.values() for j in p.joints or everyone}
    joints = problem.active_joints
    spans = MECHANICAL_SPANS | (SPANS if settings.stage == "hyd" else {})
    off = [
        Term(
            _name(quantity, joint, [*joints], settings.parameters),
            ParameterSettings(quantity=quantity, joints=(joint,), bounds=span),
            _nominal(problem, quantity, joint),
            named=False,
        )
        for joint in joints
        for quantity, span in spans.items()
        if (quantity, joint) not in taken
    ]
    return (*held, *off)


def _span(parameter: ParameterSettings) -> tuple[float, float] | None:
    value = parameter.fixed or 0.0
    spans = SPANS | MECHANICAL_SPANS
    span = parameter.bounds or spans.get(parameter.quantity) or (value / HELD_SPAN, HELD_SPAN * value)
    low, high = min(span[0], value), max(span[1], value)
    return (low, high) if low < high else None


def _name(quantity: str, joint: int, joints: Sequence[int], taken: object) -> str:
    name = quantity if len(joints) == 1 else f"{quantity}_{joint}"
    while name in taken:  # pyright: ignore[reportOperatorIssue]
        name += "_"
    return name


def _nominal(problem: Problem, quantity: str, joint: int) -> float:
    if quantity not in QUANTITIES:
        return 0.0
    row = nominal_parameters(problem.settings.arm, problem.settings.hydraulics, [joint - 1])[0, 0]
    return float(row[quantity] / QUANTITIES[quantity].factor)


class ExtendedModel:
    """A problem at an estimate whose terms can be changed too.

    Attributes:
        terms: the T terms.
        theta: the estimate, shape (P,).
        residual: there [rad], shape (R,).
    """

    def __init__(self, problem: Problem, theta: Array) -> None:
        self.terms, self.theta = terms(problem), theta
        self._problem = problem.extended({t.name: t.settings for t in self.terms if not t.named})
        values = {t.name: t.value for t in self.terms}
        names = self._problem.parameters.names
        self._base = np.array([*theta, *(values[n] for n in names[len(theta) :])])
        self._columns = [names.index(t.name) for t in self.terms]
        self.residual = self.residuals(theta[None])[0]

    def residuals(self, theta: Array, terms: Sequence[int] = (), changes: Sequence[float] = ()) -> Array:
        """Residuals [rad] at n estimates, (n, P), each with one term changed (`Term.at`): shape (n, R)."""
        rows = np.tile(self._base, (len(theta), 1))
        rows[:, : len(self.theta)] = theta
        for row, i, change in zip(rows, terms, changes, strict=False):
            row[self._columns[i]] = self.terms[i].at(change)
        return self._problem.residuals(rows)
