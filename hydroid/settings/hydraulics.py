"""The hydraulics of an arm, from command to chamber pressure, and the one table of their quantities.

Each quantity holds for every actuator of the arm; a parameter of a fit sets or frees it joint by joint.
Names that end in _a and _b belong to one side, or one direction, of an actuator. Without that ending, as in
`delay` for delay_a and delay_b, a name sets both.
Units are those of a drawing or data sheet. Values marked as the article's are the ones it calls true. All
others are ours: plausible sizes, not measurements of a HydroLek.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, model_validator

from hydroid.settings.linkage import Cylinder, LinearActuator, RotaryActuator
from hydroid.settings.load import NotNegative, Positive, Settings

SI_FACTORS = {
    "mm": 1e-3,
    "mm²": 1e-6,
    "cm³": 1e-6,
    "N/mm": 1e3,
    "bar": 1e5,
    "L/min": 1e-3 / 60.0,
    "deg": math.pi / 180.0,
}
"""what one of a unit is in SI; units that are SI already are not listed"""

SPANS = {
    "opening": (0.01, 1000.0),
    "plunger_damping": (1.0, 5000.0),
    "overlap": (0.0, 2.0),
    "opening_exponent": (0.3, 4.0),
    "return": (0.2, 10.0),
    "anticavitation": (0.0, 10.0),
    "leakage": (0.0, 10.0),
    "flow_limit": (0.1, 1000.0),
    "pump_flow": (0.1, 1000.0),
    "pump_droop": (0.0, 200.0),
    "pump_idle": (0.05, 1.0),
    "pump_delay": (0.0, 5.0),
    "pump_rise": (0.0, 5.0),
    "bulk_modulus": (500.0, 20000.0),
    "dry_friction": (0.0, 1e5),
    "start_pressure": (5.0, 150.0),
    "delay": (0.0, 2.0),
    "dead_band": (0.0, 90.0),
    "sensor_lag": (0.0, 1.0),
    "sensor_scale": (0.8, 1.25),
}
"""values that real actuators have, of the quantities that `hydroid suggest` asks about where they are not
free; of those with two sides it asks about both together and about each"""


@dataclass(frozen=True)
class Quantity:
    """One physical quantity of an actuator."""

    name: str
    unit: str
    meaning: str
    source: str
    """of its default: article or ours"""

    @property
    def factor(self) -> float:
        """What turns a value in `unit` into SI."""
        return SI_FACTORS.get(self.unit, 1.0)


def _quantity(default: float | None, unit: str, meaning: str, source: str = "ours") -> Any:
    return Field(default, description=meaning, json_schema_extra={"unit": unit, "source": source})


Delay = Annotated[float, Field(ge=0, le=5)]
DeadBand = Annotated[float, Field(ge=0, lt=100)]


class HydraulicSettings(Settings):
    """All numbers of the actuator chain except areas and openings, which the arm's file gives by joint."""

    onset_a: float = _quantity(1.4, "V", "A of equation (2): voltage at the smallest command", "article")
    full_a: float = _quantity(10.0, "V", "B of equation (2): voltage at 100 %")
    onset_b: float = _quantity(1.2, "V", "C of equation (3)", "article")
    full_b: float = _quantity(10.0, "V", "D of equation (3)")
    dead_band_a: DeadBand = _quantity(
        0.0,
        "%",
        "command below which the pilot stage gives nothing, towards A; an overlap acts after the lag",
    )
    dead_band_b: DeadBand = _quantity(0.0, "%", "the same towards B")
    current_max: Positive = _quantity(0.9, "A", "I_max of equation (4)", "article")
    current_min: Positive = _quantity(0.3, "A", "I_min of equation (4)", "article")
    force_1: Positive = _quantity(8.0, "N", "F1: solenoid force at x1 and rated current", "article")
    force_2: Positive = _quantity(0.7, "N", "F2: solenoid force at x2 and rated current", "article")
    stroke_1: Positive = _quantity(0.8, "mm", "x1: plunger stroke at F1", "article")
    stroke_2: Positive = _quantity(12.0, "mm", "x2: plunger stroke at F2", "article")
    rated_current: Positive = _quantity(0.9, "A", "current at which F1 and F2 act")
    plunger_mass: Positive = _quantity(0.05, "kg", "m of equation (5)")
    plunger_damping_a: NotNegative = _quantity(
        20.0, "N·s/m", "λ of equation (5), coil A; the spool lags behind its coil by at most λ/K, here 10 ms"
    )
    plunger_damping_b: NotNegative = _quantity(20.0, "N·s/m", "the same of coil B")
    plunger_back_a: Positive = _quantity(
        1.0, "", "damping of coil A's plunger on its way back, as a multiple of that on its way out"
    )
    plunger_back_b: Positive = _quantity(1.0, "", "the same of coil B")
    plunger_stiffness: Positive = _quantity(2.0, "N/mm", "K of equation (5)")
    slot_width_a: Positive = _quantity(
        2.0, "mm", "w of equation (7): spool travel from first to full opening, towards A"
    )
    slot_width_b: Positive = _quantity(2.0, "mm", "the same towards B")
    overlap_a: NotNegative = _quantity(0.0, "mm", "spool travel before the valve opens, towards A")
    overlap_b: NotNegative = _quantity(0.0, "mm", "spool travel before the valve opens, towards B")
    opening_exponent_a: Positive = _quantity(
        1.0,
        "",
        "1: opening proportional to spool travel; above 1: it grows faster towards the end; towards A",
    )
    opening_exponent_b: Positive = _quantity(1.0, "", "the same towards B")
    notch_1_a: Positive = _quantity(
        1.0,
        "",
        "slope of the opening, as a multiple of what the exponent says, where that is 0 to 4 % of full; "
        "towards A",
    )
    notch_1_b: Positive = _quantity(1.0, "", "the same towards B")
    notch_2_a: Positive = _quantity(1.0, "", "the same from 4 to 10 %, towards A")
    notch_2_b: Positive = _quantity(1.0, "", "the same towards B")
    notch_3_a: Positive = _quantity(1.0, "", "the same from 10 to 25 %, towards A")
    notch_3_b: Positive = _quantity(1.0, "", "the same towards B")
    notch_4_a: Positive = _quantity(1.0, "", "the same from 25 to 50 %, towards A; 1 beyond")
    notch_4_b: Positive = _quantity(1.0, "", "the same towards B")
    return_a: Positive = _quantity(
        1.0, "", "opening of edge A→T as a multiple of edge P→B's; both open for a motion towards B"
    )
    return_b: Positive = _quantity(1.0, "", "opening of edge B→T as a multiple of edge P→A's")
    anticavitation: NotNegative = _quantity(
        0.0,
        "mm²",
        "opening of the check valve that fills a chamber from the tank where it lacks oil; 0: none",
    )
    leakage: NotNegative = _quantity(1e-4, "mm²", "leakage area of every metering edge, open or shut")
    flow_coefficient: Positive = _quantity(0.7, "", "C_q of equation (7)")
    transition_pressure: Positive = _quantity(0.2, "bar", "pressure drop below which flow is laminar")
    flow_limit: Positive | None = _quantity(
        None, "L/min", "largest flow that the pump gives to one actuator; null: no limit"
    )
    pump_flow: Positive | None = _quantity(
        None, "L/min", "largest flow that the pump gives to all actuators together; null: no limit"
    )
    pump_droop: NotNegative = _quantity(
        0.0, "bar", "fall of the supply pressure from no flow to the pump's full flow"
    )
    pump_idle: Annotated[float, Field(ge=0, le=1)] = _quantity(
        1.0, "", "part of its flow that the pump gives before it comes up"
    )
    pump_delay: NotNegative = _quantity(0.0, "s", "time from the first command until the pump comes up")
    pump_rise: NotNegative = _quantity(
        0.0, "s", "time constant with which the pump comes up, and goes down after the last command"
    )
    line_volume: Positive = _quantity(100.0, "cm³", "oil between pump and valves; it acts with a pump_flow")
    supply_pressure: Positive = _quantity(150.0, "bar", "p_S: pressure of the pump")
    tank_pressure: NotNegative = _quantity(5.0, "bar", "p_T: pressure of the return line")
    vapour_pressure: NotNegative = _quantity(0.0, "bar", "lowest pressure in a chamber")
    density: Positive = _quantity(860.0, "kg/m³", "ρ of the oil")
    bulk_modulus: Positive = _quantity(
        8000.0, "bar", "β of the oil; 800000 is nearly the article's stiff oil"
    )
    dead_volume: Positive = _quantity(
        30.0, "cm³", "volume of a cylinder's chamber with the rod at that end, hoses included"
    )
    dry_friction: NotNegative = _quantity(
        0.0, "N", "friction of a cylinder's seals; of a rotary actuator in N·m"
    )
    stop_penetration: NotNegative = _quantity(
        1e10, "N·s/m²", "K_p of equation (9): force of the end stops per penetration and speed"
    )
    start_pressure: Positive | None = _quantity(
        50.0,
        "bar",
        "pressure in B at the start, if that can hold the arm; null: the log's pressures, if it has any",
    )
    trapped_pressure: NotNegative | None = _quantity(
        None,
        "bar",
        "pressure in A of a joint that starts within 1 deg of an end of its range, where its stop carries "
        "what the oil does not; null: the oil carries all",
    )
    delay_a: Delay = _quantity(0.0, "s", "transport delay of the command to coil A")
    delay_b: Delay = _quantity(0.0, "s", "transport delay of the command to coil B")
    sensor_scale: Positive = _quantity(1.0, "", "turn that the angle's sensor reads, over the true one")
    sensor_lag: NotNegative = _quantity(0.0, "s", "time constant with which the sensor's reading follows")

    rotary_volume: Positive = 50.0
    """volume of each chamber of a rotary actuator [cm³]"""
    substeps: Annotated[int, Field(ge=1, le=100)] = 3
    """sub-steps of valves and oil in one MuJoCo step"""

    @model_validator(mode="before")
    @classmethod
    def _both_sides(cls, values: Any) -> Any:
        """Let a name without _a or _b set both sides."""
        if not isinstance(values, dict):
            return values
        spread: dict[Any, Any] = {}
        for key, value in values.items():
            sides = (f"{key}_a", f"{key}_b")
            for name in sides if sides[0] in cls.model_fields else (key,):
                if name in spread:
                    raise ValueError(f"{name} is given twice")
                spread[name] = value
        return spread


