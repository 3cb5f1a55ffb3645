"""From the settings of parameters to parameters: one per joint, nominal values, priors, bounds and starts."""

import math
from collections.abc import Mapping
from typing import Any, Protocol

from hydroid.parameters import Parameter, Prior
from hydroid.quantity_table import CHOICES, MECHANICAL, TARGETS
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import OF_THE_PIVOTS, HydraulicSettings, actuator_values
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.problem import ParameterSettings

QUANTILE = 1.96
"""standard deviations of a Gaussian that hold 95 % on both sides"""
BOUND_SD = 4.0
"""standard deviations of its prior that a parameter without bounds may be away"""
SMALLEST = 0.01
"""part of the nominal value below which a quantity that must be above 0 is not searched by default"""
ROTARY_UNITS = {"mm²": "cm³/rad", "N": "N·m"}
"""of the areas and the dry friction of a rotary actuator"""


class Machine(Protocol):
    """What a fit's settings say of the machine, where nominal values come from."""

    @property
    def arm(self) -> Arm:
        """The arm."""
        ...

    @property
    def hydraulics(self) -> HydraulicSettings:
        """The hydraulics of all joints."""
        ...


def expanded(
    parameters: Mapping[str, Any], compared: Any, joints: tuple[str, ...] = (), links: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the settings of parameters, as YAML gives them, with one entry for each joint or link of `each`.

    `compared` are the joints that `each: true` means; of masses it means all links. With one joint a
    mechanical parameter serves all joints, because those that are driven but not compared need it too.

    Raises:
        ValueError: a parameter with `joints` or `link` and `each`.
    """
    result: dict[str, Any] = {}
    for name, entry in parameters.items():
        if not isinstance(entry, dict) or not (each := entry.get("each")):
            result[name] = {**result.get(name, {}), **entry} if isinstance(entry, dict) else entry
            continue
        mass = entry.get("quantity") == "mass"
        if entry.get("link" if mass else "joints") is not None:
            what = "link or each: links" if mass else "joints that share it or each: joints"
            raise ValueError(f"{name}: give {what} that have their own, not both")
        shared = {key: value for key, value in entry.items() if key != "each"}
        chosen = (links if mass else compared) if each is True else each
        allowed = str if mass else int | str
        if not isinstance(chosen, list | tuple) or not all(isinstance(c, allowed) for c in chosen):
            result[name] = entry  # refused as any other wrong value
            continue
        numbers = [joints.index(c) + 1 if not mass and c in joints else c for c in chosen]
        if len(numbers) == 1 and not mass:
            everywhere = each is True and entry.get("quantity") in MECHANICAL
            result[name] = shared | ({} if everywhere else {"joints": tuple(numbers)})
            continue
        for number in numbers:
            own = f"{name}_{number}"
            changes = result.get(own, parameters.get(own, {}))
            result[own] = {**shared, **({"link": number} if mass else {"joints": (number,)}), **changes}
    return result


def nominal_value(machine: Machine, parameter: ParameterSettings) -> float | None:
    """Return what its settings, `hydraulics` or the arm's file say of a parameter; None: no one value."""
    if parameter.nominal is not None:
        return parameter.nominal
    arm = machine.arm
    if parameter.link is not None:
        return dict(zip(arm.link_names, arm.masses.tolist(), strict=True)).get(parameter.link)
    if parameter.quantity in MECHANICAL:
        return None
    among = arm.actuators
    if parameter.quantity in OF_THE_PIVOTS:
        among = tuple(joint.actuator for joint in arm.joints)
    actuators = (
        among if parameter.joints is None else [among[j - 1] for j in parameter.joints if j <= len(among)]
    )
    tables = [actuator_values(a, machine.hydraulics) for a in actuators if a is not None]
    values = {table[side] for table in tables for side in TARGETS[parameter.quantity]}
    return values.pop() if len(values) == 1 else None


def prior(machine: Machine, parameter: ParameterSettings) -> Prior | None:
    """Return the prior of a parameter; None: it has none.

    Raises:
        ValueError: no nominal value, or one that does not fit.
    """
    if not parameter.has_prior:
        return None
    nominal = nominal_value(machine, parameter)
    if nominal is None:
        word = "sd" if parameter.within is None else "within"
        raise ValueError(
            f"{word}: needs a nominal value; the settings and the arm's file have none for this "
            f"{parameter.quantity}, so add nominal: VALUE, or give bounds: in place of {word}:"
        )
    if parameter.bounds is not None and not parameter.bounds[0] <= nominal <= parameter.bounds[1]:
        raise ValueError(f"the nominal value {nominal:g} {parameter.unit} lies outside the bounds")
    if parameter.sd is not None:
        return Prior(nominal, parameter.sd)
    assert parameter.within is not None
    if nominal <= 0:
        raise ValueError("within: factor needs a nominal value above 0; give sd: instead")
    return Prior(nominal, math.log(parameter.within) / QUANTILE, log=True)


def parameter(machine: Machine, name: str, own: ParameterSettings, log: bool, starts: bool) -> Parameter:
    """Return one parameter with its bounds and prior.

    `log`: on a log scale where it is positive, as one with a log-normal prior always is. `starts`: with a
    start value where the settings or the machine give one.
    """
    known = prior(machine, own)
    lower, upper = own.bounds or _default_bounds(own, known)
    start = own.start if own.start is not None else nominal_value(machine, own)
    start = min(max(start, lower), upper) if starts and start is not None else None
    on_log = lower > 0 and (log or (known is not None and known.log))
    return Parameter(name, _unit(machine.arm, own), lower, upper, own.fixed, on_log, start, known)


def _unit(arm: Arm, own: ParameterSettings) -> str:
    """The unit of a parameter; areas and dry friction of rotary actuators have their own."""
    actuators = [arm.actuators[j - 1] for j in own.joints or () if j <= len(arm.joint_names)]
    rotary = bool(actuators) and all(isinstance(one, RotaryActuator) for one in actuators)
    sized = own.quantity in ("area", "area_a", "area_b", "dry_friction")
    return ROTARY_UNITS[own.unit] if rotary and sized else own.unit


def _default_bounds(own: ParameterSettings, known: Prior | None) -> tuple[float, float]:
    if known is None:
        return own.fixed or 0.0, own.fixed or 0.0
    least = SMALLEST * known.nominal if CHOICES[own.quantity].positive else 0.0
    upper = known.value(BOUND_SD)
    return max(known.value(-BOUND_SD), least), upper
