"""The report of one actuator: its curves at rest, from the command to the joint's torque."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import coefficients, linkages, without_actuator
from hydroid.hydraulics.solenoid import coil_current, coil_force, curve_exists, resting_stroke, side_voltage
from hydroid.hydraulics.valve import opening, port_flow, spool
from hydroid.parameters import Array
from hydroid.quantities.delta import Precision
from hydroid.report import style
from hydroid.report.page import Page, Plot, Section
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator, RotaryActuator
from hydroid.simulation import Candidates

SIDE_A: dict[str, Any] = {"color": style.SEARCH}
SIDE_B: dict[str, Any] = {"color": style.REFINED, "linestyle": (0, (5, 2))}
_SHADES = (style.OTHERS[3], style.OTHERS[0], style.OTHERS[2], style.OTHERS[1])
_LITRES = 6e4
"""L/min in a m³/s"""
_COMMAND = np.linspace(-100.0, 100.0, 2001)
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
    """The precision of a fit, and the joint's COEFFICIENTS for candidates, (n, P) -> (n,)."""

    precision: Precision
    records: Callable[[Array], Any]

    def band(self, function: Callable[[Any], Array]) -> Array:
        """Return the 95 % interval of a curve, shape (m, 2), from its points of one record, shape (m,)."""

        def curves(theta: Array) -> Array:
            return np.stack([function(record) for record in self.records(theta)])

        return style.finite(self.precision.propagate(curves, positive=False).interval)


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
    caption = (
        "Numbers in brackets are the article's equations. Dots: where the plunger rests at each current."
    )
    if actuator.known is not None:
        caption += " Bands: 95 % intervals. A curve without a band is given, or not determined by the logs."
    section = Section(
        "From the command to the torque", plots=(Plot("actuator", caption, partial(draw, actuator)),)
    )
    lead = "What its parameters mean at rest, from the command to the torque at the joint."
    return Page("actuator", f"Actuator of {actuator.title.lower()}", lead, (section,))


def draw(actuator: JointActuator) -> Figure:
    """Draw all curves of an actuator."""
    drawing = style.figure(11.0, 7.6, left=0.65, top=0.75, bottom=0.5)
    style.headline(drawing, actuator.title)
    panels = drawing.subplots(4, 2, gridspec_kw={"hspace": 0.45, "wspace": 0.25})
    curves = _calibration, _current, _force, _spool, _opening, _flow, _pressure_flow, _torque
    for axes, curve in zip(panels.flat, curves, strict=True):
        curve(axes, actuator)
    return drawing


def _calibration(axes: Axes, actuator: JointActuator) -> None:
    _sides(axes, actuator, _COMMAND, lambda p: _voltages(p, _COMMAND))
    _name(axes, "Calibration, (2) and (3)", "command [%]", "voltage [V]")


def _current(axes: Axes, actuator: JointActuator) -> None:
    _sides(axes, actuator, _COMMAND, lambda p: _currents(p, _COMMAND))
    axes.set_ylim(0, 1.1 * float(actuator.parameters.current_max))
    _name(axes, "Coil current, (4)", "command [%]", "current [A]")


def _force(axes: Axes, actuator: JointActuator) -> None:
    p = actuator.parameters
    coil, gap = float(p.coil), float(p.gap)
    stroke = np.linspace(0.0, 1.08 * p.stroke_2, 400)
    currents = {float(i) for i in (p.current_min, 0.5 * (p.current_min + p.current_max), p.current_max)}
    for shade, current in zip(_SHADES, sorted(currents | {float(p.rated_current)}), strict=False):
        drive = coil * current**2
        force = partial(_coil_force, current=current, stroke=stroke)
        _curve(axes, actuator, 1e3 * stroke, force, color=shade, label=f"{current:.3g} A")
        rest = resting_stroke(drive, gap, p.plunger_stiffness)
        axes.plot(1e3 * rest, p.plunger_stiffness * rest, "o", color=shade, markeredgecolor="white", zorder=4)
    axes.plot(1e3 * stroke, p.plunger_stiffness * stroke, color=style.MEASURED, linewidth=1.0, label="spring")
    points = 1e3 * np.array([p.stroke_1, p.stroke_2]), np.array([p.force_1, p.force_2])
    axes.plot(*points, "D", color=style.REFINED, markeredgecolor="white", label="F1, F2 (rated)")
    axes.plot([], [], "o", color=style.GREY, label="at rest")
    steepest = float(coil_force(coil * max(currents) ** 2, 0.0, gap))
    axes.set_ylim(0, min(1.6 * float(p.force_1), 1.1 * steepest))
    _name(axes, "Solenoid force, (5)", "stroke [mm]", "force [N]", "upper right")