def _quantities() -> dict[str, Quantity]:
    of_arm = (  # by joint in the arm's file
        ("area_a", "mm²", "A_A: piston area of chamber A; of a rotary actuator its displacement in cm³/rad"),
        ("area_b", "mm²", "A_B: the same of chamber B"),
        ("opening_a", "mm²", "largest opening of the valve, towards A"),
        ("opening_b", "mm²", "largest opening of the valve, towards B"),
        ("pivot_distance_1", "m", "a: distance of a cylinder's farther pivot from the joint's axis"),
        ("pivot_distance_2", "m", "b: distance of the nearer pivot"),
        ("pivot_angle", "deg", "theta0: angle between both pivots at joint angle 0"),
    )
    of_settings = [
        Quantity(name, str(extra["unit"]), field.description or "", str(extra["source"]))
        for name, field in HydraulicSettings.model_fields.items()
        if isinstance(extra := field.json_schema_extra, dict)
    ]
    return {q.name: q for q in (*(Quantity(*q, "arm's file") for q in of_arm), *of_settings)}


QUANTITIES = _quantities()
"""the quantities by name; the kernel's arrays use these names"""

OF_THE_PIVOTS = ("pivot_distance_1", "pivot_distance_2", "pivot_angle")
"""quantities whose nominal values are the model's"""
OF_THE_PUMP = tuple(name for name in QUANTITIES if name.startswith("pump_") or name == "line_volume")
"""quantities that all actuators share, since they have one pump"""

