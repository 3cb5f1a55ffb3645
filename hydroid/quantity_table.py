"""Every quantity that can be stated or estimated, one row each; settings, models, fits and pages read them.

Of a quantity with two sides, such as `delay`, `delay_a` acts on motion towards A, which a positive command
causes, and `delay_b` towards B; the name without an ending sets both. Units are those of a drawing or data
sheet. Onsets, currents, forces and strokes have the article's true values. All others are ours: plausible
sizes, not measurements of a HydroLek.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from hydroid.units import UNITS

FROM_ZERO = (0.0, math.inf)
OFF, ONE = (0.0, 0.0), (1.0, 1.0)  # defaults of quantities with two sides


@dataclass(frozen=True)
class Quantity:
    """One physical quantity of a joint, its actuator, a link or the pump.

    Attributes:
        name: in settings and as a parameter of a fit.
        unit: of its values.
        default: value where nothing states one; None: no limit. Of a quantity with two sides a pair.
        plain: what it is, for readers who do not know its symbol.
        note: what those who set it must know besides.
        span: values of real machines, between which `hydroid suggest` searches a quantity that is not free.
        limits: least and largest value; None: from 0 where 0 is the default, or else above 0.
        optional: whether null is allowed beside a number; where it is the default, it is.
    """

    name: str
    unit: str
    default: float | tuple[float, float] | None
    plain: str
    note: str = ""
    span: tuple[float, float] | None = None
    limits: tuple[float, float] | None = None
    optional: bool = False

    @property
    def meaning(self) -> str:
        """What it is, with the note."""
        return f"{self.plain}; {self.note}" if self.note else self.plain

    @property
    def factor(self) -> float:
        """What turns a value in `unit` into SI."""
        return UNITS[self.unit.lower()].factor if self.unit.lower() in UNITS else 1.0

    @property
    def positive(self) -> bool:
        """Whether its values must be above 0."""
        return self.limits is None and self.default not in (0.0, OFF)

    @property
    def lowest(self) -> float:
        """The least value that a fit may try; 0 but for changes of a lever."""
        return self.limits[0] if self.limits else 0.0

    @property
    def of_the_pump(self) -> bool:
        """Whether all actuators share it, since they have one pump."""
        return self.name.startswith("pump_") or self.name == "line_volume"

    def each(self) -> Iterator["Quantity"]:
        """Yield the quantity itself, or its two sides."""
        if not isinstance(self.default, tuple):
            yield self
            return
        for side, other, default in zip("AB", "BA", self.default, strict=True):
            name, plain = f"{self.name}_{side.lower()}", f"{self.plain}, side {side}"
            yield replace(
                self, name=name, default=default, plain=plain, note=self.note.format(side=side, other=other)
            )


_MECHANICAL = (
    Quantity("gain", "N·m/%", 0.0, "torque per command"),
    Quantity("damping", "N·m·s/rad", 0.0, "damping of the joint", span=(0.0, 1e5)),
    Quantity("stiffness", "N·m/rad", 0.0, "spring of the joint", span=(0.0, 1e4)),
    Quantity("friction", "N·m", 0.0, "dry friction of the joint", span=(0.0, 1e4)),
    Quantity("mass", "kg", None, "mass"),
)
"""of a joint and of a link, in both stages; only a fit states them"""

_ACTUATOR = (
    Quantity("area", "mm²", ONE, "piston area", "of a rotary actuator its displacement in cm³/rad"),
    Quantity("opening", "mm²", ONE, "largest valve opening", span=(0.01, 1000.0)),
    Quantity("pivot_distance_1", "m", 1.0, "distance of the cylinder's first pivot from the axis"),
    Quantity("pivot_distance_2", "m", 1.0, "distance of the cylinder's second pivot from the axis"),
    Quantity("pivot_angle", "deg", 1.0, "angle between the cylinder's pivots", "at joint angle 0"),
)
"""of an actuator, in the arm's file; the defaults are those of a joint without one, which nothing uses"""

