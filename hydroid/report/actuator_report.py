"""The report of one actuator: its curves in steady state, from the command to the joint's torque."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import coefficients, linkages, without_actuator
from hydroid.hydraulics.solenoid import coil_current, coil_force, curve_exists, resting_stroke, side_voltage
from hydroid.hydraulics.valve import opening, port_flow, spool
from hydroid.parameters import Array
from hydroid.posterior.posterior import Posterior
from hydroid.report import style
from hydroid.report.chart import Chart, Color, Mark, Panel
from hydroid.report.page import Page, Plot, Section
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator, RotaryActuator
from hydroid.simulation import Candidates

_SIDES: tuple[Color, Color] = ("blue", "orange")
_SHADES: tuple[Color, ...] = ("sky", "green", "yellow", "pink")
_LITRES = 6e4
"""L/min in a m³/s"""
_COMMAND = np.linspace(-100.0, 100.0, 401)
_DROPS = (10.0, 50.0, 100.0)
"""pressure drops at which flow is drawn against the spool [bar]"""
_OPENINGS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class JointActuator:
    """One joint's actuator: its COEFFICIENTS as one record, its linkage, the joint's range [deg]."""

    title: str
    parameters: Any
    linkage: LinearActuator | RotaryActuator
    range: tuple[float, float]
    known: "KnownActuator | None" = None
    """how precisely a fit knows it"""


@dataclass(frozen=True, eq=False)
class KnownActuator:
    """The posterior of a fit, and the joint's COEFFICIENTS for candidates, (n, P) -> (n,)."""

    posterior: Posterior
    records: Callable[[Array], Any]

    def band(self, function: Callable[[Any], Array]) -> Array:
        """Return the 95 % interval of a curve, shape (m, 2), from its points of one record, shape (m,)."""

        def curves(theta: Array) -> Array:
            return np.stack([function(record) for record in self.records(theta)])

        return style.finite(self.posterior.propagate(curves, positive=False).interval)


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
    assert candidates.actuators is not None
    chosen = candidates.actuators[:, [joint - 1]].view(np.recarray)
    return coefficients(chosen, linkages(arm, [joint - 1], [joint - 1], chosen)).view(np.recarray)[:, 0]


def actuator_page(actuator: JointActuator) -> Page:
    """Return the page of an actuator: all its curves as one figure."""
    section = Section("From the command to the torque", plots=(actuator_plot(actuator),))
    lead = "What its parameters mean in steady state, from the command to the torque at the joint."
    return Page("actuator", f"Actuator of {actuator.title.lower()}", lead, (section,))


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
    curves = _calibration, _current, _force, _spool, _opening, _flow, _pressure_flow, _torque
    return Chart(tuple(curve(actuator) for curve in curves), columns=2)


def _calibration(actuator: JointActuator) -> Panel:
    marks = _both(actuator, _COMMAND, lambda p: _voltages(p, _COMMAND))
    return Panel("command [%]", "voltage [V]", marks, "Calibration, (2) and (3)")


def _current(actuator: JointActuator) -> Panel:
    marks = _both(actuator, _COMMAND, lambda p: _currents(p, _COMMAND))
    top = 1.1 * float(actuator.parameters.current_max)
    return Panel("command [%]", "current [A]", marks, "Coil current, (4)", y_limits=(0.0, top))


def _force(actuator: JointActuator) -> Panel:
    p = actuator.parameters
    coil, gap = float(p.coil), float(p.gap)
    stroke = np.linspace(0.0, 1.08 * p.stroke_2, 200)
    currents = {float(i) for i in (p.current_min, 0.5 * (p.current_min + p.current_max), p.current_max)}
    marks: list[Mark] = []
    for shade, current in zip(_SHADES, sorted(currents | {float(p.rated_current)}), strict=False):
        force = partial(_coil_force, current=current, stroke=stroke)
        marks += _curve(actuator, 1e3 * stroke, force, shade, f"{current:.3g} A")
        rest = np.array([resting_stroke(coil * current**2, gap, p.plunger_stiffness)])
        marks.append(Mark("points", 1e3 * rest, p.plunger_stiffness * rest, color=shade, width=8))
    spring = Mark("line", 1e3 * stroke, p.plunger_stiffness * stroke, color="ink", label="spring", width=1)
    points = 1e3 * np.array([p.stroke_1, p.stroke_2]), np.array([p.force_1, p.force_2])
    rated = Mark("points", *points, color="orange", label="F1, F2 (rated)", width=8, look="diamond")
    steepest = float(coil_force(coil * max(currents) ** 2, 0.0, gap))
    limits = 0.0, min(1.6 * float(p.force_1), 1.1 * steepest)
    return Panel("stroke [mm]", "force [N]", (*marks, spring, rated), "Solenoid force, (5)", y_limits=limits)


def _spool(actuator: JointActuator) -> Panel:
    p = actuator.parameters
    marks = _curve(actuator, _COMMAND, lambda p: 1e3 * _displacement(p, _COMMAND), _SIDES[0])
    for edge, label, look in ((False, "valve opens", "dotted"), (True, "fully open", "dashed")):
        at = [p.overlap_a + edge * p.slot_width_a, -(p.overlap_b + edge * p.slot_width_b)]
        marks.append(Mark("rule", y=1e3 * np.array(at, float), color="grey", label=label, width=1, look=look))
    return Panel("command [%]", "displacement [mm]", tuple(marks), "Spool in steady state, (6)")