def _spool(axes: Axes, actuator: JointActuator) -> None:
    p = actuator.parameters
    _curve(axes, actuator, _COMMAND, lambda p: 1e3 * _displacement(p, _COMMAND), **SIDE_A)
    for sign, overlap, slot in ((1.0, p.overlap_a, p.slot_width_a), (-1.0, p.overlap_b, p.slot_width_b)):
        for edge, label in ((0.0, "opens"), (slot, "fully open")):
            at = 1e3 * sign * (overlap + edge)
            dashes, once = ":" if edge else "--", label if sign > 0 else None
            axes.axhline(float(at), color=style.GREY, linestyle=dashes, linewidth=1.0, label=once)
    axes.set_ylim(*(1.2 * limit for limit in axes.get_ylim()))
    _name(axes, "Spool at rest, (6)", "command [%]", "displacement [mm]", "upper left", 2)


def _opening(axes: Axes, actuator: JointActuator) -> None:
    at = _spool_range(actuator.parameters)

    def areas(p: Any) -> tuple[Array, Array]:
        area = 1e6 * opening(at, p)
        return np.where(at >= 0, area, np.nan), np.where(at <= 0, area, np.nan)

    _sides(axes, actuator, 1e3 * at, areas)
    _name(axes, "Valve opening", "spool displacement [mm]", "opening [mm²]")


def _flow(axes: Axes, actuator: JointActuator) -> None:
    p = actuator.parameters
    at = _spool_range(p)
    for shade, drop in zip(_SHADES, _DROPS, strict=False):
        flow = partial(_edge_flow, drop=1e5 * drop, spool=at)
        _curve(axes, actuator, 1e3 * at, flow, color=shade, label=f"{drop:g} bar")
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
    _name(axes, "Flow from the pump, (7)", "spool displacement [mm]", "flow [L/min]", "upper center", 3)


def _pressure_flow(axes: Axes, actuator: JointActuator) -> None:
    p = actuator.parameters
    pressure = np.linspace(p.tank_pressure, p.supply_pressure, 400)
    for shade, share in zip(_SHADES, _OPENINGS, strict=True):
        flow = partial(_chamber_flow, pressure=pressure, share=share)
        _curve(axes, actuator, 1e-5 * pressure, flow, color=shade, label=f"{100 * share:g} % open")
    axes.set_ylim(0, 1.35 * axes.get_ylim()[1])
    across = "pressure in chamber A [bar]"
    _name(axes, "Flow from the pump into A, (7)", across, "flow [L/min]", "upper right", 2)


def _torque(axes: Axes, actuator: JointActuator) -> None:
    angle = np.linspace(*actuator.range, 400)
    # a rotary actuator's areas are its displacement
    linkage = actuator.linkage if isinstance(actuator.linkage, LinearActuator) else None
    arm = linkage.moment_arm(np.radians(angle)) if linkage else np.ones_like(angle)

    def torques(p: Any) -> tuple[Array, Array]:
        most, least = p.supply_pressure, p.tank_pressure
        return arm * (p.area_a * most - p.area_b * least), arm * (p.area_a * least - p.area_b * most)

    _sides(axes, actuator, angle, torques, ("A at supply", "B at supply"))
    axes.axhline(0.0, color=style.GREY, linewidth=0.8)
    lever = f", moment arm {1e3 * arm.min():.0f} to {1e3 * arm.max():.0f} mm" if linkage else ""
    _name(axes, "Largest static torque", f"angle [deg]{lever}", "torque [N·m]")


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
    return np.linspace(-1.15 * (p.overlap_b + p.slot_width_b), 1.15 * (p.overlap_a + p.slot_width_a), 2001)


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


def _sides(
    axes: Axes,
    actuator: JointActuator,
    at: Array,
    function: Callable[[Any], tuple[Array, Array]],
    labels: tuple[str, str] = ("side A", "side B"),
) -> None:
    for side, look, label in zip((0, 1), (SIDE_A, SIDE_B), labels, strict=True):
        _curve(axes, actuator, at, lambda p, side=side: function(p)[side], label=label, **look)


def _curve(
    axes: Axes, actuator: JointActuator, at: Array, function: Callable[[Any], Array], **look: Any
) -> None:
    """Draw a curve, which a function computes from one record, with its band where that is known."""
    axes.plot(at, function(actuator.parameters), **look)
    if actuator.known is not None:
        ends = actuator.known.band(function)
        axes.fill_between(at, *ends.T, color=look["color"], alpha=0.2, linewidth=0)


def _name(axes: Axes, title: str, across: str, up: str, place: Any = "best", columns: int = 1) -> None:
    axes.set_title(title)
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc=place, fontsize=8, ncols=columns, frameon=True, framealpha=0.8, edgecolor="none")
