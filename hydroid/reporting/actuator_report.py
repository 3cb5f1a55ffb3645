"""The report of one actuator: its curves in steady state, from the command to the joint's torque."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import Records, coefficients, linkages, without_actuator
from hydroid.hydraulics.solenoid import coil_current, coil_force, curve_exists, resting_stroke, side_voltage
from hydroid.hydraulics.valve import opening, port_flow, spool
from hydroid.parameters import Array
from hydroid.posterior.posterior import Posterior
from hydroid.reporting.chart import Chart, Color, Mark, Panel, finite
from hydroid.reporting.page import Page, Plot, Section
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator, RotaryActuator
from hydroid.simulation import Candidates

_SIDES: tuple[Color, ...] = ("blue", "orange")
_SHADES: tuple[Color, ...] = ("sky", "green", "yellow", "pink")
_LITRES = 6e4
"""L/min in a m³/s"""
_COMMAND = np.linspace(-100.0, 100.0, 401)
_DROPS = (10.0, 50.0, 100.0)
"""pressure drops at which flow is drawn against the spool [bar]"""
_OPENINGS = (0.25, 0.5, 0.75, 1.0)
_LEAD = "What its parameters mean in steady state, from the command to the torque at the joint."

Curves = Mapping[str, Array]
"""by the label of each, shape (m,)"""


@dataclass(frozen=True)
class JointActuator:
    """One joint's actuator: its COEFFICIENTS as one record, its linkage, the joint's range [deg]."""

    title: str
    parameters: Any
    linkage: LinearActuator | RotaryActuator
    range: tuple[float, float]
    known: "KnownActuator | None" = None
    """how precisely a fit knows it"""

    def curves(
        self, at: Array, curves: Callable[[Any], Curves], colors: tuple[Color, ...] = _SIDES
    ) -> list[Mark]:
        """Return curves of one record over `at`, shape (m,), each with its 95 % band where that is known."""
        drawn = curves(self.parameters)
        bands: list[Any] = [None] * len(drawn)
        if self.known is not None:
            flat = self.known.band(lambda record: np.concatenate([*curves(record).values()]))
            bands = [*finite(flat).reshape(len(drawn), len(at), 2)]
        marks: list[Mark] = []
        for (label, values), color, band in zip(drawn.items(), colors, bands, strict=False):
            marks += [Mark("band", at, *band.T, color=color, alpha=0.2)] if band is not None else []
            marks.append(Mark("line", at, values, color=color, label=label))
        return marks


@dataclass(frozen=True, eq=False)
class KnownActuator:
    """The posterior of a fit, and the joint's COEFFICIENTS for candidates, (n, P) -> (n,)."""

    posterior: Posterior
    records: Callable[[Array], Any]

    def band(self, function: Callable[[Any], Array]) -> Array:
        """Return the 95 % interval of a curve, shape (m, 2), from its points of one record, shape (m,)."""

        def curves(theta: Array) -> Array:
            return np.stack([function(record) for record in self.records(theta)])

        return self.posterior.propagate(curves, positive=False).interval


def joint_actuator(arm: Arm, candidate: Candidates, joint: int, source: str) -> JointActuator:
    """Return one joint's actuator, joint 1-based, of a candidate with hydraulics.

    Raises:
        SettingsError: no such joint, or no force-stroke curve runs through its two points.
    """
    if not 1 <= joint <= len(arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(arm.joints)}", where=f"joint {joint}")
    p = joint_records(arm, candidate, joint)[0]
    if not curve_exists(p.force_1, p.force_2, p.stroke_1, p.stroke_2):
        raise SettingsError(
            f"joint {joint}: no force-stroke curve runs through {p.force_1:g} N at {1e3 * p.stroke_1:g} mm "
            f"and {p.force_2:g} N at {1e3 * p.stroke_2:g} mm",
            where=source,
            hint="it needs F1 > F2 > 0, x2 > x1 > 0 and F1/F2 < (x2/x1)²",
        )
    settings = arm.joints[joint - 1]
    if settings.actuator is None:
        raise without_actuator(arm, joint - 1)
    return JointActuator(f"Joint {joint}, {settings.name}", p, settings.actuator, settings.range)


