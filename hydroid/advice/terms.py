"""Terms: changes of the settings that give a model one more parameter.

A term is a quantity that the fit holds fixed, one that it leaves at its nominal value, or the share
of one side or joint in a parameter that serves several.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hydroid.arrays import Array, record
from hydroid.hydraulics.actuator import START_PRESSURE
from hydroid.posterior.error_model import Likelihood
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CHOICES, MECHANICAL, QUANTITIES, ROWS, TARGETS
from hydroid.settings.fit import FitSettings
from hydroid.settings.hydraulics import actuator_values
from hydroid.settings.problem import ParameterSettings


@record
class Term:
    """One more free parameter: the settings' entries that add it,
    its own and that of what it is split from.

    `value` is what it has now; inf of a limit that is switched off.
    """

    name: str
    entries: Mapping[str, ParameterSettings]
    value: float

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest value."""
        bounds = self.entries[self.name].bounds
        assert bounds is not None
        return bounds

    def added_to(self, problem: Problem) -> Problem:
        """Return a problem with the parameter free."""
        return problem.varied(problem.settings.with_parameters(self.entries))

    def theta(self, problem: Problem, theta: Array, value: float) -> Array:
        """Return an estimate of a problem, (P,), for the problem `added_to`,
        with the term at a value."""
        values = problem.parameters.mapping(theta) | {self.name: value}
        return np.array([values[name] for name in problem.settings.parameters | dict(self.entries)])

    def innovations(self, likelihood: Likelihood, theta: Array, values: Sequence[float]) -> Array:
        """Innovations of a likelihood at an estimate, (P,), with the term at n values, shape (n,
        R)."""
        problem = likelihood.problem
        thetas = np.array([self.theta(problem, theta, value) for value in values])
        return likelihood.errors.innovations(self.added_to(problem).output_errors(thetas))

    @property
    def kind(self) -> tuple[object, ...]:
        """What it is, with both sides of an actuator alike:
        the same for `delay` and `delay_a` of a joint."""
        own = self.entries[self.name]
        return own.quantity.removesuffix("_a").removesuffix("_b"), own.joints, own.link


def terms(problem: Problem, theta: Array) -> tuple[Term, ...]:
    """List the terms of a problem at theta, shape (P,)."""
    return (*_held(problem), *_split(problem, theta), *_nominal(problem))


def _held(problem: Problem) -> Iterator[Term]:
    for name, p in problem.settings.parameters.items():
        if p.fixed is not None and _means_something(problem, p):
            # without bounds from a quarter to four times the value
            low, high = p.bounds or CHOICES[p.quantity].span or (p.fixed / 4.0, 4.0 * p.fixed)
            span = min(low, p.fixed), max(high, p.fixed)
            if span[0] < span[1]:
                yield Term(name, {name: p.changed({"fixed": None, "bounds": span})}, p.fixed)


def _means_something(problem: Problem, p: ParameterSettings) -> bool:
    """Whether what moves the joints has such a quantity,
    and an effect of a group has logs beside it."""
    acts_on = joints_of(problem.settings, p)
    groups = {problem.settings.log.group_of(log.source) for log in problem.logs}
    if p.per is not None and (p.per not in groups or len(groups) == 1):
        return False
    return not acts_on or bool(_moving(problem, p.quantity, acts_on))


def _moving(problem: Problem, quantity: str, joints: Iterable[int]) -> tuple[int, ...]:
    """Return those of some joints that move, by an actuator that has the quantity."""
    every = problem.settings.arm.joints
    return tuple(j for j in joints if j in problem.active_joints and every[j - 1].has(quantity))


def _split(problem: Problem, theta: Array) -> Iterator[Term]:
    """Yield the share of side B, or of one joint that moves,
    in a free parameter that serves several."""
    settings = problem.settings
    for parameter, value in zip(problem.parameters.parameters, theta.tolist(), strict=True):
        name, p = parameter.name, settings.parameters[parameter.name]
        if p.fixed is not None or p.per is not None:
            continue
        sides, joints, parts = TARGETS[p.quantity], joints_of(settings, p), dict[str, list[dict[str, Any]]]()
        if len(sides) == 2:
            parts["b"] = [{"quantity": side} for side in sides]
        if len(moving := _moving(problem, p.quantity, joints)) > 1:
            for own in moving:
                others = tuple(joint for joint in joints if joint != own)
                parts[_label(settings, own)] = [{"joints": others}, {"joints": (own,)}]
        free = p.changed({"bounds": (parameter.lower, parameter.upper)})
        for ending, (rest, own) in parts.items():
            if (new := f"{name}_{ending}") not in settings.parameters:
                yield Term(new, {name: free.changed(rest), new: free.changed(own)}, value)


def _nominal(problem: Problem) -> Iterator[Term]:
    """Yield what no parameter sets: of all joints together and each,
    of both sides together and each."""
    settings, moving = problem.settings, problem.active_joints
    always = [p for p in settings.parameters.values() if p.per is None]
    taken = {(t, j) for p in always for t in TARGETS[p.quantity] for j in joints_of(settings, p) or (0,)}
    gauged, alone = any(log.pressure is not None for log in problem.logs), len(moving) == 1
    for row in ROWS:
        pump = row.of_the_pump
        # the pump of one actuator is no more than its flow limit; the logs may say the pressure
        known = (pump and alone) or (row.name == "start_pressure" and gauged)
        if row.span is None or known or (settings.stage == "mech" and row.name not in MECHANICAL):
            continue
        joints = _moving(problem, row.name, moving)
        for quantity in dict.fromkeys((row.name, *TARGETS[row.name])):
            groups: list[tuple[int, ...]] = [(0,)] if pump else [(joint,) for joint in joints]
            if quantity == row.name and not pump and len(joints) > 1:
                groups.append(joints)
            for group in groups:
                atoms = [(target, joint) for target in TARGETS[quantity] for joint in group]
                values = {_nominal_value(settings, target, joint or 1) for target, joint in atoms}
                if len(values) == 1 and taken.isdisjoint(atoms):
                    one = not (alone or pump or group[1:])
                    name = f"{quantity}_{_label(settings, *group)}" if one else quantity
                    while name in settings.parameters:
                        name += "_"
                    own = ParameterSettings(
                        quantity=quantity, joints=None if pump else group, bounds=row.span
                    )
                    yield Term(name, {name: own}, values.pop())


def _label(settings: FitSettings, joint: int) -> str:
    """Return the name of a joint as names of parameters have it."""
    return re.sub(r"\W", "_", settings.arm.joint_names[joint - 1])


def joints_of(settings: FitSettings, p: ParameterSettings) -> tuple[int, ...]:
    """Return the joints that a parameter acts on; a link's mass, and the pump's numbers,
    act on none."""
    if p.link is not None or CHOICES[p.quantity].of_the_pump:
        return ()
    return p.joints or tuple(range(1, len(settings.arm.joints) + 1))


def _nominal_value(settings: FitSettings, quantity: str, joint: int) -> float:
    """Value of a quantity that no parameter sets; inf of a limit that is switched off."""
    value = actuator_values(settings.arm.joints[joint - 1].actuator, settings.hydraulics)[quantity]
    if value is None:
        return START_PRESSURE / QUANTITIES[quantity].factor if quantity == "start_pressure" else math.inf
    return value
