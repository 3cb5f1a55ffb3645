"""From the settings of a parameter to the parameter: its nominal value, prior, bounds
and start."""

import math

from hydroid.arrays import Limits
from hydroid.parameters import Parameter, Prior
from hydroid.quantity_table import CHOICES, MECHANICAL, TARGETS
from hydroid.settings.arm import Actuator, Arm
from hydroid.settings.hydraulics import HydraulicSettings, actuator_values
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.problem import ParameterSettings

BY_TURN = ("area", "area_a", "area_b", "dry_friction")
"""quantities that a rotary actuator has by its angle, where a cylinder has them by its
stroke"""


def nominal_value(
    arm: Arm, hydraulics: HydraulicSettings, settings: ParameterSettings
) -> float | None:
    """Return what its settings, `hydraulics` or the arm's file say of a parameter;
    None: no one value."""
    if settings.nominal is not None:
        return settings.nominal
    if settings.per is not None:
        # an effect of a group is added to the quantity
        return 0.0
    if settings.link is not None:
        return arm.mass_of.get(settings.link)
    if settings.quantity in MECHANICAL:
        return None
    values = set[float | None]()
    for actuator in _actuators(arm, settings):
        if actuator is not None:
            table = actuator_values(actuator, hydraulics)
            values |= {table[name] for name in TARGETS[settings.quantity]}
    if len(values) == 1:
        return values.pop()
    return None


def make_parameter(
    name: str,
    settings: ParameterSettings,
    arm: Arm,
    hydraulics: HydraulicSettings,
    *,
    log_scale: bool,
) -> Parameter:
    """Return one parameter with its bounds, prior and start.

    `log_scale`: by its logarithm where it is positive, as one with a log-normal prior
    always is.

    Raises ValueError: a prior without a nominal value, or one that does not fit, with
    the parameter's name.
    """
    nominal = nominal_value(arm, hydraulics, settings)
    prior = _prior(name, settings, nominal)
    lower, upper = settings.bounds or _default_bounds(settings, prior)
    start = nominal
    if settings.start is not None:
        start = settings.start
    # a nominal value may lie outside bounds that the user states
    if start is not None:
        start = min(max(start, lower), upper)
    has_log_prior = prior is not None and prior.log
    least = 0.0
    # an effect is near 0, where no relative change means anything
    if settings.per is not None and settings.sd is not None:
        least = settings.sd
    return Parameter(
        name=name,
        unit=_unit(arm, settings),
        lower=lower,
        upper=upper,
        fixed=settings.fixed,
        log=lower > 0 and (log_scale or has_log_prior),
        start=start,
        prior=prior,
        least=least,
    )


def _prior(
    name: str, settings: ParameterSettings, nominal: float | None
) -> Prior | None:
    if not settings.has_prior:
        return None
    if nominal is None:
        word = "within" if settings.sd is None else "sd"
        raise ValueError(
            f"parameters.{name}: {word}: needs a nominal value; the settings and the arm's file "
            f"have none for this {settings.quantity}, so add nominal: VALUE, or give bounds: in "
            f"place of {word}:"
        )
    if settings.bounds is not None:
        lower, upper = settings.bounds
        if not lower <= nominal <= upper:
            value = f"{nominal:g} {settings.unit}"
            raise ValueError(
                f"parameters.{name}: the nominal value {value} lies outside the bounds"
            )
    if settings.sd is not None:
        return Prior(nominal, settings.sd)
    if nominal <= 0:
        raise ValueError(
            f"parameters.{name}: within: factor needs a nominal value above 0; give sd: instead"
        )
    # 95 % of a normal variable, here of the logarithm, lie within 1.96 standard
    # deviations
    return Prior(nominal, math.log(settings.within or 1.0) / 1.96, log=True)


def _default_bounds(settings: ParameterSettings, prior: Prior | None) -> Limits:
    """Return the bounds of a parameter that states none: four standard deviations of
    its prior, within what the quantity can be."""
    if prior is None:
        held = settings.fixed or 0.0
        return held, held
    lower = prior.value(-4.0)
    upper = prior.value(4.0)
    if settings.per is not None:
        return lower, upper
    quantity = CHOICES[settings.quantity]
    least = quantity.lowest
    if quantity.positive:
        # what must be above 0 is not searched below 1 % of its value
        least = 0.01 * prior.nominal
    return max(lower, least), min(upper, quantity.highest)


def _unit(arm: Arm, settings: ParameterSettings) -> str:
    """Return the unit of a parameter.

    Of joints that slide, and of rotary actuators that turn, it is another than the
    quantity's.
    """
    if not settings.joints:
        return settings.unit
    all_slide = {*settings.joints} <= {*arm.slides}
    if all_slide and settings.quantity in MECHANICAL:
        return settings.unit.replace("N·m", "N").replace("rad", "m")
    actuators = _actuators(arm, settings)
    all_rotary = bool(actuators) and all(
        isinstance(a, RotaryActuator) for a in actuators
    )
    if all_rotary and not all_slide and settings.quantity in BY_TURN:
        return {"mm²": "cm³/rad", "N": "N·m"}[settings.unit]
    return settings.unit


def _actuators(arm: Arm, settings: ParameterSettings) -> list[Actuator | None]:
    """Return what moves the joints that a parameter acts on; joints that the arm lacks
    are refused elsewhere."""
    joints = settings.joints
    return [
        joint.actuator
        for number, joint in enumerate(arm.joints, 1)
        if joints is None or number in joints
    ]
