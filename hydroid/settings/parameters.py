"""From the settings of parameters to parameters: one per joint, nominal values, priors,
bounds and starts."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from hydroid.files import Plain
from hydroid.parameters import Parameter, Prior
from hydroid.quantity_table import CHOICES, MECHANICAL, TARGETS
from hydroid.settings.arm import Actuator, Arm
from hydroid.settings.hydraulics import HydraulicSettings, actuator_values
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.load import each_once
from hydroid.settings.log import OTHER
from hydroid.settings.problem import ParameterSettings
from hydroid.words import distinct

MOST = 10_000  # parameters of all groups
GROUP = "group"
"""what `per` says of a parameter that has an effect in each group"""


def expanded(parameters: Mapping[str, Any], compared: Any, arm: Arm | None) -> Plain:
    """Return the settings of parameters, as YAML gives them,
    with one entry for each joint or link of `each`.

    `compared` are the joints that `each: true` means; of masses it means all links. With one joint
    a mechanical parameter serves all joints, because those that are driven but not compared need it
    too. Raises ValueError: a parameter with `joints` or `link` and `each`.
    """
    result: Plain = {}
    for name, entry in parameters.items():
        each = entry.get("each") if isinstance(entry, dict) else None
        if not each:
            result[name] = result.get(name, {}) | entry if isinstance(entry, dict) else entry
            continue
        quantity = entry.get("quantity")
        key, kind = ("link", str) if quantity == "mass" else ("joints", int | str)
        if entry.get(key) is not None:
            what = "link or each: links" if key == "link" else "joints that share it or each: joints"
            raise ValueError(f"parameters.{name}: give {what} that have their own, not both")
        every = arm.link_names if key == "link" and arm else compared
        places = every if each is True else each
        if not isinstance(places, list | tuple) or not all(isinstance(place, kind) for place in places):
            result[name] = entry  # refused as any other wrong value
            continue
        shared = {setting: value for setting, value in entry.items() if setting != "each"}
        names = dict(enumerate(arm.joint_names, 1)) if arm and key == "joints" else {}
        if key == "joints":
            _refuse(places, "outputs" if each is True else f"parameters.{name}.each", [*names.values()])
        numbers: Plain = {label: number for number, label in names.items()}
        places = [numbers.get(place, place) for place in places]
        if key == "joints" and len(places) == 1:
            everywhere = each is True and quantity in MECHANICAL
            result[name] = shared | ({} if everywhere else {"joints": places})
            continue
        taken = set[str]()
        for place in places:
            label = names.get(place, place)
            # --set splits names at dots
            own = distinct(re.sub(r"\W", "_", f"{name}_{label}"), taken)
            result[own] = shared | {key: place if key == "link" else [place]} | result.get(own, {})
    return result


def _refuse(joints: Any, where: str, names: Sequence[str]) -> None:
    """Raise ValueError where a joint occurs twice, or joints are more than there are."""
    try:
        each_once(joints, names)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    if names and len(joints) > len(names):
        raise ValueError(f"{where}: {len(joints)} joints, but the arm has {len(names)}")


def by_group(parameters: Mapping[str, Any], groups: Collection[str]) -> Plain:
    """Return the settings of parameters with one entry for each group of `per: group`,
    and for other logs.

    Raises ValueError: there are no groups.
    """
    result: Plain = {}
    for name, entry in parameters.items():
        if not isinstance(entry, dict) or entry.get("per") != GROUP:
            result[name] = result.get(name, {}) | entry if isinstance(entry, dict) else entry
            continue
        if not groups or GROUP in groups:
            what = "per: group needs log.groups: {name: pattern}, none of them named group"
            raise ValueError(f"parameters.{name}: {what}")
        for group in (*groups, OTHER):
            if len(result) >= MOST:
                raise ValueError(f"parameters.{name}: more than {MOST} parameters")
            own = f"{name}_{group}"
            result[own] = entry | {"per": group} | result.get(own, {})
    return result


def nominal_value(arm: Arm, hydraulics: HydraulicSettings, own: ParameterSettings) -> float | None:
    """Return what its settings, `hydraulics` or the arm's file say of a parameter; None:
    no one value."""
    if own.nominal is not None or own.per is not None:
        return own.nominal or 0.0
    if own.link is not None:
        return arm.mass_of.get(own.link)
    if own.quantity in MECHANICAL:
        return None
    tables = [actuator_values(one, hydraulics) for one in _actuators(arm, own) if one is not None]
    values = {table[side] for table in tables for side in TARGETS[own.quantity]}
    return values.pop() if len(values) == 1 else None


def make_parameter(
    name: str, own: ParameterSettings, arm: Arm, hydraulics: HydraulicSettings, *, log: bool
) -> Parameter:
    """Return one parameter with its bounds, prior and start.

    `log`: on a log scale where it is positive, as one with a log-normal prior always is.
    Raises ValueError: a prior without a nominal value, or one that does not fit,
    with the parameter's name.
    """
    nominal = nominal_value(arm, hydraulics, own)
    prior = _prior(name, own, nominal)
    lower, upper = own.bounds or _default_bounds(own, prior)
    start = own.start if own.start is not None else nominal
    start = None if start is None else min(max(start, lower), upper)
    on_log = lower > 0 and (log or (prior is not None and prior.log))
    least = (own.per and own.sd) or 0.0
    return Parameter(name, _unit(arm, own), lower, upper, own.fixed, on_log, start, prior, least)


def _prior(name: str, own: ParameterSettings, nominal: float | None) -> Prior | None:
    if not own.has_prior:
        return None
    if nominal is None:
        word = "within" if own.sd is None else "sd"
        raise ValueError(
            f"parameters.{name}: {word}: needs a nominal value; the settings and the arm's file have none "
            f"for this {own.quantity}, so add nominal: VALUE, or give bounds: in place of {word}:"
        )
    if own.bounds is not None and not own.bounds[0] <= nominal <= own.bounds[1]:
        raise ValueError(
            f"parameters.{name}: the nominal value {nominal:g} {own.unit} lies outside the bounds"
        )
    if own.sd is not None:
        return Prior(nominal, own.sd)
    if nominal <= 0:
        raise ValueError(f"parameters.{name}: within: factor needs a nominal value above 0; give sd: instead")
    return Prior(nominal, math.log(own.within or 1.0) / 1.96, log=True)  # 95 % lie within


def _default_bounds(own: ParameterSettings, prior: Prior | None) -> tuple[float, float]:
    if prior is None:
        return own.fixed or 0.0, own.fixed or 0.0
    lower, upper = prior.value(-4.0), prior.value(4.0)
    if own.per is None:  # what must be above 0 is not searched below 1 % of its value
        quantity = CHOICES[own.quantity]
        lower = max(lower, 0.01 * prior.nominal if quantity.positive else quantity.lowest)
    return lower, upper


def _unit(arm: Arm, own: ParameterSettings) -> str:
    """The unit of a parameter; joints that slide, and rotary actuators that turn,
    have their own."""
    sliding = bool(own.joints) and {*own.joints} <= {*arm.slides}
    if own.quantity in MECHANICAL and sliding:
        return own.unit.replace("N·m", "N").replace("rad", "m")
    actuators = _actuators(arm, own) if own.joints else []
    rotary = bool(actuators) and all(isinstance(one, RotaryActuator) for one in actuators) and not sliding
    sized = own.quantity in ("area", "area_a", "area_b", "dry_friction")
    return {"mm²": "cm³/rad", "N": "N·m"}[own.unit] if rotary and sized else own.unit


def _actuators(arm: Arm, own: ParameterSettings) -> list[Actuator | None]:
    """What moves the joints that a parameter acts on;
    joints that the arm lacks are refused elsewhere."""
    return [joint.actuator for j, joint in enumerate(arm.joints, 1) if own.joints is None or j in own.joints]
