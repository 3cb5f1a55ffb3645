"""Sentences about what logs determine: flags, unidentifiable directions, lists of names."""

from collections.abc import Sequence

import numpy as np

from hydroid.problem.problem import Problem
from hydroid.uncertainty.directions import Direction
from hydroid.uncertainty.flags import Flag, ParameterStatus
from hydroid.uncertainty.patterns import CURRENTS, DirectionKind

_UNEQUAL = 0.1
"""relative changes that differ by more than this do not scale by one factor"""


def status_phrase(status: ParameterStatus) -> str:
    """What is to be known about an estimate; empty where nothing is."""
    said: list[str] = []
    if status.diverges and status.flag is not Flag.FIXED:
        said.append("effect unknown, the changed arm diverges")
    elif status.flag is not Flag.IDENTIFIABLE:
        said.append(status.flag.value)
    if status.derivative_doubt is not None:
        said.append(f"derivative only to {100 * status.derivative_doubt:.0f} %")
    if status.at_bound is not None:
        said.append(f"at {status.at_bound} bound")
    return ", ".join(said)


def direction_phrase(direction: Direction, problem: Problem) -> str:
    """An unidentifiable direction, and to how many per cent it is known."""
    name, count = _direction_name(direction, problem), ""
    if len(direction.changes) > 1:
        count = f", {len(direction.changes)} directions"
    if direction.flag is Flag.UNIDENTIFIABLE:
        return f"{name}: {Flag.UNIDENTIFIABLE.value} (±∞{count})"
    percent = 100 * direction.relative_sd
    return (
        f"{name}: only to ±{percent:.2g} %{count}"
        if percent < 10
        else f"{name}: only to ±{percent:.0f} %{count}"
    )


def _direction_name(direction: Direction, problem: Problem) -> str:
    names, changes = list(direction.parameters), list(direction.parameters.values())
    numbers = direction.numbers
    match direction.kind:
        case DirectionKind.NO_EFFECT:
            return f"{names[0]} has no effect on {outputs_phrase(problem)}"
        case DirectionKind.SINGLE:
            return f"{names[0]} by itself"
        case DirectionKind.COMMON_SCALE:
            unequal = " (these to make up for what is fixed, unequally)" if np.ptp(changes) > _UNEQUAL else ""
            return f"{listed(names)} scale together{unequal}"
        case DirectionKind.SOLENOID:
            values = f"δ = {numbers['delta']:.3g} mm and k·i0² = {numbers['k_i0']:.3g} N·mm²"
            return f"{listed(names)} act through two combinations only: {values}"
        case DirectionKind.CURRENT_SCALE:
            settings = problem.settings.parameters
            currents = [n for n in names if settings[n].quantity in CURRENTS]
            coil = [n for n in names if n not in currents]
            values = (
                f"δ = {numbers['delta']:.3g} mm, k·I_max² = {numbers['k_imax']:.3g} and "
                f"k·I_min² = {numbers['k_imin']:.3g} N·mm²"
            )
            return (
                f"a common scale of {' and '.join(currents)} trades with {listed(coil)}, at the same {values}"
            )
        case DirectionKind.COMBINATION:
            first, *others = (
                f"{change:+.2g} % {name}".replace("-", "−")
                for name, change in zip(names, changes, strict=True)
            )
            return f"{first} with {', '.join(others)}"


def outputs_phrase(problem: Problem) -> str:
    """What is compared."""
    joints = [str(joint) for joint in dict.fromkeys(c.joint for c in problem.channels)]
    which = (
        f"the angle of joint {joints[0]}" if len(joints) == 1 else f"the angles of joints {listed(joints)}"
    )
    pressed = any(c.quantity != "angle" for c in problem.channels)
    return f"{which} and the pressures" if pressed else which


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
