"""One candidate of a fit, stepped command by command."""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hydroid.arm.export import dressed_model, locked_spec, write_fitted
from hydroid.arm.locked import lock
from hydroid.arm.model import add_payload, load_model
from hydroid.arrays import Array, Index, Structs
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import write_estimate
from hydroid.files import Plain
from hydroid.hydraulics.actuator import pressures, under_conditions
from hydroid.hydraulics.kernel import Plugin
from hydroid.hydraulics.records import JOINT_STATE, Records, has_force_curve
from hydroid.identified_model import IdentifiedModel, write_settings
from hydroid.log.conditions import relative_to
from hydroid.mjcf import quiet_mujoco, read_mjcf
from hydroid.plant.steady import SteadyArm, SteadyCommands, Weighing, by_name
from hydroid.problem.bindings import Bindings
from hydroid.quantity_table import MECHANICAL, QUANTITIES
from hydroid.rungs import Rung
from hydroid.simulation.laws import LAWS
from hydroid.simulation.roles import roles
from hydroid.simulation.rollout import Course, SteppedArm, Trace, compile_rollout
from hydroid.simulation.scenario import Candidates, Chain, model_values

Pose = str | ArrayLike | Mapping[str, float]
PHYSICS = mujoco.mjtState.mjSTATE_INTEGRATION.value
"""what MuJoCo needs to go on to the same bits"""


class PlantParts(NamedTuple):
    """What a plant is made of since its last reset: for code that steps many."""

    columns: Index  # moving joints among the arm's, (V,)
    chain: Chain
    arm: SteppedArm
    plugin: Plugin
    state: Structs
    course: Course
    gain: Array  # [N·m/%], (V,)
    balance: Array  # [N·m], (V,)


class PlantState(NamedTuple):
    """Where a plant stands, to the bit: `Plant.state` makes it, `Plant.restore` takes
    it. It pickles."""

    start: Array
    taken: int
    state: Structs
    commands: Array
    physics: Array
    mass: Array
    armature: Array


