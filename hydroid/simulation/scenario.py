"""What is simulated: a log's joints, start and commands, and in stage 2 the chain from
command to torque."""

from copy import copy
from dataclasses import field, replace
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.signal import butter, sosfiltfilt

from hydroid.arm.locked import LockedArm, lock
from hydroid.arrays import Array, Index, Structs, record
from hydroid.errors import SettingsError
from hydroid.hydraulics.actuator import at_rest, plugin_of, swallowed
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.records import NONE, Records, coefficients
from hydroid.log import Log
from hydroid.rungs import GAIN, Stepping
from hydroid.settings.arm import Arm
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation.gravity import make_links
from hydroid.simulation.laws import LAWS
from hydroid.simulation.openings import Run, valve_openings
from hydroid.simulation.roles import Roles, roles
from hydroid.simulation.rollout import AT_REFERENCES, NO_LINKS, SteppedArm

ARMATURE = 1e6
"""[kg·m²], against about 10 for the whole arm: the arm's torques move it by less than
1e-6 of a radian"""
# times the largest inertia of the arm: the armature of a machine that is heavier
HEAVIEST = 1e4
# natural frequency of the servo [rad/s], slow against a step and fast against drift
SERVO = 10.0


class Prescribed:
    """The torque that makes some joints follow their logged motion, whatever the arm
    does to them.

    A prescribed joint gets an armature so large that nothing on the arm can move it,
    and the torque that gives that armature the logged acceleration; a critically damped
    servo of the same scale takes up what integration leaves over. The arm feels the
    joint's true motion, inertia coupling included. The stepped model gets the armature,
    and springs that pull towards angle 0.

    Attributes:
        columns: positions of the joints, which are 0-based among the arm's, among the
            moving ones.
        angle: at the start of each step [rad], shape (steps, P).
        velocity: during it [rad/s], shape (steps, P).
        torque: [N·m], shape (steps, P).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        log: Log,
        joints: Index,
        columns: Index,
        steps: int,
        cutoff_hz: float,
    ) -> None:
        armature = max(ARMATURE, HEAVIEST * model.dof_M0.max())
        model.dof_armature[columns] = armature
        model.qpos_spring[columns] = 0.0
        model.jnt_limited[columns] = False  # the machine's own stops are in the log
        self.columns = columns
        self.damping = 2 * SERVO * armature
        self.stiffness = SERVO**2 * armature
        step = log.period / steps
        motion = smooth(log.posed[:, joints], cutoff_hz * log.period)
        samples = np.arange((len(motion) - 1) * steps + 1) * step
        fine = np.empty((len(samples), len(joints)))
        for k, angle in enumerate(motion.T):
            fine[:, k] = np.interp(samples, log.time, angle)
        velocity = np.diff(fine, axis=0, prepend=fine[:1]) / step
        acceleration = np.diff(velocity, axis=0) / step
        self.angle: Array = fine[:-1]
        self.velocity: Array = velocity[1:]
        # semi-implicit Euler: the step from k to k+1 has the new velocity and the old
        # angle
        self.torque: Array = (
            armature * acceleration
            + self.damping * self.velocity
            + self.stiffness * self.angle
        )


def smooth(angle: Array, cutoff: float) -> Array:
    """Low-pass angles, shape (T, K), without phase shift; `cutoff` is in cycles per
    sample."""
    if cutoff >= 0.5 or len(angle) < 16 or not angle.size:
        return angle
    low_pass = butter(2, 2 * cutoff, output="sos")
    # scipy asks for padding that is shorter than the signal
    padding = min(len(angle) - 1, 100)
    # forwards and backwards, so that no phase is lost
    return sosfiltfilt(low_pass, angle, axis=0, padlen=padding)


class Layout(NamedTuple):
    """How a kernel steps the joints of an arm.

    joints: 0-based. idle: which of these no actuator drives. period: of a step [s].
    """

    joints: tuple[int, ...]
    idle: tuple[bool, ...]
    period: float
    substeps: int


@record
class Candidates:
    """Physical values of n candidates, joints and links in the arm's order.

    joints: of `hydroid.hydraulics.records.JOINT`, in SI but for the gain [N·m/%], shape
    (n, J). mass [kg]: of the links, shape (n, L).
    """

    joints: Records
    mass: Array
    _laid_out: dict[Layout, Structs] = field(
        default_factory=dict[Layout, Structs], init=False, repr=False
    )

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, rows: slice | Index) -> "Candidates":
        return Candidates(self.joints[rows], self.mass[rows])  # pyright: ignore[reportArgumentType]

    @cached_property
    def each_once(self) -> tuple["Candidates", Index]:
        """The candidates that differ, and which of these each one is, shape (n,)."""
        first, alike = distinct(self.joints, self.mass)
        if len(first) == len(self):
            return self, np.arange(len(self))
        return self[first], alike

    def laid_out(self, layout: Layout) -> Structs:
        """Return what the kernel reads of some joints, of COEFFICIENTS, (n, J): the
        same for all logs, and worked out once."""
        if layout not in self._laid_out:
            joints: Records = self.joints[:, np.array(layout.joints, np.intp)]  # pyright: ignore[reportAssignmentType]
            joints.kind[:, np.array(layout.idle, np.bool_)] = NONE
            table = coefficients(joints, layout.period, layout.substeps)
            self._laid_out[layout] = table.view(np.ndarray)
        return self._laid_out[layout]


def distinct(*tables: Any) -> tuple[Index, Index]:
    """Return which of n rows differ in any table, m of them, and which of these each
    row is, shape (n,)."""
    rows = list[bytes]()
    for parts in zip(*tables, strict=True):
        # bytes, so that rows are alike only if they are to the bit
        rows.append(b"".join(part.tobytes() for part in parts))
    _, first, alike = np.unique(rows, return_index=True, return_inverse=True)
    return first, alike


@record
class Response:
    """Simulated angles [rad], shape (n, T, K), of the K output joints; NaN throughout
    where one diverged.

    Of the L joints whose oil was asked for, chambers A and B have `pressure` [Pa] and
    take in `flow` [m³/s], the mean of the last step, both of shape (n, T, L, 2).
    `line` [Pa], shape (n, T), is the pressure of the pump's line; NaN without a pump.
    """

    angle: Array
    pressure: Array
    flow: Array
    line: Array

    def __getitem__(self, rows: slice | Index) -> "Response":
        return Response(
            self.angle[rows], self.pressure[rows], self.flow[rows], self.line[rows]
        )


class Scenario:
    """A log made ready for simulation: its commands drive, from the pose in which it
    begins.

    Joints that the log drives, and `outputs` (0-based), whose angles are wanted, are
    *active*. A setting says what the others do (`simulation.roles`).

    Attributes:
        machine: the whole arm.
        arm: the arm reduced to its V moving joints, springs slack in the start pose.
        roles: of the arm's joints.
        outputs: columns of the outputs among the moving joints, shape (K,).
        speed: of joints that move already where the log begins [rad/s], shape (V,); 0
            of the others.
        before: the commands that have been held then [%], shape (V,); 0 of the others.
        command: held during each step [%], shape (steps, V).
        beside: the same of the joints that follow the log, shape (steps, P), or (steps,
            0) where they have none.
        conditions: engine speed and oil temperature during each step, as of a `Course`.
        period: between samples [s].
        prescribed: the joints that follow the log.
        pressure: in which the moving joints' chambers rest at the start [Pa], (V, 2),
            NaN where not measured.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        arm: Arm,
        log: Log,
        outputs: list[int],
        settings: SimulationSettings,
        stepping: Stepping,
    ) -> None:
        self.settings = settings
        self.stepping = stepping
        self.machine = arm
        # a compared joint that nothing drives still holds its load by its oil
        active = log.driven.copy()
        active[outputs] = True
        self.roles = roles(active, settings.other_joints)
        moving = self.roles.moving
        self.arm: LockedArm = lock(spec, arm, moving, log.start)
        self.arm.model.opt.timestep = log.period / stepping.steps
        self.arm.model.qpos_spring[:] = self.arm.pose
        self.outputs = np.searchsorted(self.arm.columns, outputs)
        driven = log.driven[moving] & ~self.roles.following[moving]
        self.speed = np.where(driven, log.start_speed[moving], 0.0)
        self.before = np.where(self.speed != 0.0, log.command[0, moving], 0.0)
        # the last command acts only after the last sample
        self.command = np.repeat(log.command[:-1, moving], stepping.steps, axis=0)
        self.beside = np.zeros((len(self.command), 0))
        if log.beside is not None:
            of_followers = log.beside[:-1, self.roles.following]
            self.beside = np.repeat(of_followers, stepping.steps, axis=0)
        self.conditions = AT_REFERENCES
        if log.conditions is not None:
            self.conditions = np.repeat(log.conditions[:-1], stepping.steps, axis=0)
        self.pressure = log.start_pressure[moving]
        self._fused = (b"", dict[str, Array]())
        self.period = log.period
        follows = np.flatnonzero(self.roles.following)
        columns = np.searchsorted(self.arm.columns, follows)
        self.prescribed = Prescribed(
            self.arm.model,
            log,
            follows,
            columns,
            stepping.steps,
            settings.measured_cutoff_hz,
        )

    def restarted(self, start: Array, command: Array) -> "Scenario":
        """Return the same moving joints from another pose [rad], shape (V,), under
        other commands.

        `command` is held during each step [%], shape (steps, V). No joint may follow
        the log. Springs are slack where they were; engine and oil are at their
        references.
        """
        other = copy(self)
        other.arm = replace(self.arm, pose=start)
        other.speed = np.zeros(len(start))
        other.before = np.zeros(len(start))
        other.command = command
        other.conditions = AT_REFERENCES
        return other

    def _inertials(self, masses: Array) -> dict[str, Array]:
        """Return what the arm fuses of masses, (n, L), which are mostly those of the
        candidates before: fits hardly ever estimate a mass."""
        first, alike = distinct(masses)
        key = masses[first].tobytes()
        fused = self._fused
        if fused[0] != key:
            fused = (key, self.arm.inertials(masses[first]))
            self._fused = fused
        return {name: field[alike] for name, field in fused[1].items()}

    def values(self, candidates: Candidates) -> dict[str, Array]:
        """Return what candidates change in the model, the prescribed joints' servo
        included."""
        values = self._inertials(candidates.mass) | resistance(self.arm, candidates)
        columns = self.prescribed.columns
        values["dof_damping"][:, columns] = self.prescribed.damping
        values["jnt_stiffness"][:, columns] = self.prescribed.stiffness
        values["dof_frictionloss"][:, columns] = 0.0
        return values


