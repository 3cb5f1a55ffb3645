"""The hydraulics of an arm, from command to chamber pressure: quantities that hold for
all joints.

Each setting holds for every actuator of the arm; a parameter of a fit sets or frees it
joint by joint. Areas, openings and pivots differ by joint: they stand in the arm's
file.
"""

import math
from typing import Annotated, Any

from pydantic import Field, create_model, model_validator

from hydroid.quantity_table import HYDRAULIC, QUANTITIES, TARGETS, Quantity
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.load import Positive, Settings


def _field(quantity: Quantity) -> Any:
    """Return the type and the field of a quantity, as `create_model` takes them."""
    meaning = quantity.meaning
    if quantity.unit:
        meaning = f"{meaning} [{quantity.unit}]"
    low, high = quantity.limits or (0.0, math.inf)
    field = Field(
        quantity.default,
        description=meaning,
        gt=low if quantity.positive else None,
        ge=None if quantity.positive else low,
        le=high,
    )
    if quantity.optional or quantity.default is None:
        return float | None, field
    return float, field


_FIELDS = {name: _field(quantity) for name, quantity in HYDRAULIC.items()}
_Quantities: type[Any] = create_model("_Quantities", __base__=Settings, **_FIELDS)


class HydraulicSettings(_Quantities):
    """Values of quantities by name, for all joints; a name without _a or _b sets both
    sides."""

    rotary_volume: Positive = 50.0
    """volume of each chamber of a rotary actuator [cm³]"""
    substeps: Annotated[int, Field(ge=1, le=100)] = 3
    """sub-steps of valves and oil in one of the `steps_per_sample`"""

    @model_validator(mode="before")
    @classmethod
    def _of_both_sides(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        spread: dict[Any, Any] = {}
        for key, value in values.items():
            for name in TARGETS.get(key, (key,)):
                if name in spread:
                    raise ValueError(f"{name} is given twice")
                spread[name] = value
        return spread


def actuator_values(
    actuator: LinearActuator | RotaryActuator | None, settings: HydraulicSettings
) -> dict[str, float | None]:
    """Return the value of every quantity of a joint in the units of QUANTITIES; None:
    no limit.

    Mechanical quantities are 0: only a fit states them. A joint without an actuator has
    the defaults, which nothing uses: it is never driven in stage 2.
    """
    values: dict[str, Any] = {}
    for name, quantity in QUANTITIES.items():
        values[name] = quantity.default
    values |= settings.model_dump()
    if isinstance(actuator, LinearActuator):
        cylinder = actuator.settings
        pivots = actuator.triangle
        values |= dict.fromkeys(TARGETS["opening"], cylinder.max_opening)
        values |= {
            "area_a": cylinder.area_a,
            "area_b": cylinder.area_b,
            "pivot_angle": abs(pivots.theta0),
            "pivot_distance_1": pivots.a,
            "pivot_distance_2": pivots.b,
        }
    elif actuator is not None:
        values |= dict.fromkeys(TARGETS["opening"], actuator.max_opening)
        values |= dict.fromkeys(TARGETS["area"], actuator.displacement)
        values["dead_volume"] = settings.rotary_volume
    return {name: values[name] for name in QUANTITIES}
