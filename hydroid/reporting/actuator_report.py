"""The report of one actuator: its curves in steady state, from the command to the joint's torque."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import Records, coefficients, linkages, without_actuator
from hydroid.hydraulics.solenoid import coil_current, coil_force, curve_exists, resting_stroke, side_voltage
from hydroid.hydraulics.valve import opening, port_flow, spool
from hydroid.identified_model import IdentifiedModel
from hydroid.parameters import Array
from hydroid.posterior.posterior import Posterior, stored_posterior
from hydroid.problem.bindings import Bindings
from hydroid.reporting.chart import ZERO, Chart, Color, Mark, Panel, finite
from hydroid.reporting.page import Page, Plot, Section
from hydroid.settings.arm import Joint
from hydroid.settings.linkage import LinearActuator

_SIDES: tuple[Color, ...] = ("blue", "orange")
_SHADES: tuple[Color, ...] = ("sky", "green", "yellow", "pink")
_COMMAND = np.linspace(-100.0, 100.0, 401)
_LEAD = "What its parameters mean in steady state, from the command to the torque at the joint."
_BANDS = " Bands: 95 % intervals, some thinner than the line. A curve of given values has none."

Curves = Mapping[str, Array]
"""by the label of each, shape (m,)"""


@dataclass(frozen=True, eq=False)
class JointActuator:
    """One joint's actuator at an estimate.

    Attributes:
        title: number and name of the joint.
        joint: its range [deg] and its linkage.
        records: its COEFFICIENTS for candidates, (n, P) -> (n,).
        theta: the estimate, shape (P,).
        posterior: how precisely a fit knows it; None: it is no fit's.
    """

    title: str
    joint: Joint
    records: Callable[[Array], Any]
    theta: Array
    posterior: Posterior | None

    @cached_property
    def parameters(self) -> Any:
        """The COEFFICIENTS at the estimate, one record."""
        return self.records(self.theta[None])[0]

    def panel(
        self,
        title: str,
        labels: tuple[str, str],
        at: Array,
        curves: Callable[[Any], Curves],
        more: Sequence[Mark] = (),
        top: float | None = None,
    ) -> Panel:
        """Draw curves of one record over `at`, shape (m,), each with its 95 % band where that is known."""

        def flat(theta: Array) -> Array:
            return np.array([np.concatenate([*curves(one).values()]) for one in self.records(theta)])

        drawn, marks = curves(self.parameters), list[Mark]()
        colors = _SIDES if len(drawn) <= len(_SIDES) else _SHADES
        if self.posterior is not None:
            ends = finite(self.posterior.propagate(flat, positive=False).interval)
            for color, band in zip(colors, ends.reshape(len(drawn), len(at), 2), strict=False):
                marks.append(Mark("band", at, *band.T, color=color, alpha=0.2))
        for color, (label, values) in zip(colors, drawn.items(), strict=False):
            marks.append(Mark("line", at, values, color=color, label=label))
        return Panel(*labels, (*marks, *more), title, y_limits=None if top is None else (0.0, top))


def joint_actuator(model: IdentifiedModel, joint: int) -> JointActuator:
    """Return one joint's actuator, joint 1-based, of a model with hydraulics.

    Raises:
        SettingsError: no such joint, or no force-stroke curve runs through its two points.
    """
    arm, bindings, place = model.settings.arm, Bindings(model.settings), joint - 1
    if not 1 <= joint <= len(arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(arm.joints)}", where=f"joint {joint}")
    if arm.joints[place].actuator is None:
        raise without_actuator(arm, place)

    def records(theta: Array) -> Any:
        joints: Records = bindings.candidates(theta).joints[:, [place]]  # pyright: ignore[reportAssignmentType]
        return coefficients(joints, linkages(arm, [place], [place], joints))[:, 0]

    title, posterior = f"Joint {joint}, {arm.joints[place].name}", stored_posterior(model)
    actuator = JointActuator(title, arm.joints[place], records, model.theta, posterior)
    p = actuator.parameters
    if not curve_exists(p.force_1, p.force_2, p.stroke_1, p.stroke_2):
        what = f"no force-stroke curve runs through {p.force_1:g} N at {1e3 * p.stroke_1:g} mm"
        raise SettingsError(
            f"joint {joint}: {what} and {p.force_2:g} N at {1e3 * p.stroke_2:g} mm",
            where=model.source,
            hint="it needs F1 > F2 > 0, x2 > x1 > 0 and F1/F2 < (x2/x1)²",
        )
    return actuator


def actuator_page(actuator: JointActuator) -> Page:
    """Return the page of one actuator; its figure is `actuator`."""
    section = Section("From the command to the torque", plots=(actuator_plot(actuator, "actuator"),))
    return Page("actuator", f"Actuator of {actuator.title.lower()}", _LEAD, (section,))


def actuator_plot(actuator: JointActuator, name: str) -> Plot:
    """Return the figure of all curves of an actuator."""
    caption = (
        f"{actuator.title}. Numbers in brackets are the article's equations. Dots: where the plunger rests "
        f"at each current.{'' if actuator.posterior is None else _BANDS}"
    )
    return Plot(name, caption, partial(draw, actuator))


def draw(actuator: JointActuator) -> Chart:
    """Draw all curves of an actuator."""
    return Chart((*_solenoid(actuator), *_valve(actuator), _torque(actuator)), columns=2)


def _solenoid(actuator: JointActuator) -> tuple[Panel, ...]:
    """Voltage and current of both coils over the command, and the force over the stroke."""
    p = actuator.parameters
    stroke = np.linspace(0.0, 1.08 * p.stroke_2, 200)
    between = 0.5 * (p.current_min + p.current_max)
    currents = np.unique([p.current_min, between, p.current_max, p.rated_current])

    def force(p: Any) -> Curves:
        return {f"{i:.3g} A": coil_force(p.coil * i**2, stroke, p.gap) for i in currents}

    rest = np.array([resting_stroke(p.coil * i**2, p.gap, p.plunger_stiffness) for i in currents])
    points = 1e3 * np.array([p.stroke_1, p.stroke_2]), np.array([p.force_1, p.force_2])
    more = (
        Mark("line", 1e3 * stroke, p.plunger_stiffness * stroke, color="ink", label="spring", width=1),
        Mark("points", 1e3 * rest, p.plunger_stiffness * rest, color="ink", width=8),
        Mark("points", *points, color="orange", label="F1, F2 (rated)", width=8, look="diamond"),
    )
    strongest = min(1.6 * float(p.force_1), 1.1 * float(coil_force(p.coil * currents[-1] ** 2, 0.0, p.gap)))
    voltage, current = ("command [%]", "voltage [V]"), ("command [%]", "current [A]")
    return (
        actuator.panel("Calibration, (2) and (3)", voltage, _COMMAND, _voltages),
        actuator.panel("Coil current, (4)", current, _COMMAND, _currents, top=1.1 * float(p.current_max)),
        actuator.panel(
            "Solenoid force, (5)", ("stroke [mm]", "force [N]"), 1e3 * stroke, force, more, strongest
        ),
    )


def _valve(actuator: JointActuator) -> tuple[Panel, ...]:
    """Where the spool rests, what it opens, and the flow through it."""
    p = actuator.parameters
    opens = np.array([-p.b.overlap, p.a.overlap])
    full = opens + np.array([-p.b.slot_width, p.a.slot_width])
    at = 1.15 * np.linspace(full[0], full[1], 401)  # [m]
    pressure = np.linspace(p.tank_pressure, p.supply_pressure, 200)

    def displacement(p: Any) -> Curves:
        strokes = (resting_stroke(p.coil * i**2, p.gap, p.plunger_stiffness) for i in _currents(p).values())
        return {"": 1e3 * spool(*strokes)}

    def areas(p: Any) -> Curves:
        area = 1e6 * opening(at, p)
        return {"side A": np.where(at >= 0, area, np.nan), "side B": np.where(at <= 0, area, np.nan)}

    def flows(p: Any) -> Curves:
        return {f"{drop} bar": _pump_flow(p, 1e5 * drop, opening(at, p)) for drop in (10, 50, 100)}

    def against(p: Any) -> Curves:
        drop = p.supply_pressure - pressure
        return {f"{s} % open": _pump_flow(p, drop, s / 100 * p.a.opening) for s in (25, 50, 75, 100)}

    rules = (
        Mark("rule", y=1e3 * opens, color="grey", label="valve opens", width=1, look="dotted"),
        Mark("rule", y=1e3 * full, color="grey", label="fully open", width=1, look="dashed"),
    )
    spools, area = ("command [%]", "displacement [mm]"), ("spool displacement [mm]", "opening [mm²]")
    moved, chamber = (area[0], "flow [L/min]"), ("pressure in chamber A [bar]", "flow [L/min]")
    return (
        actuator.panel("Spool in steady state, (6)", spools, _COMMAND, displacement, rules),
        actuator.panel("Valve opening", area, 1e3 * at, areas),
        actuator.panel("Flow from the pump, (7)", moved, 1e3 * at, flows),
        actuator.panel("Flow from the pump into A, (7)", chamber, 1e-5 * pressure, against),
    )


def _torque(actuator: JointActuator) -> Panel:
    angle, linkage = np.linspace(*actuator.joint.range, 200), actuator.joint.actuator
    arm, lever = np.ones_like(angle), ""  # a rotary actuator's areas are its displacement
    if isinstance(linkage, LinearActuator):
        arm = linkage.moment_arm(np.radians(angle))
        lever = f", moment arm {1e3 * arm.min():.0f} to {1e3 * arm.max():.0f} mm"

    def torques(p: Any) -> Curves:
        most, least = p.supply_pressure, p.tank_pressure
        return {
            "A at supply": arm * (p.a.area * most - p.b.area * least),
            "B at supply": arm * (p.a.area * least - p.b.area * most),
        }

    labels = f"angle [deg]{lever}", "torque [N·m]"
    return actuator.panel("Largest static torque", labels, angle, torques, [ZERO])


def _voltages(p: Any) -> Curves:
    """Voltage of both coils [V] over _COMMAND."""
    sides = {"side A": (_COMMAND, p.a), "side B": (-_COMMAND, p.b)}
    return {name: side_voltage(u, side.onset, side.dead_band) for name, (u, side) in sides.items()}


def _currents(p: Any) -> Curves:
    """Current of both coils [A] over _COMMAND."""
    return {side: coil_current(v, p.current_max, p.current_min) for side, v in _voltages(p).items()}


def _pump_flow(p: Any, drop: Array | float, area: Array | float) -> Array:
    """Flow [L/min] from the pump over a pressure drop [Pa] through an edge of area [m²] and its leakage."""
    return 6e4 * port_flow(p.supply_pressure - drop, p.supply_pressure, area + p.leakage, 0.0, p)[0]
