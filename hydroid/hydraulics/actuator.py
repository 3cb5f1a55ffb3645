"""The actuator plugin: the whole chain of every joint of a population, stepped beside MuJoCo.

    state = actuator.start(angle, torque)
    repeat: torque, armature = actuator.advance(state, command, angle, velocity, mass)
            MuJoCo takes one step with qfrc_applied = torque and dof_armature = armature (plus the arm's own)
            angle = actuator.close(state, velocity, mass), and MuJoCo's qpos becomes this angle

J is the number of moving joints, n that of candidates. `mass` is MuJoCo's sparse mass matrix `M` as bound by
`mujoco.batch`, (n, nC), as its last call left it; `entries`, (J, J), says where M[i, j] stands in such a row.
All joints that move belong in, also those without hydraulics (kind NONE): their inertia couples. Viscous
damping is the plugin's: MuJoCo's dof_damping must be 0, and its dof_armature the arm's own before `start`.
How it works and why it is stable: `hydroid.hydraulics.kernel`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydroid.hydraulics import kernel
from hydroid.hydraulics.cylinder import GIVE, four_bar, holding_pressures, oil_pressure, triangle, volume
from hydroid.hydraulics.records import JOINT_STATE, LINEAR, NONE, Array, Records, coefficients
from hydroid.hydraulics.solenoid import resting_stroke
from hydroid.settings.hydraulics import HydraulicSettings

START_PRESSURE = 50e5
"""in chamber B at the start where neither settings nor log say [Pa]; ours"""


@dataclass
class ActuatorState:
    """Plungers, oil and recent commands of a population; `advance` and `close` change it in place."""

    joints: NDArray[np.void]
    """shape (n, J), of JOINT_STATE"""
    commands: Array
    """the recent ones, newest last [%], shape (H, J)"""


@dataclass(frozen=True)
class Observation:
    """What can be measured on an actuator; flows are means over the last step. Joints without one have zeros.

    pressure [Pa], shape (n, J, 2): chambers A and B. flow [m³/s], shape (n, J, 2): into A and out of B.
    spool [m], shape (n, J). force [N], shape (n, J): A_A p_A − A_B p_B; of a rotary actuator a torque [N·m].
    line [Pa], shape (n, J): pressure of the pump's line, the same at all joints.
    """

    pressure: Array
    flow: Array
    spool: Array
    force: Array
    line: Array


class Actuator:
    """All actuators of a population on one model; `plugin` is what compiled code reads of them.

    Args:
        parameters: from `records.nominal_parameters`, shape (n, J); the coil of an infeasible candidate has
            no force, its spool never moves.
        linkages: from `records.linkages`, shape (J,), (1, J) or (n, J).
        damping: viscous damping D of the joints, the arm's own [N·m·s/rad], shape (n, J).
        period: MuJoCo's step [s].
        settings: for the sub-steps.
        entries: where M[i, j] stands in a row of `mass`, shape (J, J); by default rows are whole matrices.
    """

    def __init__(
        self,
        parameters: Records,
        linkages: Records,
        damping: ArrayLike,
        period: float,
        settings: HydraulicSettings,
        entries: NDArray[np.intp] | None = None,
    ) -> None:
        self.shape = parameters.shape
        joints = self.shape[1]
        driven = np.atleast_2d(linkages.kind)[0] != NONE
        order = np.argsort(driven, stable=True)
        places = np.arange(joints**2).reshape(joints, joints) if entries is None else entries
        self.plugin = kernel.Plugin(
            coefficients=coefficients(parameters, linkages),
            damping=np.array(np.broadcast_to(damping, self.shape), float, order="C"),
            order=order,
            entries=places[np.ix_(order, order)],
            idle=int(np.sum(~driven)),
            period=period,
            substeps=settings.substeps,
        )
        self._history = 2 + int(np.ceil(max(parameters.delay_a.max(), parameters.delay_b.max()) / period))

    def start(self, angle: Array, torque: Array) -> ActuatorState:
        """Return the state at rest at `angle` [rad], with the plungers' coils at I_min.

        The torque g(q) [N·m] is what the actuators must hold, or what a joint rests on where oil is trapped;
        both have the shape (n, J).
        """
        c = self.plugin.coefficients
        lever = np.where(c["kind"] == LINEAR, rod_motion(c, angle)[1], 1.0)
        area_a, area_b = c["area_a"], c["area_b"]
        level = np.where(np.isfinite(c["start_pressure"]), c["start_pressure"], START_PRESSURE)
        limits = c["supply_pressure"], c["tank_pressure"]
        pressure_a, pressure_b = holding_pressures(torque / lever, area_a, area_b, *limits, level)
        rests = np.isfinite(c["trapped_pressure"]) & (c["kind"] != NONE)
        pressure_a = np.where(rests, c["trapped_pressure"], pressure_a)
        pressure_b = np.where(rests, level, pressure_b)
        fill_a, fill_b = _fills(c, angle)
        z = np.zeros(self.shape, JOINT_STATE)
        z["oil_a"] = pressure_a + c["bulk_modulus"] * fill_a
        z["oil_b"] = pressure_b + c["bulk_modulus"] * fill_b
        rest = resting_stroke(c["coil"] * c["current_min"] ** 2, c["gap"], c["plunger_stiffness"])
        z["stroke_a"] = z["stroke_b"] = rest
        z["hold"], z["external"] = torque, -torque
        carried = np.where(rests, torque - lever * (area_a * pressure_a - area_b * pressure_b), 0.0)
        z["contact"], z["stop"] = carried / GIVE, angle + np.sign(carried) * GIVE
        z["line"], z["share"] = c["relief"], c["pump_idle"]
        return ActuatorState(z, np.zeros((self._history, self.shape[1])))

    def advance(
        self, state: ActuatorState, command: ArrayLike, angle: Array, velocity: Array, mass: Array
    ) -> tuple[Array, Array]:
        """Look ahead over one step, during which the command [%], shape (J,), is held.

        Angle [rad] and velocity [rad/s], shape (n, J), are those at its start; `mass` [kg·m²], shape (n, nC),
        contains the armature of the step before.

        Returns:
            Torque [N·m], damping included, and armature [kg·m²] for MuJoCo's step, shape (n, J) each.
        """
        state.commands[:-1] = state.commands[1:]
        state.commands[-1] = command
        angle, velocity, mass = (np.ascontiguousarray(x) for x in (angle, velocity, mass))
        exchange = kernel.Exchange(angle, velocity, mass, np.empty(self.shape), np.empty(self.shape))
        kernel.advance(self.plugin, state.joints, state.commands, exchange)
        return exchange.torque, exchange.armature

    def close(self, state: ActuatorState, velocity: Array, mass: Array) -> Array:
        """Take over MuJoCo's new velocity [rad/s] and `mass`; returns the new angle [rad], shape (n, J)."""
        angle = np.empty(self.shape)
        velocity, mass = np.ascontiguousarray(velocity), np.ascontiguousarray(mass)
        kernel.close(self.plugin, state.joints, velocity, mass, angle)
        return angle

    def observe(self, state: ActuatorState, angle: Array, candidates: slice = slice(None)) -> Observation:
        """Return pressures, flows, spool and force at `angle` [rad], shape (n, J).

        With one candidate chosen, n may as well be the samples of a record: its states, one after another.
        """
        c, z = self.plugin.coefficients[candidates], state.joints
        driven = c["kind"] != NONE
        fills = _fills(c, angle)
        pressure = [
            np.where(driven, oil_pressure(oil, fill, c["bulk_modulus"], c["vapour_pressure"]), 0.0)
            for oil, fill in zip((z["oil_a"], z["oil_b"]), fills, strict=True)
        ]
        force = c["area_a"] * pressure[0] - c["area_b"] * pressure[1]
        flow = np.stack([z["flow_a"], -z["flow_b"]], axis=-1)
        spool = z["stroke_a"] - z["stroke_b"]
        return Observation(np.stack(pressure, axis=-1), flow, spool, force, z["line"].copy())


