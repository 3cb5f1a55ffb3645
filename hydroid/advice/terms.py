"""Terms: changes of the settings that give a model one more parameter, and a model in which each can change.

A term is a quantity that the fit holds fixed, one that it leaves at its nominal value, or the share of one
side or joint in a parameter that serves several.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.hydraulics.actuator import START_PRESSURE
from hydroid.parameters import Array
from hydroid.posterior.linear import with_open_start
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CHOICES, MECHANICAL, QUANTITIES, ROWS, TARGETS
from hydroid.settings.fit import FitSettings
from hydroid.settings.hydraulics import actuator_values
from hydroid.settings.problem import ParameterSettings

Atom = tuple[str, int | str]
"""one quantity of one side, and its joint (from 1) or link; 0: the pump"""


@dataclass(frozen=True)
class Term:
    """One more free parameter.

    Attributes:
        name: of it.
        entries: of the settings' parameters that add it: its own, and that of what it is split from.
        value: that it has now; inf of a limit that is switched off.
        atoms: that it sets.
    """

    name: str
    entries: Mapping[str, ParameterSettings]
    value: float
    atoms: tuple[Atom, ...]

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest value."""
        bounds = self.entries[self.name].bounds
        assert bounds is not None
        return bounds

    @property
    def kind(self) -> tuple[str, frozenset[int | str]]:
        """What it is, with both sides of an actuator alike: the same for `delay` and `delay_a` of a joint."""
        quantity = self.atoms[0][0].removesuffix("_a").removesuffix("_b")
        return quantity, frozenset(place for _, place in self.atoms)


def terms(problem: Problem, theta: Array) -> tuple[Term, ...]:
    """List the terms of a problem at theta, shape (P,)."""
    return (*_held(problem.settings), *_split(problem, theta), *_nominal(problem))


def _held(settings: FitSettings) -> Iterator[Term]:
    """Yield the fixed parameters."""
    for name, p in settings.parameters.items():
        if p.fixed is not None:
            # without bounds from a quarter to four times the value
            low, high = p.bounds or CHOICES[p.quantity].span or (p.fixed / 4.0, 4.0 * p.fixed)
            span = min(low, p.fixed), max(high, p.fixed)
            if span[0] < span[1]:
                free = p.changed({"fixed": None, "bounds": span})
                yield Term(name, {name: free}, p.fixed, _atoms(settings, p))


def _split(problem: Problem, theta: Array) -> Iterator[Term]:
    """Yield the share of side B, or of one joint that moves, in a free parameter that serves several."""
    settings = problem.settings
    for parameter, value in zip(problem.parameters.parameters, theta.tolist(), strict=True):
        name, p = parameter.name, settings.parameters[parameter.name]
        if p.fixed is not None or p.logs is not None:
            continue
        sides, joints = TARGETS[p.quantity], sorted({j for _, j in _atoms(settings, p) if isinstance(j, int)})
        moving = [j for j in joints if j in problem.active_joints]
        parts: list[tuple[str, dict[str, Any], dict[str, Any]]] = []
        if len(sides) == 2:
            parts.append(("b", {"quantity": sides[0]}, {"quantity": sides[1]}))
        if len(moving) > 1:
            others = {joint: tuple(j for j in joints if j != joint) for joint in moving}
            parts += [(str(j), {"joints": rest}, {"joints": (j,)}) for j, rest in others.items()]
        free = p.changed({"bounds": (parameter.lower, parameter.upper)})
        for ending, rest, own in parts:
            new, entry = f"{name}_{ending}", free.changed(own)
            if new not in settings.parameters:
                entries = {name: free.changed(rest), new: entry}
                yield Term(new, entries, value, _atoms(settings, entry))


