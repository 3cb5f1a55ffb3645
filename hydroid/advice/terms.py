"""Terms: quantities of the model that a fit holds or has switched off, each as one more parameter."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.arm.model import load_model
from hydroid.hydraulics.actuator import START_PRESSURE
from hydroid.parameters import Array
from hydroid.posterior.open_start import with_open_start
from hydroid.problem.problem import Problem, make_simulation
from hydroid.quantity_table import CHOICES, MECHANICAL, QUANTITIES, ROWS, TARGETS
from hydroid.settings.hydraulics import actuator_values
from hydroid.settings.problem import ParameterSettings
from hydroid.simulation.chain import STOP_REACH

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
        begins: finite value from which it acts, if it is no limit but switched off all the same.
    """

    name: str
    settings: ParameterSettings
    value: float
    named: bool
    begins: float | None = None

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
            if self.begins is not None:
                return self.begins + change * ((low if self.begins == high else high) - self.begins)
            return low / change
        end = high if high - self.value >= self.value - low else low
        return min(max(self.value + change * (end - self.value), low), high)


def terms(problem: Problem, theta: Array, *, sides: bool = True) -> tuple[Term, ...]:
    """List the terms of a problem at an estimate: its fixed parameters, then what it does not name.

    Of a quantity with two sides they are both together and, where `sides`, each.
    """
    settings = problem.settings
    held = [
        Term(name, p.model_copy(update={"fixed": None, "bounds": span}), p.fixed, named=True)
        for name, p in settings.parameters.items()
        if p.fixed is not None and (span := _span(p))
    ]
    everyone = range(1, len(settings.arm.joints) + 1)
    taken = {
        (target, joint)
        for p in settings.parameters.values()
        for target in TARGETS[p.quantity]
        for joint in p.joints or everyone
    }
    off: list[Term] = []
    joints = problem.active_joints
    for quantity, (targets, span) in _spans(settings.stage, sides=sides).items():
        pump = CHOICES[quantity].of_the_pump
        if pump and len(joints) == 1:
            continue  # the pump of one actuator is no more than its flow limit
        if quantity == "start_pressure" and any(log.pressure is not None for log in problem.logs):
            continue  # the logs may say it
        for joint in (None,) if pump else joints:
            values = {_nominal(problem, target, joint or 1) for target in targets}
            if len(values) == 1 and not any((target, joint or 1) in taken for target in targets):
                name = quantity if pump or len(joints) == 1 else f"{quantity}_{joint}"
                where = None if joint is None else (joint,)
                free = ParameterSettings(quantity=quantity, joints=where, bounds=span)
                off.append(Term(unused(name, settings.parameters), free, values.pop(), named=False))
    if settings.stage == "hyd":
        free = [j for j in joints if not taken & {("trapped_pressure", j), ("start_pressure", j)}]
        off += [term for joint in free if (term := _trapped(problem, theta, joint))]
    return (*held, *off)


def _trapped(problem: Problem, theta: Array, joint: int) -> Term | None:
    """Pressure trapped at a stop: less of a load than the oil carries so far, the stop the rest.

    None where no log starts at a stop, or where the settings say it.
    """
    arm, j = problem.settings.arm, joint - 1
    actuator, most = arm.joints[j].actuator, QUANTITIES["supply_pressure"]
    if actuator is None or problem.settings.hydraulics.trapped_pressure is not None:
        return None
    for log in problem.logs:
        room = abs(np.array([arm.lower[j], arm.upper[j]]) - log.start[j])
        if log.driven[j] and room.min() <= STOP_REACH:
            spec = load_model(arm)
            simulation = make_simulation(spec, log, problem.outputs, problem.settings)
            traced = simulation.trace(problem.bindings.candidates(theta[None]))
            carried = float(traced.pressure[0, simulation.joints == j, 0][0]) / most.factor
            # chamber A lifts off the lower stop, unless the cylinder runs out towards negative angles
            less = (room[0] < room[1]) == (getattr(actuator, "sense", 1.0) > 0)
            span = (0.0, carried) if less else (carried, problem.settings.hydraulics.supply_pressure)
            name = "trapped_pressure" if len(problem.active_joints) == 1 else f"trapped_pressure_{joint}"
            if span[0] < span[1]:
                free = ParameterSettings(quantity="trapped_pressure", joints=(joint,), bounds=span)
                name = unused(name, problem.settings.parameters)
                return Term(name, free, math.inf, named=False, begins=carried)
    return None


def _spans(stage: str, *, sides: bool) -> dict[str, tuple[tuple[str, ...], tuple[float, float]]]:
    """Targets and span of each quantity to test, by name: both sides of an actuator, then each."""
    spans: dict[str, tuple[tuple[str, ...], tuple[float, float]]] = {}
    for row in ROWS:
        if row.span and (stage == "hyd" or row.name in MECHANICAL):
            spans[row.name] = (TARGETS[row.name], row.span)
            spans |= {side: ((side,), row.span) for side in TARGETS[row.name] if side != row.name and sides}
    return spans


def _span(parameter: ParameterSettings) -> tuple[float, float] | None:
    """Span of a parameter that is held; None where it is held at 0 without bounds."""
    value, known = (
        parameter.fixed or 0.0,
        {name: span for name, (_, span) in _spans("hyd", sides=True).items()},
    )
    span = parameter.bounds or known.get(parameter.quantity) or (value / HELD_SPAN, HELD_SPAN * value)
    low, high = min(span[0], value), max(span[1], value)
    return (low, high) if low < high else None


def unused(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken."""
    return name if name not in taken else unused(f"{name}_", taken)


def _nominal(problem: Problem, quantity: str, joint: int) -> float:
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
        self.terms, self.theta = terms(problem, theta, sides=sides), theta
        added: dict[str, tuple[ParameterSettings, float]] = {}
        parts: list[list[str]] = []
        for term in self.terms:
            joint = (term.settings.joints or (0,))[0]
            targets = TARGETS[term.settings.quantity]
            parts.append([term.name] if term.named else [f"{target}_of_{joint}" for target in targets])
            for part, target in zip(parts[-1], targets, strict=False):
                if not term.named:
                    added[part] = term.settings.model_copy(update={"quantity": target}), term.value
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
