"""Many plants of one machine, stepped in one call: a population, at its speed.

The plants have settings in common, and each its own parameters, such as draws of what
the logs leave open. One compiled loop steps a share of them per thread, so that Python
is met once per call.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray
from numpy.typing import ArrayLike

from hydroid.arrays import Array, Ints, Mask, Structs
from hydroid.errors import SettingsError
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.kernel import Plugin, source_key
from hydroid.mjcf import quiet_mujoco
from hydroid.plant.plant import PHYSICS, Plant
from hydroid.simulation.laws import LAWS
from hydroid.simulation.rollout import Course, Handles, Trace, bind


def _typed_pointer(typing: Any, address: Any) -> Any:
    """Return the signature of `_pointer` and what makes its code."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(
            arguments[0], context.get_value_type(signature.return_type)
        )

    return types.voidptr(types.int64), generate


_pointer: Any = intrinsic(_typed_pointer)
"""lets compiled code take an address for that of an array"""


@compilable
def _floats(address: int, count: int) -> Array:
    """Return the array of so many numbers that stands at an address."""
    return carray(_pointer(address), (count,), np.float64)


class PlantRows(NamedTuple):
    """What n plants have, each with a row; `addresses` are those in MuJoCo, in the
    order of `_addresses`."""

    addresses: Ints  # (n, 11)
    coefficients: Any  # (n, J), of COEFFICIENTS
    state: Any  # (n, J), of JOINT_STATE
    commands: Array  # (n, past + steps, J)
    torque: Array  # (n, steps, P)
    links: Structs  # (n, V + 1) of LINK, or (n, 0), as of `Handles`
    angle: Array  # (n, 1, V)
    failed: Mask  # (n,)


def _addresses(plant: Plant) -> list[int]:
    model = plant.model
    data = plant.data
    arrays = [
        data.qpos,
        data.qvel,
        data.M,
        data.qfrc_applied,
        model.dof_armature,
        model.body_mass,
        model.body_ipos,
        model.qpos_spring,
        data.warning.number,
    ]
    of_arrays = [array.ctypes.data for array in arrays]
    return [model._address, data._address, *of_arrays]  # pyright: ignore[reportPrivateUsage]


@compilable
def _roll_some(rows, shared, plugin, plants, roll) -> None:
    """Roll some plants out by a rollout, from rows[0] to before rows[1].

    `shared`, of Handles, and the plugin have what is alike of all; plants are
    PlantRows.
    """
    joints = shared.angle.size
    entries = shared.mass.size
    bodies = plants.links.shape[1]
    # a warning of MuJoCo's has two numbers: every other one is its count
    numbers = 2 * shared.warnings.size - 1
    nothing = np.empty((0, 0))
    at_references = np.empty((0, 2))
    no_states: Structs = np.empty((0, plants.state.shape[1]), plants.state.dtype)
    for i in range(rows[0], rows[1]):
        if plants.failed[i]:
            continue
        at = plants.addresses[i]
        handles = Handles(
            model=at[0],
            data=at[1],
            angle=_floats(at[2], joints),
            velocity=_floats(at[3], joints),
            mass=_floats(at[4], entries),
            applied=_floats(at[5], joints),
            armature=_floats(at[6], joints),
            warnings=carray(_pointer(at[10]), (numbers,), np.int32)[::2],
            columns=shared.columns,
            bare_armature=shared.bare_armature,
            pushed=shared.pushed,
            steps=shared.steps,
            links=plants.links[i],
            body_mass=_floats(at[7], bodies),
            body_centre=_floats(at[8], 3 * bodies).reshape((bodies, 3)),
            slack=_floats(at[9], joints),
            limits=shared.limits,
        )
        actuators = Plugin(
            coefficients=plants.coefficients[i],
            order=plugin.order,
            entries=plugin.entries,
            idle=plugin.idle,
            period=plugin.period,
            substeps=plugin.substeps,
        )
        course = Course(
            plants.commands[i], plants.torque[i], nothing, nothing, at_references
        )
        trace = Trace(plants.angle[i], no_states)
        roll(handles, actuators, plants.state[i], course, trace)
        finite = np.isfinite(handles.angle).all()
        plants.failed[i] = handles.warnings.any() or not finite