def _fills(c: NDArray[np.void], angle: Array) -> tuple[Array, Array]:
    """Fill of chambers A and B, as `hydroid.hydraulics.cylinder` defines it."""
    travel = rod_motion(c, angle)[0]
    linear = [
        np.log(volume(x, c[area], c["dead_volume"]) / c["dead_volume"])
        for x, area in ((travel, "area_a"), (c["stroke"] - travel, "area_b"))
    ]
    rotary = angle * c["area_a"] / c["dead_volume"], -angle * c["area_b"] / c["dead_volume"]
    chosen = [np.where(c["kind"] == LINEAR, x, y) for x, y in zip(linear, rotary, strict=True)]
    return chosen[0], chosen[1]


def swallowed(c: NDArray[np.void], angle: Array, velocity: Array) -> Array:
    """Flow [m³/s] that the chamber behind the motion takes in at an angle [rad] and velocity [rad/s].

    Elementwise over COEFFICIENTS; 0 of a joint without actuator.
    """
    speed = np.where(c["kind"] == LINEAR, rod_motion(c, angle)[1], 1.0) * velocity
    flow = np.where(speed > 0, c["area_a"], -c["area_b"]) * speed
    return np.where(c["kind"] == NONE, 0.0, flow)


def rod_motion(c: NDArray[np.void], angle: Array) -> tuple[Array, Array, Array]:
    """Travel x [m], moment arm r = dx/dq [m/rad] and dr/dq of COEFFICIENTS at angles [rad], elementwise.

    Of a joint without a cylinder they mean nothing.
    """
    linear = c["kind"] == LINEAR
    # joints without a triangle get a harmless one
    a, b = np.where(linear, c["a"], 2.0), np.where(linear, c["b"], 1.0)
    rocks = c["rocker"] > 0
    if not rocks.any():
        return triangle(angle, a, b, c["theta0"], c["shortest"])
    with np.errstate(all="ignore"):  # joints without a rocker
        bars = four_bar(angle, c.view(np.recarray))
    psi, first, second = (np.where(rocks, x, y) for x, y in zip(bars, (angle, 1.0, 0.0), strict=True))
    travel, arm, slope = triangle(psi, a, b, c["theta0"], c["shortest"])
    return travel, arm * first, slope * first**2 + arm * second
