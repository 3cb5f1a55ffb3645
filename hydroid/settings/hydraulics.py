"""The hydraulics of an arm, from command to chamber pressure: quantities that hold for all joints.

Each setting holds for every actuator of the arm; a parameter of a fit sets or frees it joint by joint. Areas,
openings and pivots differ by joint: they stand in the arm's file.
"""

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, create_model, model_validator

from hydroid.quantity_table import QUANTITIES, TARGETS, Quantity
from hydroid.settings.linkage import Cylinder, LinearActuator, RotaryActuator
from hydroid.settings.load import Positive, Settings

OF_THE_PIVOTS = ("pivot_distance_1", "pivot_distance_2", "pivot_angle")
"""quantities whose nominal values are the model's"""


def _field(quantity: Quantity) -> Any:
    number: Any = Annotated[float, *quantity.limits] if quantity.limits else float
    extra: Any = {"unit": quantity.unit, "source": quantity.source}
    default: Any = quantity.default
    kind = number | None if quantity.optional else number
    return kind, Field(default, description=quantity.meaning, json_schema_extra=extra)


_Chain: type[Settings] = create_model(
    "_Chain",
    __base__=Settings,
    **{q.name: _field(q) for q in QUANTITIES.values() if q.source in ("ours", "article")},
)


class HydraulicSettings(_Chain):
    """All numbers of the actuator chain but areas, openings and pivots, which the arm's file gives."""

    rotary_volume: Positive = 50.0
    """volume of each chamber of a rotary actuator [cm³]"""
    substeps: Annotated[int, Field(ge=1, le=100)] = 3
    """sub-steps of valves and oil in one MuJoCo step"""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A quantity, by its name in `QUANTITIES`."""

    @model_validator(mode="before")
    @classmethod
    def _both_sides(cls, values: Any) -> Any:
        """Let a name without _a or _b set both sides."""
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
    actuator: LinearActuator | Cylinder | RotaryActuator | None, settings: HydraulicSettings
) -> dict[str, float | None]:
    """Return the value of every quantity of a joint in the units of QUANTITIES; None: no limit.

    Mechanical quantities are 0: only a fit states them. A joint without an actuator has the defaults, which
    nothing uses: it is never driven in stage 2. Of a cylinder's settings alone the pivots are not known.
    """
    values: dict[str, Any] = {name: q.default for name, q in QUANTITIES.items()} | settings.model_dump()
    if isinstance(actuator, LinearActuator):
        sides, actuator = actuator.triangle, actuator.settings
        values |= zip(OF_THE_PIVOTS, (sides.a, sides.b, sides.theta0), strict=True)
    if actuator is not None:
        values["opening_a"] = values["opening_b"] = actuator.max_opening
    if isinstance(actuator, Cylinder):
        values["area_a"], values["area_b"] = actuator.area_a, actuator.area_b
    elif actuator is not None:
        values["area_a"] = values["area_b"] = actuator.displacement
        values["dead_volume"] = settings.rotary_volume
    return {name: values[name] for name in QUANTITIES}