TARGETS = {name: (name,) for name in QUANTITIES} | {
    name[:-2]: (name, f"{name[:-2]}_b") for name in QUANTITIES if name.endswith("_a")
}
"""the quantities that a name sets: itself, or both sides; parameters of a fit use these names"""


def actuator_values(
    actuator: LinearActuator | Cylinder | RotaryActuator | None, settings: HydraulicSettings
) -> dict[str, float | None]:
    """Return the value of every quantity of one actuator, in the units of QUANTITIES; None: no limit.

    A joint without an actuator has sizes of 1, which nothing uses: it is never driven in stage 2. Of a
    cylinder's settings alone the pivots are not known, and 0.
    """
    values: dict[str, float | None] = settings.model_dump()
    values |= dict.fromkeys(OF_THE_PIVOTS, 0.0)
    if isinstance(actuator, LinearActuator):
        sides, actuator = actuator.triangle, actuator.settings
        values |= zip(OF_THE_PIVOTS, (sides.a, sides.b, sides.theta0), strict=True)
    match actuator:
        case None:
            sizes = 1.0, 1.0, 1.0
        case Cylinder():
            sizes = actuator.area_a, actuator.area_b, actuator.max_opening
        case RotaryActuator():
            sizes = actuator.displacement, actuator.displacement, actuator.max_opening
            values["dead_volume"] = settings.rotary_volume
    values["area_a"], values["area_b"], values["opening_a"] = sizes
    values["opening_b"] = values["opening_a"]
    return {name: values[name] for name in QUANTITIES}
