"""Terms: changes of the settings that give a model one more parameter.

A term is a quantity that the fit holds fixed, one that it leaves at its nominal value,
or the share of one side or joint in a parameter that serves several.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from hydroid.arrays import Array, Limits, record
from hydroid.files import Plain
from hydroid.hydraulics.actuator import START_PRESSURE
from hydroid.log.conditions import varies
from hydroid.posterior.error_model import Likelihood
from hydroid.problem.problem import Problem
from hydroid.quantity_table import (
    CHOICES,
    QUANTITIES,
    ROWS,
    TARGETS,
    Quantity,
)
from hydroid.rungs import BY_COMMAND, stage_has
from hydroid.settings.fit import FitSettings
from hydroid.settings.hydraulics import actuator_values
from hydroid.settings.log import WITH_INPUT
from hydroid.settings.problem import ParameterSettings

PLUNGER_LAG = "plunger_damping"
"""a lag, too: no term beside those that a valve has for itself"""
LAGS = (*TARGETS["pilot_lag"], *TARGETS["opening_lag"])


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
    def span(self) -> Limits:
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
        return np.array(
            [values[name] for name in problem.settings.parameters | dict(self.entries)]
        )

    def innovations(
        self, likelihood: Likelihood, theta: Array, values: Sequence[float]
    ) -> Array:
        """Innovations of a likelihood at an estimate, (P,), with the term at n values,
        shape (n, R)."""
        problem = likelihood.problem
        thetas = np.array([self.theta(problem, theta, value) for value in values])
        return likelihood.errors.innovations(
            self.added_to(problem).output_errors(thetas)
        )

    @property
    def kind(self) -> tuple[object, ...]:
        """Quantity, joints and link, with both sides of an actuator alike: `delay` and
        `delay_a` of a joint are of one kind."""
        parameter = self.entries[self.name]
        quantity = parameter.quantity.removesuffix("_a").removesuffix("_b")
        return quantity, parameter.joints, parameter.link


def terms(problem: Problem, theta: Array) -> tuple[Term, ...]:
    """List the terms of a problem at theta, shape (P,)."""
    return (*_held(problem), *_split(problem, theta), *_nominal(problem))


def _held(problem: Problem) -> Iterator[Term]:
    """Yield the parameters that the fit holds at a value."""
    for name, parameter in problem.settings.parameters.items():
        fixed = parameter.fixed
        if fixed is None or not _means_something(problem, parameter):
            continue
        # without bounds from a quarter to four times the value
        around = (fixed / 4.0, 4.0 * fixed)
        quantity = CHOICES[parameter.quantity]
        low, high = parameter.bounds or quantity.span or around
        low = min(low, fixed)
        high = min(max(high, fixed), quantity.highest)
        if low < high:
            freed = parameter.changed({"fixed": None, "bounds": (low, high)})
            yield Term(name, {name: freed}, fixed)


def _means_something(problem: Problem, parameter: ParameterSettings) -> bool:
    """Return whether what moves the joints has such a quantity,
    and an effect of a group has logs beside it; a choice is no number to be freed."""
    if parameter.quantity == BY_COMMAND:
        return False
    if parameter.per is not None:
        groups = {problem.settings.log.group_of(log.source) for log in problem.logs}
        if parameter.per not in groups or len(groups) == 1:
            return False
    joints = joints_of(problem.settings, parameter)
    return not joints or bool(_moving(problem, parameter.quantity, joints))


def _moving(problem: Problem, quantity: str, joints: Iterable[int]) -> tuple[int, ...]:
    """Return those of some joints that move, by an actuator that has the quantity; none
    where it is the effect of what the logs do not vary.

    A joint whose speed follows its command alone ignores all that load and pump do.
    """
    told_by = WITH_INPUT.get(quantity)
    if told_by and not varies(problem.logs, told_by):
        return ()
    settings = problem.settings
    return tuple(
        j
        for j in joints
        if j in problem.active_joints
        and settings.arm.joint(j).has(quantity)
        and not settings.ignores(quantity, j)
    )


def _split(problem: Problem, theta: Array) -> Iterator[Term]:
    """Yield the share of side B, or of one joint that moves,
    in a free parameter that serves several."""
    settings = problem.settings
    for parameter, value in zip(
        problem.parameters.parameters, theta.tolist(), strict=True
    ):
        name = parameter.name
        shared = settings.parameters[name]
        if shared.fixed is not None or shared.per is not None:
            continue
        free = shared.changed({"bounds": (parameter.lower, parameter.upper)})
        for ending, (rest, share) in _shares(problem, shared).items():
            new = f"{name}_{ending}"
            if new not in settings.parameters:
                entries = {name: free.changed(rest), new: free.changed(share)}
                yield Term(new, entries, value)


def _shares(
    problem: Problem, shared: ParameterSettings
) -> dict[str, tuple[Plain, Plain]]:
    """Return how a parameter can be split: what the rest of it serves, and what the
    share, by the share's ending."""
    settings = problem.settings
    shares = dict[str, tuple[Plain, Plain]]()
    sides = TARGETS[shared.quantity]
    if len(sides) == 2:
        side_a, side_b = sides
        shares["b"] = {"quantity": side_a}, {"quantity": side_b}
    joints = joints_of(settings, shared)
    moving = _moving(problem, shared.quantity, joints)
    if len(moving) > 1:
        for joint in moving:
            others = tuple(other for other in joints if other != joint)
            shares[_label(settings, joint)] = {"joints": others}, {"joints": (joint,)}
    return shares