def model_values(arm: LockedArm, candidates: Candidates) -> dict[str, Array]:
    """Return the fields of mjModel that n candidates change, by name, shape (n, ...)
    each."""
    return arm.inertials(candidates.mass) | resistance(arm, candidates)


def resistance(arm: LockedArm, candidates: Candidates) -> dict[str, Array]:
    """Return those of dampers, springs and friction."""
    return {
        "dof_damping": candidates.joints.damping[:, arm.columns],
        "jnt_stiffness": candidates.joints.stiffness[:, arm.columns],
        "dof_frictionloss": candidates.joints.friction[:, arm.columns],
    }


# how near an end of its range a joint must start to rest on its stop
STOP_REACH = np.radians(1.0)


class Chain:
    """What drives the moving joints of an arm, for any candidates: actuators, or given
    torques.

    `roles` are those of the arm's joints; where a gain stands for the hydraulics, no
    joint has any.

    Attributes:
        columns: the moving joints that couple through their inertia: all but `pushed`.
        joints: the same among the arm's joints, 0-based.
        pushed: columns of the moving joints whose torques are given instead: those that
            follow a log, and with a gain all.
    """

    def __init__(
        self, arm: Arm, locked: LockedArm, roles: Roles, stepping: Stepping
    ) -> None:
        moving = locked.columns
        given = roles.following[moving] | (stepping.rung is GAIN)
        self.columns = np.flatnonzero(~given)
        self.joints = moving[self.columns]
        self.pushed = np.flatnonzero(given)
        self._pushed = moving[self.pushed]
        self._stepping = stepping
        active = roles.active
        for joint in self.joints[active[self.joints]].tolist():
            if arm.joints[joint].actuator is None:
                raise SettingsError(
                    f"joint {joint + 1} ({arm.joints[joint].name}) has no actuator",
                    where=f"the arm's file of {arm.name}",
                    hint="stage 2 needs its cylinder (two pivots, areas) or rotary actuator: "
                    "add actuator: to the joint",
                )
        ranges = np.array([arm.lower, arm.upper])
        self._range = ranges[:, self.joints]
        model = locked.model
        # of M[i, j] in MuJoCo's sparse mass matrix
        entries = np.zeros((model.nv, model.nv), np.intp)
        rows = np.repeat(np.arange(model.nv), model.M_rownnz)
        columns = model.M_colind
        entries[rows, columns] = np.arange(model.nC)
        # MuJoCo stores one half of the symmetric matrix
        entries[columns, rows] = np.arange(model.nC)
        self._entries = entries[np.ix_(self.columns, self.columns)]
        self._layout = Layout(
            joints=tuple(self.joints.tolist()),
            idle=tuple((~active[self.joints]).tolist()),
            period=model.opt.timestep,
            substeps=stepping.substeps,
        )
        self._others = (b"", np.empty((0, 0, 3)))
        self._links = NO_LINKS
        if stepping.rung.at_once:
            self._links = make_links(model)

    def stepped(self, model: mujoco.MjModel, steps: int, copies: int = 1) -> SteppedArm:
        """Return the arm of a model, or several copies of it, to be rolled out as its
        rung is, with a sample after so many steps."""
        roll = LAWS[self._stepping.rung].roll
        return SteppedArm(model, self.columns, steps, roll, copies, self._links)

    def start(
        self,
        candidates: Candidates,
        pose: Array,
        balance: Array,
        pressure: Array | None = None,
    ) -> tuple[Plugin, Structs]:
        """Return the actuators of n candidates, with a force-stroke curve each, and
        their states at rest.

        `pose` is the moving joints' [rad], shape (V,); `balance` holds them there
        [N·m], shape (n, V). Chamber pressures measured there [Pa], shape (V, 2), NaN
        where there are none, are taken by candidates that have no start pressure of
        their own.
        """
        table = candidates.laid_out(self._layout).copy()
        away = abs(self._range - pose[self.columns])
        to_stop = np.min(away, axis=0)
        # nothing is trapped at a stop that the joint does not touch
        table["trapped_pressure"][:, to_stop > STOP_REACH] = np.inf
        if pressure is not None:
            _take_measured(table, pressure[self.columns])
        layout = self._layout
        plugin = plugin_of(table, self._entries, layout.period, layout.substeps)
        angle = np.tile(pose[self.columns], (len(balance), 1))
        return plugin, at_rest(plugin, angle, balance[:, self.columns])

    def others(
        self, candidates: Candidates, motion: Prescribed, beside: Array, run: Run
    ) -> Array:
        """What P joints that follow a log do, as of a `Course`, (n, steps, 3); (n, 0,
        3) if there are none.

        `beside` has their commands [%], (steps, P), or none; `run` is a pool's.
        """
        joints: Records = candidates.joints[:, self._pushed]  # pyright: ignore[reportAssignmentType]
        if not self.joints.size or np.isinf(joints.pump_flow).all():
            return np.empty((len(candidates), 0, 3))
        # held, as a rule: so they are alike, and as they were the last time
        first, alike = distinct(joints)
        key = joints[first].tobytes()
        others = self._others
        if others[0] != key:
            some: Records = joints[first]  # pyright: ignore[reportAssignmentType]
            records: Records = coefficients(some)[:, None]  # pyright: ignore
            flow = swallowed(records, motion.angle, motion.velocity).sum(axis=2)
            shut = np.zeros(flow.shape)
            if beside.size and (some.pump_bypass > 0.0).any():
                shut = self._shut(some, motion.angle[0], beside, run)
            asked = np.broadcast_to(np.any(beside != 0.0, axis=1), flow.shape)
            others = (key, np.stack([flow, shut, asked], axis=2))
            self._others = others
        return others[1][alike]

    def _shut(self, joints: Records, angle: Array, beside: Array, run: Run) -> Array:
        """Return the part of the open centre that the valves of n candidates' joints
        that follow a log shut, (n, steps); they start at an angle [rad], (P,)."""
        period = self._layout.period
        substeps = self._layout.substeps
        table = coefficients(joints, period, substeps).view(np.ndarray)
        count = self.pushed.size
        unused = np.zeros((count, count), np.intp)
        valves = plugin_of(table, unused, period, substeps)
        at_start = np.tile(angle, (len(table), 1))
        states = at_rest(valves, at_start, np.zeros(table.shape))
        before = np.zeros((valves.past, count))
        commands = np.concatenate([before, beside])
        openings = np.stack(valve_openings(valves, states, commands, run))
        widest = np.where(
            openings > 0.0,
            table["a"]["opening"][:, None],
            table["b"]["opening"][:, None],
        )
        share = np.divide(
            abs(openings), widest, out=np.zeros(openings.shape), where=widest > 0.0
        )
        return np.minimum(share.max(axis=2), 1.0)


def _take_measured(table: Structs, pressure: Array) -> None:
    """Let candidates' joints, (n, J) of COEFFICIENTS, start with measured pressures of chambers A and B
    [Pa], (J, 2), where they have none of their own."""
    pressure_a, pressure_b = pressure.T
    measured = np.isfinite(pressure).all(axis=1)
    trapped = table["trapped_pressure"]
    start = table["start_pressure"]
    asked = np.isinf(start) & measured
    rests = asked & np.isfinite(trapped)
    # balance gives the pressure of A, but at a stop, which may carry a part of the load
    table["trapped_pressure"] = np.where(rests, pressure_a, trapped)
    table["start_pressure"] = np.where(asked, pressure_b, start)