class Plant:
    """An identified arm with J joints that is stepped under commands.

    Args:
        identified: settings and parameters.
        joints: numbers, from 1, or names of the joints that take commands; by default
            those that the fit drove or compared, and without a fit those that the
            settings compare. With `other_joints: passive` in the settings all others
            move under their springs and dampers; otherwise they are locked where
            `reset` puts them.
        period: how long one command is held [s], a multiple of MuJoCo's step; by
            default the logs' period.
        payload: mass at the tip [kg].
        conditions: `engine_speed` and `oil_temperature`, in the units of the settings'
            log; by default as at their references.
        shapes: whether `model` has them. Without them nothing can be drawn, and many
            plants are stepped faster, to the same bits.

    Attributes:
        joints: those that take commands.
        model: the arm in MuJoCo, with one motor per moving joint, whose `ctrl` holds
            the command. Locked joints are fused; `reset` to a pose with other angles of
            locked joints replaces model and data.
        data: its state.

    Raises:
        SettingsError: a joint that does not exist, a period that is no multiple,
            conditions that the fit's logs do not hold, or parameters without a force-stroke curve.
    """

    def __init__(
        self,
        identified: IdentifiedModel,
        *,
        joints: Sequence[int | str] | None = None,
        period: float | None = None,
        payload: float = 0.0,
        conditions: Mapping[str, float] | None = None,
        shapes: bool = True,
    ) -> None:
        settings = identified.settings
        arm = settings.arm
        self.identified = identified
        self._shapes = shapes
        wanted = joints or identified.summarise().joints or settings.outputs
        self.joints = _joint_numbers(wanted, arm.joint_names)
        self._named = [arm.name_of(joint) for joint in self.joints]
        self._active = np.isin(np.arange(1, 1 + len(arm.joint_names)), self.joints)
        others = settings.simulation.other_joints
        self._roles = roles(self._active, others, logged=False)
        self.timestep = settings.log.period_s / settings.stepping.steps
        self.period = settings.log.period_s if period is None else period
        self._steps = _multiple(self.period, self.timestep)
        self._spec = load_model(arm)
        if payload:
            self._spec = add_payload(self._spec, arm, payload)
        candidate = Bindings(settings).candidates(identified.theta[None])
        if conditions:
            engine, warmer = relative_to(settings.log, conditions)
            warmed = under_conditions(candidate.joints, engine, warmer)
            candidate = Candidates(warmed, candidate.mass)
        self._candidate = candidate
        if settings.stage == "hyd":
            _refuse_without_force(self._candidate, identified.source)
        # none yet: the first reset locks whatever does not move
        self._locked_pose = np.empty(0)
        compile_rollout()
        self.reset()

    def __repr__(self) -> str:
        names = ", ".join(self._named)
        source = self.identified.source
        return f"<Plant: {names}; steps of {self.period:g} s; {source}>"

    @property
    def time(self) -> float:
        """Since the reset [s]."""
        return self._taken * self.timestep

    @property
    def names(self) -> tuple[str, ...]:
        """Of all joints, (J,)."""
        return self.identified.settings.arm.joint_names

    @property
    def rung(self) -> Rung:
        """The model of the arm."""
        return self.identified.settings.rung

    @property
    def past(self) -> int:
        """Steps of commands that its delays reach back."""
        return self._plugin.past

    @property
    def parts(self) -> PlantParts:
        """What it is made of, since its last reset."""
        return PlantParts(
            columns=self._columns,
            chain=self._chain,
            arm=self._arm,
            plugin=self._plugin,
            state=self._state,
            course=self._course,
            gain=self._gain,
            balance=self._balance,
        )

    @property
    def actuators(self) -> Records:
        """Quantities of all joints' actuators in SI, (J,) of
        `hydraulics.records.JOINT`."""
        return self._candidate.joints[0]

    @property
    def masses(self) -> Array:
        """Of the arm's links [kg], in the order of `arm.link_names`."""
        return self._candidate.mass[0]

    @property
    def command(self) -> Array:
        """What the motors' controls in `data.ctrl` hold [%], shape (J,)."""
        command = np.zeros(len(self._pose))
        command[self._columns] = self.data.ctrl
        return command * self._active

    @property
    def angle(self) -> Array:
        """Joint angles [rad], shape (J,), a copy; the true ones, whatever lag or scale
        their sensors have."""
        angle = self._pose.copy()
        angle[self._columns] = self.data.qpos
        return angle

    @property
    def pressure(self) -> Array:
        """Pressures of chambers A and B [Pa], shape (J, 2); NaN where a joint has no
        hydraulics."""
        angle = self.data.qpos[self._chain.columns]
        coefficients = self._plugin.coefficients
        pressure = np.full((len(self._pose), 2), np.nan)
        pressure[self._chain.joints] = pressures(coefficients, self._state, angle)
        # others couple with the active ones through their inertia alone
        pressure[~self._active] = np.nan
        return pressure

    def reset(self, pose: Pose | None = None) -> Array:
        """Put the arm at rest, in static balance, its springs slack.

        Args:
            pose: a pose of the arm's file, or joint angles [rad], shape (J,), or by
                the joints' names, others as they stand; by default the settings'
                start pose.

        Returns:
            The joint angles [rad], shape (J,).

        Raises:
            SettingsError: no such pose, or not J finite angles.
        """
        if pose is None:
            pose = self.identified.settings.start_pose
        self._pose = self._posed(pose)
        self._start = self._pose.copy()
        self._weighing: Weighing | None = None  # springs are slack where it starts
        locked = np.where(self._roles.moving, 0.0, self._pose)
        if not np.array_equal(locked, self._locked_pose):
            self._lock(locked)
        start_angle = self._pose[self._columns]
        self.model.qpos_spring[:] = start_angle
        with quiet_mujoco():
            self._balance = self._arm.start(self._values, [0], start_angle)
            plugin, states = self._chain.start(
                self._candidate, start_angle, self._balance[None]
            )
            self._plugin = plugin.candidate(0)
            self._state = states[0]
            commands = np.zeros((self._plugin.past + self._steps, len(self._state)))
            torque = np.empty((self._steps, len(self._chain.pushed)))
            self._course = Course(commands, torque)
            self._mass = self.data.M.copy()
        # arrays are others than before: the compiled call is bound at the next step
        self._roll = None
        self._taken = 0
        return self.angle

    def step(self, command: ArrayLike | Mapping[str, float]) -> Array:
        """Hold a command for one period.

        Args:
            command: [%], shape (J,), or by the joints' names, others 0. An amplifier
                saturates: it is cut to [-100, 100]. It must be 0 of joints that take
                none.

        Returns:
            The joint angles [rad], shape (J,).

        Raises:
            ValueError: not J finite commands, or one for a joint that takes none.
            RunError: the simulation diverged.
        """
        given = self._by_joint(command, "command", "%")
        self.data.ctrl[:] = given[self._columns].clip(-100.0, 100.0)
        commands, torque, *_ = self._course
        torque[:] = (self._gain * self.data.ctrl + self._balance)[self._chain.pushed]
        commands[: -self._steps] = commands[self._steps :]
        commands[-self._steps :] = self.data.ctrl[self._chain.columns]
        # M of the step before: refreshing positions in between must not change a bit
        np.copyto(self.data.M, self._mass)
        with quiet_mujoco():
            if self._roll is None:
                self._roll = self._arm.bind(
                    self._plugin, self._state, self._course, self._trace
                )
            self._roll()
        np.copyto(self._mass, self.data.M)
        self._taken += self._steps
        if not self._arm.healthy:
            raise RunError(
                f"the simulation diverged before {self.time:.2f} s",
                self.identified.source,
            )
        return self.angle

    def speeds(
        self,
        commands: ArrayLike | Mapping[str, float],
        at: Pose | None = None,
    ) -> Array:
        """Return the speeds that joints settle to under commands that are held, all at
        once.

        Args:
            commands: [%], shape (J,), or by the joints' names, others 0.
            at: as `pose` of `reset`; by default where the plant is.

        Returns:
            [rad/s], of joints that slide [m/s], shape (J,): of the law itself
            (`simulation.settled`).

        Raises:
            ValueError: not J finite commands, or one for a joint that takes none.
            SettingsError: no such pose, or a plant of stage 1, which has no valves.
        """
        given = self._by_joint(commands, "command", "%").clip(-100.0, 100.0)
        return self.steady().speeds(given[None], self._posed(at)[None])[0]

    def commands(
        self, speeds: ArrayLike | Mapping[str, float], at: Pose | None = None
    ) -> SteadyCommands:
        """Return the commands under which joints settle to wished speeds, all at once.

        Dead band, curve, load, pump and compensation are in it. Where a wish cannot be
        had, the command gives the nearest speed, and `limits` says by name why.

        Args:
            speeds: [rad/s], of joints that slide [m/s], shape (J,), or by the joints'
                names, others 0.
            at: as of `speeds`.

        Raises:
            ValueError, SettingsError: as of `speeds`.
        """
        wished = self._by_joint(speeds, "speed", "rad/s")[None]
        pose = self._posed(at)[None]
        steady = self.steady()
        command, reached = steady.commands(wished, pose)
        (limits,) = steady.limits(wished, reached, command, pose)
        return SteadyCommands(command[0], reached[0], by_name(limits, self.names))

    def steady(self) -> SteadyArm:
        """Return the law behind `speeds` and `commands`, for many poses at once.

        Raises:
            SettingsError: a plant of stage 1, which has no valves.
        """
        settings = self.identified.settings
        if LAWS[settings.rung].rod is None:
            hint = "name a fit of stage 2"
            raise SettingsError(
                "a gain gives torques, not speeds", self.identified.source, hint
            )
        if self._weighing is None:
            self._weighing = Weighing(
                self._spec, settings.arm, self._candidate, self._start
            )
        ranges = np.array([settings.arm.lower, settings.arm.upper]).T
        return SteadyArm(
            self._weighing,
            self._plugin,
            self._chain.joints,
            ranges,
            settings.rung,
        )

    def state(self) -> PlantState:
        """Return where the plant stands, oil, valves and commands on their way
        included."""
        physics = np.empty(mujoco.mj_stateSize(self.model, PHYSICS))
        mujoco.mj_getState(self.model, self.data, physics, PHYSICS)
        return PlantState(
            start=self._start.copy(),
            taken=self._taken,
            state=self._state.copy(),
            commands=self._course.commands.copy(),
            physics=physics,
            mass=self._mass.copy(),
            armature=self.model.dof_armature.copy(),
        )

    def restore(self, state: PlantState) -> Array:
        """Go back to where the plant, or another one of its model, stood; it then steps
        to the same bits.

        Returns:
            The joint angles [rad], shape (J,).
        """
        self.reset(state.start)
        self._state[:] = state.state
        self._course.commands[:] = state.commands
        mujoco.mj_setState(self.model, self.data, state.physics, PHYSICS)
        self._mass[:] = state.mass
        self.model.dof_armature[:] = state.armature
        self._taken = state.taken
        return self.angle

    def save(self, folder: str | Path) -> None:
        """Write the plant, without payload and as at the references, to a folder that `load_plant` reads;
        `export` to `model/` there.

        Raises:
            RunError: the folder cannot be written.
        """
        write_settings(Path(folder), self.identified.settings)
        write_estimate(
            Path(folder), self.identified.summarise().changed({"joints": self.joints})
        )
        self.export(Path(folder) / "model")

    def export(self, folder: Path) -> None:
        """Write the arm for other programs to `model/` of a saved plant or a run
        folder, beside `arm.xml`.

        `README.txt` there says what the files are good for.

        Raises:
            RunError: the folder cannot be written.
        """
        model = copy(self.model)
        # a rollout with hydraulics steps with no damping and with another armature
        model.dof_damping[:] = self._values["dof_damping"][0]
        model.dof_armature[:] = self._locked.model.dof_armature
        spec = read_mjcf(folder / "arm.xml")  # with the meshes' names there
        motors = np.array([self._gain, self._balance])[:, self._chain.pushed]
        fitted = locked_spec(spec, self._locked, model, motors)
        names = ", ".join(self._named)
        write_fitted(folder, fitted, names, self._actuator_values())

    def _actuator_values(self) -> Plain:
        """Return units and values of the hydraulic quantities of the joints that take
        commands, as a file has them; nothing in stage 1."""
        values = Plain()
        if not self._chain.joints.size:
            return values
        hydraulic = {
            name: quantity
            for name, quantity in QUANTITIES.items()
            if name not in MECHANICAL
        }
        values["units"] = {name: q.unit for name, q in hydraulic.items()}
        active = self._candidate.joints[0, self._active]
        for joint, actuator in zip(self._named, active, strict=True):
            values[joint] = {
                name: float(actuator[name] / quantity.factor)
                for name, quantity in hydraulic.items()
            }
        return values

    def _by_joint(
        self, values: ArrayLike | Mapping[str, float], what: str, unit: str
    ) -> Array:
        """Return values by joint, shape (J,), given so or by name; 0 of joints that
        take no commands."""
        if isinstance(values, Mapping):
            if stray := values.keys() - set(self.names):
                raise ValueError(
                    f"no joint {', '.join(stray)}; the arm has {', '.join(self.names)}"
                )
            values = [values.get(name, 0.0) for name in self.names]
        given = np.asarray(values, float)
        if given.shape != self._active.shape or not np.isfinite(given).all():
            raise ValueError(
                f"a {what} needs {len(self._active)} finite numbers [{unit}], not {values}"
            )
        if given[~self._active].any():
            raise ValueError(
                f"only {', '.join(self._named)} take commands: name the others in joints="
            )
        return given

    def _posed(self, pose: Pose | None) -> Array:
        """Return the angles of a pose [rad], shape (J,), by its name or its angles;
        None: of where it is. Joints that a mapping does not name stay there, too."""
        if pose is None:
            return self.angle
        if isinstance(pose, Mapping):
            where = dict(zip(self.names, self.angle, strict=True))
            if stray := pose.keys() - where.keys():
                raise SettingsError(
                    f"no joint {', '.join(sorted(stray))}",
                    "pose",
                    f"the arm has {', '.join(self.names)}",
                )
            pose = [*(where | {**pose}).values()]
        if isinstance(pose, str):
            return self.identified.settings.arm.pose(pose)
        angle = np.array(pose, float)
        if angle.shape != self._active.shape or not np.isfinite(angle).all():
            raise SettingsError(
                f"a pose needs {len(self._active)} finite angles [rad]", f"{pose}"
            )
        return angle

    def _lock(self, pose: Array) -> None:
        """Make the arm anew with its locked joints in a pose [rad], shape (J,), which
        is 0 of those that move."""
        settings = self.identified.settings
        locked = lock(self._spec, settings.arm, self._roles.moving, pose)
        locked.model.opt.timestep = self.timestep
        model = dressed_model(self._spec, locked, shapes=self._shapes)
        self._locked = locked
        self._locked_pose = pose
        self._columns = locked.columns
        self._values = model_values(locked, self._candidate)
        self._gain = self._candidate.joints.gain[0, self._columns]
        self._chain = Chain(settings.arm, locked, self._roles, settings.stepping)
        self._arm = self._chain.stepped(model, self._steps)
        self.model = self._arm.model
        self.data = self._arm.data
        no_states = np.empty((0, len(self._chain.columns)), JOINT_STATE)
        self._trace = Trace(np.empty((1, len(self._columns))), no_states)


def _joint_numbers(
    wanted: Iterable[int | str], names: Sequence[str]
) -> tuple[int, ...]:
    """Return joints' numbers, from 1, in the arm's order, by numbers or names."""
    asked = set(wanted)
    numbered = dict(enumerate(names, 1))
    stray = asked.difference(numbered, names)
    if stray:
        what = f"the arm has joints 1 to {len(names)}: {', '.join(names)}"
        raise SettingsError(what, f"joints {[*stray]}")
    return tuple(number for number, name in numbered.items() if asked & {number, name})


def _multiple(period: float, timestep: float) -> int:
    """Return how many of MuJoCo's steps a period has, both [s]."""
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise SettingsError(
            f"must be a multiple of {timestep:g} s", f"period {period:g} s"
        )
    return steps


def _refuse_without_force(candidate: Candidates, source: str) -> None:
    """Raise a SettingsError where a joint's solenoid has no force-stroke curve."""
    if not has_force_curve(candidate.joints)[0]:
        raise SettingsError(
            "no force-stroke curve runs through its two points",
            source,
            "it takes F1 > F2 > 0, x2 > x1 > 0 and F1/F2 < (x2/x1)²",
        )