_HYDRAULIC = (
    *(
        Quantity(
            f"lever_{shape}",
            "",
            0.0,
            f"{what} of a rotary actuator's moment arm over its range",
            f"its change from mid-range {where}, as a part of it: for stand-ins of unknown linkages",
            (-0.5, 0.5),
            (-0.9, 0.9),
        )
        for shape, what, where in (("slope", "rise", "to the upper end"), ("bend", "bend", "to both ends"))
    ),
    # from the command to the current
    Quantity("pilot_lag", "s", OFF, "time constant of the pilot stage", "before the dead band", (0.0, 1.0)),
    Quantity(
        "onset",
        "V",
        (1.4, 1.2),
        "voltage at the smallest command",
        "A of equation (2), C of (3)",
        limits=FROM_ZERO,
    ),
    Quantity("dead_band", "%", OFF, "command below which nothing moves", "", (0.0, 90.0), (0.0, 99.0)),
    Quantity("current_max", "A", 0.9, "largest coil current", "I_max of equation (4)"),
    Quantity("current_min", "A", 0.3, "smallest coil current", "I_min of equation (4)"),
    # the solenoid
    Quantity("force_1", "N", 8.0, "solenoid force at the first stroke", "F1"),
    Quantity("force_2", "N", 0.7, "solenoid force at the second stroke", "F2"),
    Quantity("stroke_1", "mm", 0.8, "plunger stroke of the first force", "x1"),
    Quantity("stroke_2", "mm", 12.0, "plunger stroke of the second force", "x2"),
    Quantity("rated_current", "A", 0.9, "rated coil current", "at which F1 and F2 act"),
    Quantity("plunger_mass", "kg", 0.05, "mass of the plunger", "m of equation (5)"),
    Quantity(
        "plunger_damping",
        "N·s/m",
        (20.0, 20.0),
        "damping of the plunger",
        "λ of (5)",
        (1.0, 5000.0),
        FROM_ZERO,
    ),
    Quantity("plunger_stiffness", "N/mm", 2.0, "spring of the plunger", "K of equation (5)"),
    # the valve
    Quantity("slot_width", "mm", (2.0, 2.0), "spool travel to full opening", "w of equation (7)"),
    Quantity("overlap", "mm", OFF, "spool travel before the valve opens", span=(0.0, 2.0)),
    Quantity(
        "opening_exponent", "", ONE, "exponent of the valve's opening over spool travel", "", (0.3, 4.0)
    ),
    Quantity("opening_lag", "s", 0.0, "time constant of the valve's opening", "behind the spool", (0.0, 1.0)),
    *(
        Quantity(
            f"notch_{n}",
            "",
            ONE,
            f"slope of the valve's curve between {part} of full opening",
            "1: as the exponent says",
        )
        for n, part in enumerate(("0 and 4 %", "4 and 10 %", "10 and 25 %", "25 and 50 %"), start=1)
    ),
    Quantity(
        "return",
        "",
        ONE,
        "return edge relative to the pump edge",
        "opening of edge {side}→T as a multiple of edge P→{other}'s; both open for a motion towards {other}",
        (0.2, 10.0),
    ),
    Quantity("anticavitation", "mm²", 0.0, "opening of the anti-cavitation valve", "0: none", (0.0, 10.0)),
    Quantity("leakage", "mm²", 1e-4, "leakage area of each edge of the valve", "", (0.0, 10.0), FROM_ZERO),
    Quantity("flow_coefficient", "", 0.7, "flow coefficient", "C_q of equation (7), for oil of 860 kg/m³"),
    Quantity("transition_pressure", "bar", 0.2, "pressure drop below which flow is laminar"),
    Quantity("flow_limit", "L/min", None, "largest flow to one actuator", "null: no limit", (0.1, 1000.0)),
    Quantity(
        "compensation",
        "",
        0.0,
        "share of the load that a pressure compensator keeps from the valve",
        "0: none, 1: a load does not slow the motion",
        (0.0, 1.0),
        (0.0, 1.0),
    ),
    Quantity(
        "draw",
        "",
        ONE,
        "flow from the pump over flow into the chamber",
        "below 1 where a valve feeds oil back from the other chamber, 0 where the load lowers itself",
        (0.1, 1.0),
        FROM_ZERO,
    ),
    # the pump
    Quantity("pump_flow", "L/min", None, "largest flow of the pump", "null: no limit", (0.1, 1000.0)),
    Quantity(
        "pump_droop", "bar", 0.0, "fall of the supply pressure from no flow to full flow", "", (0.0, 200.0)
    ),
    Quantity("pump_idle", "", 1.0, "share of the flow before the pump comes up", "", (0.05, 1.0), (0.0, 1.0)),
    Quantity("pump_delay", "s", 0.0, "time from the first command until the pump comes up", "", (0.0, 5.0)),
    Quantity(
        "pump_rise", "s", 0.0, "time constant with which the pump comes up and goes down", "", (0.0, 5.0)
    ),
    Quantity("line_volume", "cm³", 100.0, "oil between pump and valves", "it acts with a pump_flow"),
    Quantity("supply_pressure", "bar", 150.0, "supply pressure", "p_S"),
    Quantity("tank_pressure", "bar", 5.0, "tank pressure", "p_T, of the return line", limits=FROM_ZERO),
    # the chambers
    Quantity(
        "bulk_modulus", "bar", 8000.0, "stiffness of the oil", "800000: about the article's", (500.0, 20000.0)
    ),
    Quantity("dead_volume", "cm³", 30.0, "dead volume of a cylinder's chamber", "hoses included"),
    Quantity("dry_friction", "N", 0.0, "friction of the actuator's seals", "rotary: N·m", (0.0, 1e5)),
    Quantity(
        "stop_penetration",
        "N·s/m²",
        1e10,
        "stiffness of the end stops",
        "K_p of equation (9)",
        limits=FROM_ZERO,
    ),
    Quantity(
        "start_pressure",
        "bar",
        50.0,
        "pressure at the start",
        "in B, if that can hold the arm; null: the log's pressures, if it has any",
        (5.0, 150.0),
        optional=True,
    ),
    Quantity(
        "trapped_pressure",
        "bar",
        None,
        "pressure trapped at a stop",
        "in A of a joint that starts within 1 deg of an end of its range, where its stop carries what "
        "the oil does not; null: the oil carries all",
        limits=FROM_ZERO,
    ),
    # delay and sensor
    Quantity("delay", "s", OFF, "transport delay of the command", "", (0.0, 2.0), (0.0, 5.0)),
    Quantity(
        "sensor_scale", "", 1.0, "turn that the angle's sensor reads, over the true one", "", (0.8, 1.25)
    ),
    Quantity("sensor_lag", "s", 0.0, "time constant of the angle's sensor", "", (0.0, 1.0)),
)
"""of all joints, in the settings `hydraulics` and in their order"""

ROWS = (*_MECHANICAL, *_ACTUATOR, *_HYDRAULIC)  # the one table

QUANTITIES = {quantity.name: quantity for row in ROWS for quantity in row.each()}
"""the quantities by name, each side by itself"""

HYDRAULIC = {quantity.name: quantity for row in _HYDRAULIC for quantity in row.each()}
"""those that `hydraulics` sets for all joints"""

CHOICES = {row.name: row for row in ROWS} | QUANTITIES  # what a parameter of a fit can be, by name

TARGETS = {name: tuple(quantity.name for quantity in row.each()) for name, row in CHOICES.items()}
"""the quantities that a name sets: itself, or both sides"""

MECHANICAL = tuple(row.name for row in _MECHANICAL)  # the quantities that both stages have
