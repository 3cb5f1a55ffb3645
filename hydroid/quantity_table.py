"""Every quantity that can be stated or estimated, one row each; settings, models, fits and pages read them.

Of a quantity with two sides, such as `delay`, `delay_a` acts on motion towards A, which a positive command
causes, and `delay_b` towards B; the name without an ending sets both. Units are those of a drawing or data
sheet. Values marked as the article's are the ones it calls true. All others are ours: plausible sizes, not
measurements of a HydroLek.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from annotated_types import BaseMetadata, Ge, Gt, Le, Lt

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

Source = Literal["ours", "article", "arm's file", "fit"]
Limits = tuple[BaseMetadata, ...]
POSITIVE: Limits = (Gt(0),)
FROM_ZERO: Limits = (Ge(0),)


@dataclass(frozen=True)
class Quantity:
    """One physical quantity of a joint, its actuator, a link or the pump.

    Attributes:
        name: in settings and as a parameter of a fit.
        unit: of its values.
        default: value where nothing states one; None: no limit. Of a quantity with different sides a pair.
        plain: what it is, for readers who do not know its symbol.
        meaning: the same for those who set it.
        limits: of its values.
        span: values of real machines, between which `hydroid suggest` searches a quantity that is not free.
        source: what states it: article or ours, a default of `hydraulics`; else the arm's file, or only a
            fit (the mechanical quantities of both stages).
        sides: whether it has two.
        optional: whether null is allowed.
    """

    name: str
    unit: str
    default: float | tuple[float, float] | None
    plain: str
    meaning: str = ""
    limits: Limits = POSITIVE
    span: tuple[float, float] | None = None
    source: Source = "ours"
    sides: bool = False
    optional: bool = False

    @property
    def factor(self) -> float:
        """What turns a value in `unit` into SI."""
        return SI_FACTORS.get(self.unit, 1.0)

    @property
    def positive(self) -> bool:
        """Whether its values must be above 0."""
        return any(isinstance(limit, Gt) for limit in self.limits)

    @property
    def lowest(self) -> float:
        """The least value that a fit may try; 0 but for changes of a lever."""
        return float(min([limit.ge for limit in self.limits if isinstance(limit, Ge)], default=0.0))  # pyright: ignore[reportArgumentType]

    @property
    def of_the_pump(self) -> bool:
        """Whether all actuators share it, since they have one pump."""
        return self.name.startswith("pump_") or self.name == "line_volume"

    def each(self) -> Iterator["Quantity"]:
        """Yield the quantity itself, or its two sides."""
        if not self.sides:
            yield self
            return
        defaults = self.default if isinstance(self.default, tuple) else (self.default, self.default)
        for side, other, default in zip("AB", "BA", defaults, strict=True):
            name, plain = f"{self.name}_{side.lower()}", f"{self.plain}, side {side}"
            meaning = self.meaning.format(side=side, other=other)
            yield replace(self, name=name, default=default, plain=plain, meaning=meaning, sides=False)


ROWS = (
    # of a joint and of a link, in both stages
    Quantity("gain", "N·m/%", 0.0, "torque per command", source="fit", limits=FROM_ZERO),
    Quantity(
        "damping", "N·m·s/rad", 0.0, "damping of the joint", source="fit", limits=FROM_ZERO, span=(0.0, 1e5)
    ),
    Quantity(
        "stiffness", "N·m/rad", 0.0, "spring of the joint", source="fit", limits=FROM_ZERO, span=(0.0, 1e4)
    ),
    Quantity(
        "friction", "N·m", 0.0, "dry friction of the joint", source="fit", limits=FROM_ZERO, span=(0.0, 1e4)
    ),
    Quantity("mass", "kg", None, "mass", source="fit"),
    # of an actuator, in the arm's file; the defaults are those of a joint without one, which nothing uses
    Quantity(
        "area",
        "mm²",
        1.0,
        "piston area",
        "piston area of chamber {side}; of a rotary actuator its displacement in cm³/rad",
        source="arm's file",
        sides=True,
    ),
    Quantity(
        "opening",
        "mm²",
        1.0,
        "largest valve opening",
        "largest opening of the valve, towards {side}",
        source="arm's file",
        sides=True,
        span=(0.01, 1000.0),
    ),
    Quantity(
        "pivot_distance_1",
        "m",
        0.0,
        "distance of the cylinder's first pivot from the axis",
        "a: distance of one pivot of a cylinder from the joint's axis",
        source="arm's file",
    ),
    Quantity(
        "pivot_distance_2",
        "m",
        0.0,
        "distance of the cylinder's second pivot from the axis",
        "b: distance of the other pivot",
        source="arm's file",
    ),
    Quantity(
        "pivot_angle",
        "deg",
        0.0,
        "angle between the cylinder's pivots",
        "theta0: angle between both pivots at joint angle 0",
        source="arm's file",
    ),
    Quantity(
        "lever_slope",
        "",
        0.0,
        "rise of a rotary actuator's moment arm over its range",
        "change of a rotary actuator's moment arm from the middle of the joint's range to its upper end, as "
        "a part of it: for stand-ins of unknown linkages",
        limits=(Ge(-0.9), Le(0.9)),
        span=(-0.5, 0.5),
    ),
    Quantity(
        "lever_bend",
        "",
        0.0,
        "bend of a rotary actuator's moment arm over its range",
        "change of a rotary actuator's moment arm from the middle of the joint's range to both its ends, as "
        "a part of it; below 0 for a cylinder",
        limits=(Ge(-0.9), Le(0.9)),
        span=(-0.5, 0.5),
    ),
    # from the command to the current
    Quantity(
        "pilot_lag",
        "s",
        0.0,
        "lag before the dead band",
        "time constant with which the pilot stage of coil {side} follows the command, before the dead band",
        limits=FROM_ZERO,
        span=(0.0, 1.0),
        sides=True,
    ),
    Quantity(
        "onset",
        "V",
        (1.4, 1.2),
        "voltage at the smallest command",
        "voltage at the smallest command towards {side}: A of equation (2), C of equation (3)",
        limits=(),
        source="article",
        sides=True,
    ),
    Quantity(
        "dead_band",
        "%",
        0.0,
        "command below which nothing moves",
        "command below which the pilot stage gives nothing, towards {side}; an overlap acts after the lag",
        limits=(Ge(0), Lt(100)),
        span=(0.0, 90.0),
        sides=True,
    ),
    Quantity("current_max", "A", 0.9, "largest coil current", "I_max of equation (4)", source="article"),
    Quantity("current_min", "A", 0.3, "smallest coil current", "I_min of equation (4)", source="article"),
    # the solenoid
    Quantity(
        "force_1",
        "N",
        8.0,
        "solenoid force at the first stroke",
        "F1: solenoid force at x1 and rated current",
        source="article",
    ),
    Quantity(
        "force_2",
        "N",
        0.7,
        "solenoid force at the second stroke",
        "F2: solenoid force at x2 and rated current",
        source="article",
    ),
    Quantity(
        "stroke_1",
        "mm",
        0.8,
        "plunger stroke of the first force",
        "x1: plunger stroke at F1",
        source="article",
    ),
    Quantity(
        "stroke_2",
        "mm",
        12.0,
        "plunger stroke of the second force",
        "x2: plunger stroke at F2",
        source="article",
    ),
    Quantity("rated_current", "A", 0.9, "rated coil current", "current at which F1 and F2 act"),
    Quantity("plunger_mass", "kg", 0.05, "mass of the plunger", "m of equation (5)"),
    Quantity(
        "plunger_damping",
        "N·s/m",
        20.0,
        "damping of the plunger",
        "λ of equation (5), coil {side}; the spool lags behind its coil by at most λ/K, here 10 ms",
        limits=FROM_ZERO,
        span=(1.0, 5000.0),
        sides=True,
    ),
    Quantity(
        "plunger_back",
        "",
        1.0,
        "damping of the plunger on its way back, relative to its way out",
        "damping of coil {side}'s plunger on its way back, as a multiple of that on its way out",
        sides=True,
    ),
    Quantity("plunger_stiffness", "N/mm", 2.0, "spring of the plunger", "K of equation (5)"),
    # the valve
    Quantity(
        "slot_width",
        "mm",
        2.0,
        "spool travel to full opening",
        "w of equation (7): spool travel from first to full opening, towards {side}",
        sides=True,
    ),
    Quantity(
        "overlap",
        "mm",
        0.0,
        "spool travel before the valve opens",
        "spool travel before the valve opens, towards {side}",
        limits=FROM_ZERO,
        span=(0.0, 2.0),
        sides=True,
    ),
    Quantity(
        "opening_exponent",
        "",
        1.0,
        "shape of the valve's curve",
        "1: opening proportional to spool travel; above 1: it grows faster towards the end; towards {side}",
        span=(0.3, 4.0),
        sides=True,
    ),
    *(
        Quantity(
            f"notch_{number}",
            "",
            1.0,
            f"slope of the valve's curve between {part} of full opening",
            f"slope of the opening, as a multiple of what the exponent says, between {part} of full opening; "
            "towards {side}",
            sides=True,
        )
        for number, part in enumerate(("0 and 4 %", "4 and 10 %", "10 and 25 %", "25 and 50 %"), start=1)
    ),
    Quantity(
        "return",
        "",
        1.0,
        "return edge relative to the pump edge",
        "opening of edge {side}→T as a multiple of edge P→{other}'s; both open for a motion towards {other}",
        span=(0.2, 10.0),
        sides=True,
    ),
    Quantity(
        "anticavitation",
        "mm²",
        0.0,
        "opening of the anti-cavitation valve",
        "opening of the check valve that fills a chamber from the tank where it lacks oil; 0: none",
        limits=FROM_ZERO,
        span=(0.0, 10.0),
    ),
    Quantity(
        "leakage",
        "mm²",
        1e-4,
        "leakage area of the valve",
        "leakage area of every metering edge, open or shut",
        limits=FROM_ZERO,
        span=(0.0, 10.0),
    ),
    Quantity("flow_coefficient", "", 0.7, "flow coefficient", "C_q of equation (7), for oil of 860 kg/m³"),
    Quantity(
        "transition_pressure",
        "bar",
        0.2,
        "pressure drop of laminar flow",
        "pressure drop below which flow is laminar",
    ),
    Quantity(
        "flow_limit",
        "L/min",
        None,
        "largest flow to one actuator",
        "largest flow that the pump gives to one actuator; null: no limit",
        span=(0.1, 1000.0),
        optional=True,
    ),
    # the pump
    Quantity(
        "pump_flow",
        "L/min",
        None,
        "largest flow of the pump",
        "largest flow that the pump gives to all actuators together; null: no limit",
        span=(0.1, 1000.0),
        optional=True,
    ),
    Quantity(
        "pump_droop",
        "bar",
        0.0,
        "fall of the supply pressure with flow",
        "fall of the supply pressure from no flow to the pump's full flow",
        limits=FROM_ZERO,
        span=(0.0, 200.0),
    ),
    Quantity(
        "pump_idle",
        "",
        1.0,
        "idle share of the pump's flow",
        "part of its flow that the pump gives before it comes up",
        limits=(Ge(0), Le(1)),
        span=(0.05, 1.0),
    ),
    Quantity(
        "pump_delay",
        "s",
        0.0,
        "delay of the pump",
        "time from the first command until the pump comes up",
        limits=FROM_ZERO,
        span=(0.0, 5.0),
    ),
    Quantity(
        "pump_rise",
        "s",
        0.0,
        "time in which the pump comes up",
        "time constant with which the pump comes up, and goes down after the last command",
        limits=FROM_ZERO,
        span=(0.0, 5.0),
    ),
    Quantity(
        "line_volume",
        "cm³",
        100.0,
        "oil between pump and valves",
        "oil between pump and valves; it acts with a pump_flow",
    ),
    Quantity("supply_pressure", "bar", 150.0, "supply pressure", "p_S: pressure of the pump"),
    Quantity(
        "tank_pressure", "bar", 5.0, "tank pressure", "p_T: pressure of the return line", limits=FROM_ZERO
    ),
    # the chambers
    Quantity(
        "bulk_modulus",
        "bar",
        8000.0,
        "stiffness of the oil",
        "β of the oil; 800000 is nearly the article's stiff oil",
        span=(500.0, 20000.0),
    ),
    Quantity(
        "dead_volume",
        "cm³",
        30.0,
        "dead volume of the cylinder",
        "volume of a cylinder's chamber with the rod at that end, hoses included",
    ),
    Quantity(
        "dry_friction",
        "N",
        0.0,
        "friction of the cylinder's seals",
        "friction of a cylinder's seals; of a rotary actuator in N·m",
        limits=FROM_ZERO,
        span=(0.0, 1e5),
    ),
    Quantity(
        "stop_penetration",
        "N·s/m²",
        1e10,
        "stiffness of the end stops",
        "K_p of equation (9): force of the end stops per penetration and speed",
        limits=FROM_ZERO,
    ),
    Quantity(
        "start_pressure",
        "bar",
        50.0,
        "pressure at the start",
        "pressure in B at the start, if that can hold the arm; null: the log's pressures, if it has any",
        span=(5.0, 150.0),
        optional=True,
    ),
    Quantity(
        "trapped_pressure",
        "bar",
        None,
        "pressure trapped at a stop",
        "pressure in A of a joint that starts within 1 deg of an end of its range, where its stop carries "
        "what the oil does not; null: the oil carries all",
        limits=FROM_ZERO,
        optional=True,
    ),
    # delay and sensor
    Quantity(
        "delay",
        "s",
        0.0,
        "transport delay",
        "transport delay of the command to coil {side}",
        limits=(Ge(0), Le(5)),
        span=(0.0, 2.0),
        sides=True,
    ),
    Quantity(
        "sensor_scale",
        "",
        1.0,
        "scale of the angle's sensor",
        "turn that the angle's sensor reads, over the true one",
        span=(0.8, 1.25),
    ),
    Quantity(
        "sensor_lag",
        "s",
        0.0,
        "lag of the angle's sensor",
        "time constant with which the sensor's reading follows",
        limits=FROM_ZERO,
        span=(0.0, 1.0),
    ),
)
"""the one table, in the order of the settings"""

QUANTITIES = {quantity.name: quantity for row in ROWS for quantity in row.each()}
"""the quantities by name, each side by itself"""

CHOICES = {row.name: row for row in ROWS} | QUANTITIES
"""what a parameter of a fit can be, by name"""

TARGETS = {row.name: tuple(quantity.name for quantity in row.each()) for row in ROWS} | {
    name: (name,) for name in QUANTITIES
}
"""the quantities that a name sets: itself, or both sides"""

MECHANICAL: tuple[str, ...] = tuple(row.name for row in ROWS if row.source == "fit")
"""the quantities that both stages have"""