def joint_records(arm: Arm, candidates: Candidates, joint: int) -> Any:
    """Return one joint's COEFFICIENTS, joint 1-based, of n candidates with hydraulics, shape (n,)."""
    joints: Records = candidates.joints[:, [joint - 1]]  # pyright: ignore[reportAssignmentType]
    return coefficients(joints, linkages(arm, [joint - 1], [joint - 1], joints))[:, 0]


def actuator_page(actuator: JointActuator) -> Page:
    """Return the page of an actuator: all its curves as one figure."""
    section = Section("From the command to the torque", plots=(actuator_plot(actuator),))
    return Page("actuator", f"Actuator of {actuator.title.lower()}", _LEAD, (section,))


def actuator_plot(actuator: JointActuator) -> Plot:
    """Return the figure of all curves of an actuator."""
    caption = (
        f"{actuator.title}. Numbers in brackets are the article's equations. Dots: where the plunger rests "
        "at each current."
    )
    if actuator.known is not None:
        caption += " Bands: 95 % intervals, some thinner than the line. A curve of given values has none."
    return Plot("actuator", caption, partial(draw, actuator))


def draw(actuator: JointActuator) -> Chart:
    """Draw all curves of an actuator."""
    return Chart((*_solenoid(actuator), *_valve(actuator), _torque(actuator)), columns=2)


def _solenoid(actuator: JointActuator) -> tuple[Panel, ...]:
    """Voltage and current of both coils over the command, and the force over the stroke."""
    p, command = actuator.parameters, "command [%]"
    stroke = np.linspace(0.0, 1.08 * p.stroke_2, 200)
    between = 0.5 * (p.current_min + p.current_max)
    currents = sorted({float(i) for i in (p.current_min, between, p.current_max, p.rated_current)})

    def force(p: Any) -> Curves:
        return {f"{i:.3g} A": coil_force(p.coil * i**2, stroke, p.gap) for i in currents}

    marks = actuator.curves(1e3 * stroke, force, _SHADES)
    for shade, current in zip(_SHADES, currents, strict=False):
        rest = np.array([resting_stroke(p.coil * current**2, p.gap, p.plunger_stiffness)])
        marks.append(Mark("points", 1e3 * rest, p.plunger_stiffness * rest, color=shade, width=8))
    points = 1e3 * np.array([p.stroke_1, p.stroke_2]), np.array([p.force_1, p.force_2])
    marks += [
        Mark("line", 1e3 * stroke, p.plunger_stiffness * stroke, color="ink", label="spring", width=1),
        Mark("points", *points, color="orange", label="F1, F2 (rated)", width=8, look="diamond"),
    ]
    top = min(1.6 * float(p.force_1), 1.1 * float(coil_force(p.coil * currents[-1] ** 2, 0.0, p.gap)))
    voltage, current = (tuple(actuator.curves(_COMMAND, curves)) for curves in (_voltages, _currents))
    most = 1.1 * float(p.current_max)
    return (
        Panel(command, "voltage [V]", voltage, "Calibration, (2) and (3)"),
        Panel(command, "current [A]", current, "Coil current, (4)", y_limits=(0.0, most)),
        Panel("stroke [mm]", "force [N]", tuple(marks), "Solenoid force, (5)", y_limits=(0.0, top)),
    )