def _nominal(problem: Problem) -> Iterator[Term]:
    """Yield what no parameter sets: of all joints together and each, of both sides together and each."""
    settings, joints = problem.settings, problem.active_joints
    taken = {atom for p in settings.parameters.values() for atom in _atoms(settings, p)}
    gauged, alone = any(log.pressure is not None for log in problem.logs), len(joints) == 1
    for row in ROWS:
        pump = row.of_the_pump
        # the pump of one actuator is no more than its flow limit; the logs may say the pressure
        known = (pump and alone) or (row.name == "start_pressure" and gauged)
        if row.span is None or known or (settings.stage == "mech" and row.name not in MECHANICAL):
            continue
        for quantity in dict.fromkeys((row.name, *TARGETS[row.name])):
            groups: list[tuple[int, ...]] = [(0,)] if pump else [(joint,) for joint in joints]
            if quantity == row.name and not pump and not alone:
                groups.append(joints)
            for group in groups:
                atoms = tuple((target, joint) for target in TARGETS[quantity] for joint in group)
                values = {_nominal_value(problem, target, joint or 1) for target, joint in atoms}
                if len(values) == 1 and taken.isdisjoint(atoms):
                    name = quantity if alone or pump or len(group) > 1 else f"{quantity}_{min(group)}"
                    while name in settings.parameters:
                        name += "_"
                    entry = ParameterSettings(
                        quantity=quantity, joints=None if pump else group, bounds=row.span
                    )
                    yield Term(name, {name: entry}, values.pop(), atoms)


def _atoms(settings: FitSettings, p: ParameterSettings) -> tuple[Atom, ...]:
    """All that a parameter sets; what is added in some logs is none of it."""
    if p.logs is not None:
        return ()
    places: Sequence[int | str] = p.joints or range(1, len(settings.arm.joints) + 1)
    places = [p.link] if p.link is not None else [0] if CHOICES[p.quantity].of_the_pump else places
    return tuple((target, place) for target in TARGETS[p.quantity] for place in places)


def _nominal_value(problem: Problem, quantity: str, joint: int) -> float:
    """Value of a quantity that no parameter sets; inf of a limit that is switched off."""
    settings = problem.settings
    value = actuator_values(settings.arm.joints[joint - 1].actuator, settings.hydraulics)[quantity]
    if quantity == "start_pressure" and value is None:
        return START_PRESSURE / QUANTITIES[quantity].factor
    return math.inf if value is None else value


class ExtendedModel:
    """A problem at an estimate in which terms can change.

    Attributes:
        residual: at the estimate [rad], shape (R,).
    """

    def __init__(self, problem: Problem, theta: Array, terms: Sequence[Term]) -> None:
        settings, moved = problem.settings, {atom for term in terms for atom in term.atoms}
        parameters, values, atoms = dict[str, ParameterSettings](), list[float](), dict[Atom, float]()
        for (name, p), value in zip(settings.parameters.items(), theta.tolist(), strict=True):
            own = _atoms(settings, p)
            if moved.isdisjoint(own):
                parameters[name] = p
                values.append(value)
            else:
                atoms |= dict.fromkeys(own, value)
        atoms |= {atom: term.value for term in terms for atom in term.atoms if atom not in atoms}
        for target, place in atoms:
            where = {"link": place} if target == "mass" else {"joints": (place,) if place else None}
            entry = ParameterSettings(quantity=target, bounds=(0.1, 0.2), **where)  # pyright: ignore[reportArgumentType]
            parameters[f"{target}_of_{place}"] = entry
        self._base = np.array([*values, *atoms.values()])
        self._columns = {atom: len(values) + i for i, atom in enumerate(atoms)}
        varied = problem.varied(settings.changed({"parameters": parameters, "priors": {}}))
        self._problem = varied.with_open_starts(with_open_start(problem, theta).open_starts)
        self.residual = self.residuals([])[0]

    def residuals(self, changes: Sequence[tuple[Term, float]]) -> Array:
        """Residuals [rad] with one term at another value each, shape (n, R); of none those as they are."""
        rows = np.tile(self._base, (max(len(changes), 1), 1))
        for row, (term, value) in zip(rows, changes, strict=False):
            row[[self._columns[atom] for atom in term.atoms]] = value
        return self._problem.residuals(rows)
