"""Terms: quantities of the model that a fit holds or has switched off, each as one more parameter."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.hydraulics.actuator import START_PRESSURE
from hydroid.parameters import Array
from hydroid.posterior.open_start import with_open_start
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CHOICES, MECHANICAL, QUANTITIES, ROWS, TARGETS
from hydroid.settings.hydraulics import actuator_values
from hydroid.settings.problem import ParameterSettings


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
    def kind(self) -> tuple[str, tuple[int, ...] | None, str | None]:
        """What it is, with both sides of an actuator alike: the same for `delay` and `delay_a` of a joint."""
        p = self.settings
        return (p.quantity.removesuffix("_a").removesuffix("_b"), p.joints, p.link)

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
            if change <= 0:
                return math.inf
            return low / change
        end = high if high - self.value >= self.value - low else low
        return min(max(self.value + change * (end - self.value), low), high)


def terms(problem: Problem, *, sides: bool = True) -> tuple[Term, ...]:
    """List the terms of a problem: its fixed parameters, then what it does not name.

    Of a quantity with two sides they are both together and, where `sides`, each.
    """
    settings, joints, found = problem.settings, problem.active_joints, list[Term]()
    spans = {name: span for name, (_, span) in _tested(sides=True).items()}
    taken: set[tuple[str, int]] = set()
    for name, p in settings.parameters.items():
        places = p.joints or range(1, len(settings.arm.joints) + 1)
        taken |= {(target, joint) for target in TARGETS[p.quantity] for joint in places}
        if p.fixed is not None:
            # without bounds from a quarter to four times the value
            span = p.bounds or spans.get(p.quantity) or (p.fixed / 4.0, 4.0 * p.fixed)
            low, high = min(span[0], p.fixed), max(span[1], p.fixed)
            if low < high:
                free = p.model_copy(update={"fixed": None, "bounds": (low, high)})
                found.append(Term(name, free, p.fixed, named=True))
    gauged, alone = any(log.pressure is not None for log in problem.logs), len(joints) == 1
    for quantity, (targets, span) in _tested(sides=sides).items():
        pump = CHOICES[quantity].of_the_pump
        if settings.stage == "mech" and quantity not in MECHANICAL:
            continue
        if (pump and alone) or (quantity == "start_pressure" and gauged):
            continue  # the pump of one actuator is no more than its flow limit; the logs may say the pressure
        for joint in (None,) if pump else joints:
            values = {_nominal(problem, target, joint or 1) for target in targets}
            if len(values) == 1 and not any((target, joint or 1) in taken for target in targets):
                name, where = (quantity, None) if joint is None else (f"{quantity}_{joint}", (joint,))
                name = unused(quantity if alone else name, settings.parameters)
                free = ParameterSettings(quantity=quantity, joints=where, bounds=span)
                found.append(Term(name, free, values.pop(), named=False))
    return tuple(found)


def _tested(*, sides: bool) -> dict[str, tuple[tuple[str, ...], tuple[float, float]]]:
    """Targets and span of each quantity to test, by name: both sides of an actuator, then each."""
    spans: dict[str, tuple[tuple[str, ...], tuple[float, float]]] = {}
    for row in ROWS:
        if row.span:
            spans[row.name] = (TARGETS[row.name], row.span)
            spans |= {side: ((side,), row.span) for side in TARGETS[row.name] if side != row.name and sides}
    return spans


def unused(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken."""
    return name if name not in taken else unused(f"{name}_", taken)


def _nominal(problem: Problem, quantity: str, joint: int) -> float:
    """Value of a quantity that no parameter sets; inf of a limit that is switched off."""
    settings = problem.settings
    value = actuator_values(settings.arm.joints[joint - 1].actuator, settings.hydraulics)[quantity]
    if quantity == "start_pressure" and value is None:
        return START_PRESSURE / QUANTITIES[quantity].factor
    return math.inf if value is None else value


class ExtendedModel:
    """A problem at an estimate whose terms can be changed too.

    Attributes:
        terms: the T terms.
        theta: the estimate, shape (P,).
        residual: there [rad], shape (R,).
    """

    def __init__(self, problem: Problem, theta: Array, *, sides: bool = True) -> None:
        self.terms, self.theta = terms(problem, sides=sides), theta
        added: dict[str, tuple[ParameterSettings, float]] = {}
        parts: list[list[str]] = []
        for term in self.terms:
            p, targets = term.settings, TARGETS[term.settings.quantity]
            joint = (p.joints or (0,))[0]
            names = [term.name] if term.named else [f"{target}_of_{joint}" for target in targets]
            parts.append(names)
            if not term.named:
                free = [p.model_copy(update={"quantity": target}) for target in targets]
                added |= {name: (one, term.value) for name, one in zip(names, free, strict=True)}
        settings = problem.settings.with_parameters({name: one for name, (one, _) in added.items()})
        opened = with_open_start(problem, theta).open_starts
        self._problem = problem.varied(settings).with_open_starts(opened)
        names = self._problem.parameters.names
        self._base = np.array([*theta, *(value for _, value in added.values())])
        self._columns = [[names.index(name) for name in part] for part in parts]
        self.residual = self.residuals(theta[None])[0]

    def residuals(self, theta: Array, terms: Sequence[int] = (), changes: Sequence[float] = ()) -> Array:
        """Residuals [rad] at n estimates, (n, P), each with one term changed (`Term.at`): shape (n, R)."""
        rows = np.tile(self._base, (len(theta), 1))
        rows[:, : len(self.theta)] = theta
        for row, i, change in zip(rows, terms, changes, strict=False):
            row[self._columns[i]] = self.terms[i].at(change)
        return self._problem.residuals(rows)