def _valve(actuator: JointActuator) -> tuple[Panel, ...]:
    """Where the spool rests, what it opens, and the flow through it."""
    p = actuator.parameters
    # a little more than from full opening to full opening [m]
    at = np.linspace(-1.15 * (p.b.overlap + p.b.slot_width), 1.15 * (p.a.overlap + p.a.slot_width), 401)
    pressure = np.linspace(p.tank_pressure, p.supply_pressure, 200)

    def displacement(p: Any) -> Curves:
        strokes = (resting_stroke(p.coil * i**2, p.gap, p.plunger_stiffness) for i in _currents(p).values())
        return {"": 1e3 * spool(*strokes)}

    def areas(p: Any) -> Curves:
        area = 1e6 * opening(at, p)
        return {"side A": np.where(at >= 0, area, np.nan), "side B": np.where(at <= 0, area, np.nan)}

    def flows(p: Any) -> Curves:
        return {f"{drop:g} bar": _pump_flow(p, 1e5 * drop, opening(at, p)) for drop in _DROPS}

    def against(p: Any) -> Curves:
        drop = p.supply_pressure - pressure
        return {f"{100 * share:g} % open": _pump_flow(p, drop, share * p.a.opening) for share in _OPENINGS}

    edges = np.array([p.a.overlap, -p.b.overlap]), np.array([p.a.slot_width, -p.b.slot_width])
    rules = (
        Mark("rule", y=1e3 * edges[0], color="grey", label="valve opens", width=1, look="dotted"),
        Mark("rule", y=1e3 * (edges[0] + edges[1]), color="grey", label="fully open", width=1, look="dashed"),
    )
    spool_marks = (*actuator.curves(_COMMAND, displacement), *rules)
    opens, flow = actuator.curves(1e3 * at, areas), actuator.curves(1e3 * at, flows, _SHADES)
    into_a = actuator.curves(1e-5 * pressure, against, _SHADES)
    moved, flowing = "spool displacement [mm]", "flow [L/min]"
    return (
        Panel("command [%]", "displacement [mm]", spool_marks, "Spool in steady state, (6)"),
        Panel(moved, "opening [mm²]", tuple(opens), "Valve opening"),
        Panel(moved, flowing, tuple(flow), "Flow from the pump, (7)"),
        Panel("pressure in chamber A [bar]", flowing, tuple(into_a), "Flow from the pump into A, (7)"),
    )


def _torque(actuator: JointActuator) -> Panel:
    angle = np.linspace(*actuator.range, 200)
    # a rotary actuator's areas are its displacement
    linkage = actuator.linkage if isinstance(actuator.linkage, LinearActuator) else None
    arm = linkage.moment_arm(np.radians(angle)) if linkage else np.ones_like(angle)

    def torques(p: Any) -> Curves:
        most, least = p.supply_pressure, p.tank_pressure
        return {
            "A at supply": arm * (p.a.area * most - p.b.area * least),
            "B at supply": arm * (p.a.area * least - p.b.area * most),
        }

    marks = (*actuator.curves(angle, torques), Mark("rule", y=np.zeros(1), color="grey", width=1))
    lever = f", moment arm {1e3 * arm.min():.0f} to {1e3 * arm.max():.0f} mm" if linkage else ""
    return Panel(f"angle [deg]{lever}", "torque [N·m]", marks, "Largest static torque")


def _voltages(p: Any) -> Curves:
    """Voltage of both coils [V] over _COMMAND."""
    return {
        "side A": side_voltage(_COMMAND, p.a.onset, p.a.dead_band),
        "side B": side_voltage(-_COMMAND, p.b.onset, p.b.dead_band),
    }


def _currents(p: Any) -> Curves:
    """Current of both coils [A] over _COMMAND."""
    return {side: coil_current(v, p.current_max, p.current_min) for side, v in _voltages(p).items()}


def _pump_flow(p: Any, drop: Array | float, area: Array | float) -> Array:
    """Flow [L/min] from the pump over a pressure drop [Pa] through an edge of area [m²] and its leakage."""
    return _LITRES * port_flow(p.supply_pressure - drop, p.supply_pressure, area + p.leakage, 0.0, p)[0]