@cache
def _compiled(roll: Any) -> Any:
    """Return `_roll_some` by the rollout of a rung."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def roll_some(rows, shared, plugin, plants, source: int = source_key(roll)) -> None:
        _roll_some(rows, shared, plugin, plants, roll)

    return roll_some


def copy_records(source: Structs, target: Structs) -> None:
    """Copy records of one type byte by byte: numpy, field by field, takes thirty times
    as long."""
    target.view(np.uint8)[:] = source.view(np.uint8)


class RowState(NamedTuple):
    """Where one plant of a batch stands: `PlantBatch.state` makes it."""

    physics: Array
    mass: Array
    armature: Array
    slack: Array
    coefficients: Any
    joints: Any
    commands: Array
    balance: Array
    pose: Array
    angle: Array
    time: float


class PlantBatch:
    """n plants that are stepped together; no bit depends on the others, or on how many
    threads there are.

    A plant must not be stepped, reset or changed by itself while it is in a batch.

    Args:
        plants: of one machine: with the same joints, period and settings but for their
            parameters.
        threads: that step them; None: one per core.

    Raises:
        SettingsError: none, or plants of different kinds.
    """

    def __init__(self, plants: Sequence[Plant], *, threads: int | None = None) -> None:
        kinds = {
            (
                plant.identified.settings.stage,
                plant.joints,
                plant.period,
                plant.timestep,
                plant.rung,
            )
            for plant in plants
        }
        if len(kinds) != 1:
            raise SettingsError(
                "needs plants with the same joints, period and model",
                "a batch of plants",
            )
        self.plants = tuple(plants)
        count = min(threads or os.cpu_count() or 1, len(plants))
        self._pool = ThreadPoolExecutor(count)
        self._shares = np.linspace(0, len(plants), count + 1).astype(np.int64)
        first = self.plants[0]
        self._active = np.isin(np.arange(1, 1 + len(first.names)), first.joints)
        self._past = max(plant.past for plant in plants)
        self._time = np.zeros(len(plants))
        self._gather()

    def __len__(self) -> int:
        return len(self.plants)

    @property
    def angle(self) -> Array:
        """Joint angles [rad], shape (n, J), a copy; NaN of a plant that diverged, until
        its reset."""
        angle = self._pose.copy()
        angle[:, self._columns] = self._angle[:, 0]
        angle[self._plant_rows.failed] = np.nan
        return angle

    @property
    def driven_angle(self) -> Array:
        """Angles of the K joints that take commands [rad], shape (n, K), a copy; NaN of
        a plant that diverged."""
        angle = self._angle[:, 0, self._driven]
        if self._plant_rows.failed.any():
            angle[self._plant_rows.failed] = np.nan
        return angle

    @property
    def failed(self) -> Mask:
        """Plants that diverged, until their reset, shape (n,), a copy."""
        return self._plant_rows.failed.copy()

    @property
    def time(self) -> Array:
        """Since each plant's reset [s], shape (n,), a copy."""
        return self._time.copy()

    def reset(
        self, pose: str | ArrayLike | None = None, rows: ArrayLike | None = None
    ) -> Array:
        """Put plants at rest, in static balance.

        Args:
            pose: as of `Plant.reset`; of each of the m plants with shape (m, J).
            rows: which plants, shape (m,); None: all.

        Returns:
            The joint angles of all plants [rad], shape (n, J).
        """
        chosen = np.arange(len(self))
        if rows is not None:
            chosen = np.asarray(rows, int)
        poses: Any = pose
        if pose is None or isinstance(pose, str) or np.ndim(pose) == 1:
            poses = [pose] * len(chosen)
        for row, start in zip(chosen.tolist(), poses, strict=True):
            self.plants[row].reset(start)
            self._take(row)
        return self.angle

    def state(self, row: int) -> "RowState":
        """Return where the plant of a row stands; to `restore` it costs far less than a
        reset."""
        plant = self.plants[row]
        stacked = self._plant_rows
        physics = np.empty(mujoco.mj_stateSize(plant.model, PHYSICS))
        mujoco.mj_getState(plant.model, plant.data, physics, PHYSICS)
        return RowState(
            physics=physics,
            mass=plant.data.M.copy(),
            armature=plant.model.dof_armature.copy(),
            slack=plant.model.qpos_spring.copy(),
            coefficients=stacked.coefficients[row].copy(),
            joints=stacked.state[row].copy(),
            commands=stacked.commands[row].copy(),
            balance=self._balance[row].copy(),
            pose=self._pose[row].copy(),
            angle=self._angle[row].copy(),
            time=float(self._time[row]),
        )

    def restore(self, row: int, state: "RowState") -> None:
        """Put the plant of a row where it stood; it then steps to the same bits.

        It takes as long as a reset where its locked joints stand elsewhere by now.
        """
        plant = self.plants[row]
        stacked = self._plant_rows
        # locked joints are fused into the model
        if not np.array_equal(self._pose[row, self._locked], state.pose[self._locked]):
            plant.reset(state.pose)
            self._take(row)
        mujoco.mj_setState(plant.model, plant.data, state.physics, PHYSICS)
        plant.data.M[:] = state.mass
        plant.data.warning.number[:] = 0
        plant.model.dof_armature[:] = state.armature
        plant.model.qpos_spring[:] = state.slack
        copy_records(state.coefficients, stacked.coefficients[row])
        copy_records(state.joints, stacked.state[row])
        stacked.commands[row] = state.commands
        stacked.failed[row] = False
        self._balance[row] = state.balance
        self._pose[row] = state.pose
        self._angle[row] = state.angle
        self._time[row] = state.time

    def step(self, command: ArrayLike) -> Array:
        """Hold commands [%] for one period: shape (n, J), or (J,) for all plants; cut
        to [-100, 100].

        Returns:
            The joint angles [rad], shape (n, J); NaN of a plant that diverged.

        Raises:
            ValueError: another shape, or a command that is not finite or for a joint
                that takes none.
        """
        shape = (len(self), len(self._active))
        given = np.broadcast_to(np.asarray(command, float), shape)
        if not np.isfinite(given).all() or given[:, ~self._active].any():
            raise ValueError("commands must be finite, and 0 of joints that take none")
        self.hold(given[:, self._active])
        return self.angle

    def hold(self, command: Array) -> None:
        """Hold finite commands [%] of the K joints that take them for one period, shape
        (n, K); cut to [-100, 100].

        This is `step` for code that calls it many thousand times a second: nothing is
        checked, and `driven_angle` is read only where it is wanted.
        """
        moving = np.zeros((len(self), len(self._columns)))
        moving[:, self._driven] = command.clip(-100.0, 100.0)
        commands = self._plant_rows.commands
        steps = self._plant_rows.torque.shape[1]
        commands[:, :-steps] = commands[:, steps:]
        commands[:, -steps:] = moving[:, None, self._coupled]
        if self._pushed.size:
            torque = self._gain * moving + self._balance
            self._plant_rows.torque[:] = torque[:, None, self._pushed]
        # what MuJoCo warns of is seen in `failed`
        with quiet_mujoco():
            # this thread takes a share too: to wake one costs as much as ten plants
            own, *others = self._calls
            waiting = [self._pool.submit(call) for call in others]
            own()
            for done in waiting:
                done.result()
        self._time += self.plants[0].period

    def _gather(self) -> None:
        """Stack what the plants have, and bind the compiled calls to it."""
        first = self.plants[0]
        n = len(self)
        parts = first.parts
        self._columns = parts.columns
        self._locked = np.setdiff1d(np.arange(len(first.names)), self._columns)
        # the joints that take commands, among those that move
        self._driven = np.flatnonzero(self._active[self._columns])
        self._coupled = parts.chain.columns
        self._pushed = parts.chain.pushed
        steps = parts.course.torque.shape[0]
        joints = len(self._coupled)
        links = parts.arm.handles.links
        self._angle = np.empty((n, 1, len(self._columns)))
        self._pose = np.empty((n, len(first.names)))
        self._gain = np.empty((n, len(self._columns)))
        self._balance = np.empty((n, len(self._columns)))
        self._plant_rows = PlantRows(
            addresses=np.empty((n, 11), np.int64),
            coefficients=np.zeros((n, joints), parts.plugin.coefficients.dtype),
            state=np.zeros((n, joints), parts.state.dtype),
            commands=np.zeros((n, self._past + steps, joints)),
            torque=np.zeros((n, steps, len(self._pushed))),
            links=np.zeros((n, len(links)), links.dtype),
            angle=self._angle,
            failed=np.zeros(n, np.bool_),
        )
        for row in range(n):
            self._take(row)
        roll_some = _compiled(LAWS[first.rung].roll)
        self._calls: list[Callable[[], object]] = []
        for k in range(len(self._shares) - 1):
            call = bind(
                roll_some,
                self._shares[k : k + 2].copy(),
                parts.arm.handles,
                parts.plugin,
                self._plant_rows,
            )
            self._calls.append(call)

    def _take(self, row: int) -> None:
        """Take over a plant that was reset."""
        plant = self.plants[row]
        stacked = self._plant_rows
        parts = plant.parts
        stacked.addresses[row] = _addresses(plant)
        stacked.coefficients[row] = parts.plugin.coefficients
        stacked.state[row] = parts.state
        # where its locked joints stand now
        stacked.links[row] = parts.arm.handles.links
        stacked.commands[row] = 0.0
        stacked.failed[row] = False
        self._gain[row] = parts.gain
        self._balance[row] = parts.balance
        self._pose[row] = plant.angle
        self._angle[row, 0] = plant.data.qpos
        self._time[row] = plant.time
