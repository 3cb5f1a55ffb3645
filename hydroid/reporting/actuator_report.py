"""The report of one actuator: its curves in steady state, from the command to the joint's torque."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
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
from hydroid.reporting.chart import SERIES, ZERO, Chart, Mark, Panel, finite
from hydroid.reporting.page import Page, Plot, Section
from hydroid.settings.arm import Joint
from hydroid.settings.linkage import LinearActuator

_COMMAND = np.linspace(-100.0, 100.0, 401)
_LEAD = "What its parameters mean in steady state, from the command to the torque at the joint."
_BANDS = " Bands: 95 % intervals, some thinner than the line. A curve of given values has none."

Curves = Mapping[str, Array]
"""by the label of each, shape (m,)"""


@dataclass(frozen=True, eq=False)
class JointActuator:
    """One joint's actuator at an estimate.

    Attributes:
        joint: its range [deg] and its linkage.
        records: its COEFFICIENTS for candidates, (n, P) -> (n,).
        theta: the estimate, shape (P,).
        posterior: how precisely a fit knows it; None: it is no fit's.
    """

    joint: Joint
    records: Callable[[Array], Any]
    theta: Array
    posterior: Posterior | None

    def panel(
        self,
        title: str,
        labels: tuple[str, str],
        at: Array,
        curves: Callable[[Any], Curves],
        more: Sequence[Mark] = (),
    ) -> Panel:
        """Draw curves of one record over `at`, shape (m,), by label, each with a 95 % band if it has one."""
        drawn, marks = curves(self.records(self.theta[None])[0]), list[Mark]()
        if self.posterior is not None:
            known = self.posterior.propagate(
                lambda theta: np.array(
                    [np.concatenate([*curves(one).values()]) for one in self.records(theta)]
                ),
                positive=False,
            )
            ends = finite(known.interval).reshape(len(drawn), len(at), 2)
            marks += [
                Mark("band", at, *band.T, color=color, alpha=0.2)
                for color, band in zip(SERIES, ends, strict=False)
            ]
        for color, (label, values) in zip(SERIES, drawn.items(), strict=False):
            marks.append(Mark("line", at, values, color=color, label=label))
        return Panel(*labels, (*marks, *more), title)


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

    p = records(model.theta[None])[0]
    if not curve_exists(p.force_1, p.force_2, p.stroke_1, p.stroke_2):
        what = f"no force-stroke curve runs through {p.force_1:g} N at {1e3 * p.stroke_1:g} mm"
        raise SettingsError(
            f"joint {joint}: {what} and {p.force_2:g} N at {1e3 * p.stroke_2:g} mm",
            where=model.source,
            hint="it needs F1 > F2 > 0, x2 > x1 > 0 and F1/F2 < (x2/x1)²",
        )
    return JointActuator(arm.joints[place], records, model.theta, stored_posterior(model))


def actuator_page(actuator: JointActuator) -> Page:
    """Return the page of one actuator; its figure is `actuator`."""
    caption = (
        "Numbers in brackets are the article's equations. Dots: the points of the force at rated current."
    )
    plot = Plot("actuator", caption + _BANDS * (actuator.posterior is not None), partial(draw, actuator))
    section = Section("From the command to the torque", plots=(plot,))
    return Page("actuator", f"Actuator of the joint {actuator.joint.name}", _LEAD, (section,))


def draw(actuator: JointActuator) -> Chart:
    """Draw the curves of an actuator: current, solenoid, spool, flow and torque."""
    p = actuator.records(actuator.theta[None])[0]
    stroke, angle = np.linspace(0.0, 1.08 * p.stroke_2, 200), np.linspace(*actuator.joint.range, 200)
    reach = 1.15 * np.linspace(-p.b.overlap - p.b.slot_width, p.a.overlap + p.a.slot_width, 401)  # [m]
    linkage, arm = (
        actuator.joint.actuator,
        np.ones_like(angle),
    )  # areas of a rotary actuator: its displacement
    if isinstance(linkage, LinearActuator):
        arm = linkage.moment_arm(np.radians(angle))

    def force(p: Any) -> Curves:
        currents = {"rated current": p.rated_current, "smallest current": p.current_min}
        forces = {name: coil_force(p.coil * i**2, stroke, p.gap) for name, i in currents.items()}
        return forces | {"spring": p.plunger_stiffness * stroke}

    def displacement(p: Any) -> Curves:
        strokes = (resting_stroke(p.coil * i**2, p.gap, p.plunger_stiffness) for i in _currents(p).values())
        return {"": 1e3 * spool(*strokes)}

    def flow(p: Any) -> Curves:
        area = opening(reach, p) + p.leakage
        return {
            f"{drop} bar": 6e4 * port_flow(p.supply_pressure - 1e5 * drop, p.supply_pressure, area, 0.0, p)[0]
            for drop in (10, 50, 100)
        }

    def torque(p: Any) -> Curves:
        most, least = p.supply_pressure, p.tank_pressure
        return {
            "A at supply": arm * (p.a.area * most - p.b.area * least),
            "B at supply": arm * (p.a.area * least - p.b.area * most),
        }

    points = 1e3 * np.array([p.stroke_1, p.stroke_2]), np.array([p.force_1, p.force_2])
    rated = Mark("points", *points, color="ink", label="F1, F2 (rated)", width=8)
    panel, millimetres = actuator.panel, "spool displacement [mm]"
    panels = (
        panel("Coil current, (2) to (4)", ("command [%]", "current [A]"), _COMMAND, _currents),
        panel("Solenoid force, (5)", ("stroke [mm]", "force [N]"), 1e3 * stroke, force, [rated]),
        panel("Spool in steady state, (6)", ("command [%]", millimetres), _COMMAND, displacement),
        panel("Flow from the pump, (7)", (millimetres, "flow [L/min]"), 1e3 * reach, flow),
        panel("Largest static torque", ("angle [deg]", "torque [N·m]"), angle, torque, [ZERO]),
    )
    return Chart(panels, columns=2)


def _currents(p: Any) -> Curves:
    """Current of both coils [A] over _COMMAND."""
    sides = {"side A": (_COMMAND, p.a), "side B": (-_COMMAND, p.b)}
    return {
        name: coil_current(side_voltage(u, side.onset, side.dead_band), p.current_max, p.current_min)
        for name, (u, side) in sides.items()
    }