def _nominal(problem: Problem) -> Iterator[Term]:
    """Yield what no parameter sets: of all joints together and each,
    of both sides together and each."""
    taken = _set_by_parameters(problem.settings)
    for row in ROWS:
        if row.span is None or not _may_lack(problem, row):
            continue
        joints = _moving(problem, row.name, problem.active_joints)
        if row.name == PLUNGER_LAG:
            joints = tuple(j for j in joints if taken.isdisjoint(product(LAGS, [j])))
        for quantity in dict.fromkeys((row.name, *TARGETS[row.name])):
            for group in _groups(row, quantity, joints):
                if taken.isdisjoint(product(TARGETS[quantity], group)):
                    yield from _new_term(problem, row, quantity, group)


def _new_term(
    problem: Problem, row: Quantity, quantity: str, group: tuple[int, ...]
) -> Iterator[Term]:
    """Yield a quantity of a group of joints as a term, if it has one value there."""
    # the pump is no joint's: the first has its values as well as any
    values = {
        _nominal_value(problem.settings, target, joint or 1)
        for target, joint in product(TARGETS[quantity], group)
    }
    if len(values) != 1:
        return
    name = _new_name(problem, row, quantity, group)
    joints = None if row.of_the_pump else group
    parameter = ParameterSettings(quantity=quantity, joints=joints, bounds=row.span)
    yield Term(name, {name: parameter}, values.pop())


def _set_by_parameters(settings: FitSettings) -> set[tuple[str, int]]:
    """Return the quantities that parameters set, with their joints; 0 for what is no
    joint's."""
    taken = set[tuple[str, int]]()
    for parameter in settings.parameters.values():
        if parameter.per is None:
            joints = joints_of(settings, parameter) or (0,)
            taken.update(product(TARGETS[parameter.quantity], joints))
    return taken


def _may_lack(problem: Problem, row: Quantity) -> bool:
    """Return whether the model of this stage has a quantity, and the logs do not say it
    already."""
    if not stage_has(problem.settings.stage, row.name):
        return False
    if row.of_the_pump:
        # the pump of one actuator is no more than its flow limit
        return len(problem.active_joints) != 1
    gauged = any(log.pressure is not None for log in problem.logs)
    return not (row.name == "start_pressure" and gauged)


def _groups(
    row: Quantity, quantity: str, joints: tuple[int, ...]
) -> list[tuple[int, ...]]:
    """Return the groups of joints that may share a value: each alone, and all of them
    where both sides do, too."""
    if row.of_the_pump:
        return [(0,)]
    groups: list[tuple[int, ...]] = [(joint,) for joint in joints]
    if quantity == row.name and len(joints) > 1:
        groups.append(joints)
    return groups


def _new_name(
    problem: Problem, row: Quantity, quantity: str, group: tuple[int, ...]
) -> str:
    """Return a name for a new parameter, with that of its joint where it is one of
    several."""
    settings = problem.settings
    name = quantity
    is_one_of_several = len(problem.active_joints) != 1 and len(group) == 1
    if is_one_of_several and not row.of_the_pump:
        name = f"{quantity}_{_label(settings, *group)}"
    while name in settings.parameters:
        name += "_"
    return name


def _label(settings: FitSettings, joint: int) -> str:
    """Return the name of a joint as names of parameters have it."""
    return re.sub(r"\W", "_", settings.arm.name_of(joint))


def joints_of(settings: FitSettings, parameter: ParameterSettings) -> tuple[int, ...]:
    """Return the joints that a parameter acts on; a link's mass, and the pump's
    numbers, act on none."""
    if parameter.link is not None or CHOICES[parameter.quantity].of_the_pump:
        return ()
    return parameter.joints or tuple(range(1, len(settings.arm.joints) + 1))


def _nominal_value(settings: FitSettings, quantity: str, joint: int) -> float:
    """Return the value of a quantity that no parameter sets;
    inf of a limit that is switched off."""
    actuator = settings.arm.joint(joint).actuator
    value = actuator_values(actuator, settings.hydraulics)[quantity]
    if value is not None:
        return value
    if quantity == "start_pressure":
        return START_PRESSURE / QUANTITIES[quantity].factor
    return math.inf