def _opening(actuator: JointActuator) -> Panel:
    at = _spool_range(actuator.parameters)

    def areas(p: Any) -> tuple[Array, Array]:
        area = 1e6 * opening(at, p)
        return np.where(at >= 0, area, np.nan), np.where(at <= 0, area, np.nan)

    marks = _both(actuator, 1e3 * at, areas)
    return Panel("spool displacement [mm]", "opening [mm²]", marks, "Valve opening")


def _flow(actuator: JointActuator) -> Panel:
    at = _spool_range(actuator.parameters)
    marks: list[Mark] = []
    for shade, drop in zip(_SHADES, _DROPS, strict=False):
        flow = partial(_edge_flow, drop=1e5 * drop, spool=at)
        marks += _curve(actuator, 1e3 * at, flow, shade, f"{drop:g} bar")
    return Panel("spool displacement [mm]", "flow [L/min]", tuple(marks), "Flow from the pump, (7)")


def _pressure_flow(actuator: JointActuator) -> Panel:
    p = actuator.parameters
    pressure = np.linspace(p.tank_pressure, p.supply_pressure, 200)
    marks: list[Mark] = []
    for shade, share in zip(_SHADES, _OPENINGS, strict=True):
        flow = partial(_chamber_flow, pressure=pressure, share=share)
        marks += _curve(actuator, 1e-5 * pressure, flow, shade, f"{100 * share:g} % open")
    title = "Flow from the pump into A, (7)"
    return Panel("pressure in chamber A [bar]", "flow [L/min]", tuple(marks), title)


def _torque(actuator: JointActuator) -> Panel:
    angle = np.linspace(*actuator.range, 200)
    # a rotary actuator's areas are its displacement
    linkage = actuator.linkage if isinstance(actuator.linkage, LinearActuator) else None
    arm = linkage.moment_arm(np.radians(angle)) if linkage else np.ones_like(angle)

    def torques(p: Any) -> tuple[Array, Array]:
        most, least = p.supply_pressure, p.tank_pressure
        return arm * (p.area_a * most - p.area_b * least), arm * (p.area_a * least - p.area_b * most)

    marks = _both(actuator, angle, torques, ("A at supply", "B at supply"))
    zero = Mark("rule", y=np.zeros(1), color="grey", width=1)
    lever = f", moment arm {1e3 * arm.min():.0f} to {1e3 * arm.max():.0f} mm" if linkage else ""
    return Panel(f"angle [deg]{lever}", "torque [N·m]", (*marks, zero), "Largest static torque")


def _voltages(p: Any, command: Array) -> tuple[Array, Array]:
    return (
        side_voltage(command, p.onset_a, p.full_a, p.dead_band_a),
        side_voltage(-command, p.onset_b, p.full_b, p.dead_band_b),
    )


def _currents(p: Any, command: Array) -> tuple[Array, Array]:
    a, b = (coil_current(voltage, p.current_max, p.current_min) for voltage in _voltages(p, command))
    return a, b


def _displacement(p: Any, command: Array) -> Array:
    """Where the spool comes to rest [m]."""
    a, b = (resting_stroke(p.coil * i**2, p.gap, p.plunger_stiffness) for i in _currents(p, command))
    return spool(a, b)


def _spool_range(p: Any) -> Array:
    """A little more than from full opening to full opening [m]."""
    return np.linspace(-1.15 * (p.overlap_b + p.slot_width_b), 1.15 * (p.overlap_a + p.slot_width_a), 401)


def _coil_force(p: Any, current: float, stroke: Array) -> Array:
    return coil_force(p.coil * current**2, stroke, p.gap)


def _edge_flow(p: Any, drop: float, spool: Array) -> Array:
    return _pump_flow(p, drop, opening(spool, p))


def _chamber_flow(p: Any, pressure: Array, share: float) -> Array:
    return _pump_flow(p, p.supply_pressure - pressure, share * p.opening_a)


def _pump_flow(p: Any, drop: Array | float, area: Array | float) -> Array:
    """Flow [L/min] from the pump over a pressure drop [Pa] through an edge of area [m²] and its leakage."""
    flow = port_flow(p.supply_pressure - drop, p.supply_pressure, area + p.leakage, 0.0, p)[0]
    return _LITRES * flow


def _both(
    actuator: JointActuator,
    at: Array,
    function: Callable[[Any], tuple[Array, Array]],
    labels: tuple[str, str] = ("side A", "side B"),
) -> tuple[Mark, ...]:
    sides = zip((0, 1), _SIDES, labels, strict=True)
    curves = (_curve(actuator, at, lambda p, i=i: function(p)[i], color, label) for i, color, label in sides)
    return tuple(mark for curve in curves for mark in curve)


def _curve(
    actuator: JointActuator, at: Array, function: Callable[[Any], Array], color: Color, label: str = ""
) -> list[Mark]:
    """Return a curve, which a function computes from one record, with its band where that is known."""
    line = Mark("line", at, function(actuator.parameters), color=color, label=label)
    if actuator.known is None:
        return [line]
    low, high = actuator.known.band(function).T
    return [Mark("band", at, low, high, color=color, alpha=0.2), line]
