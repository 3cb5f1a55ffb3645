"""The compiled rollout of stage 2: one candidate through its whole record, MuJoCo's steps included.

`mujoco.batch` has a rollout, but nothing can be done between its steps; and where Python does something at
every step, threads wait for the interpreter. So the compiled loop calls `mj_step` of MuJoCo's own library
itself, on an MjModel and MjData of the bindings, and no thread needs Python before the record's end. The bits
are those of `mujoco.batch`. Only an error of MuJoCo's, not a divergence, would end the process instead of
raising; a model that gets through `Population.start` has none to expect.
"""

import ctypes
import threading
from collections.abc import Callable
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from hydroid.hydraulics.kernel import SOURCE, Exchange, Plugin, look_ahead, make_pad, take_over
from hydroid.hydraulics.records import COEFFICIENTS, JOINT_STATE
from hydroid.simulation.population import Array, Population
from hydroid.simulation.prescribed import Prescribed

# libmujoco.so.*, libmujoco.*.dylib or mujoco.dll: the one that the bindings have loaded
_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))
llvmlite.binding.add_symbol("mj_step", ctypes.cast(_library.mj_step, ctypes.c_void_p).value)
_mj_step: Any = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))


class Arm(NamedTuple):
    """One MuJoCo simulation for compiled code: addresses, and live arrays over its V moving joints."""

    model: int
    data: int
    angle: Array
    velocity: Array
    mass: Array
    applied: Array
    armature: Array
    warnings: NDArray[np.int32]
    columns: NDArray[np.intp]
    """joints with actuators, (J,)"""
    own: Array
    """the arm's own armature of these [kg·m²], (J,)"""
    follows: NDArray[np.intp]
    """joints that follow a log, (P,)"""


class Machine:
    """A MuJoCo simulation that candidates of a population take in turn.

    Args:
        model: the arm's; each candidate brings its own values.
        columns: joints with actuators among the moving ones, shape (J,).
        prescribed: those that follow the log, if any.

    Attributes:
        arm: what compiled code sees of it.
    """

    def __init__(
        self, model: mujoco.MjModel, columns: NDArray[np.intp], prescribed: Prescribed | None
    ) -> None:
        self._model, self._data = copy(model), mujoco.MjData(model)
        m, d = self._model, self._data
        model_address, data_address = _addresses(m, d)
        self.arm = Arm(
            model=model_address,
            data=data_address,
            angle=d.qpos,
            velocity=d.qvel,
            mass=d.M,
            applied=d.qfrc_applied,
            armature=m.dof_armature,
            warnings=d.warning.number,
            columns=columns,
            own=model.dof_armature[columns],
            follows=np.array([], np.intp) if prescribed is None else prescribed.columns,
        )

    def take(self, population: Population, candidate: int) -> None:
        """Become a candidate of a population as it stands at its start."""
        population.copy(candidate, self._model, self._data)
        self._model.dof_damping[self.arm.columns] = 0.0  # the actuators integrate it

    @property
    def healthy(self) -> np.bool_:
        """Whether the candidate is finite and drew no warning of MuJoCo's."""
        arm = self.arm
        return np.isfinite([arm.angle, arm.velocity]).all() & ~arm.warnings.any()


def _addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Where MuJoCo keeps a model and its data: it tells every physics callback."""
    told: dict[int, tuple[int, int]] = {}

    @ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    def passive(m: int, d: int) -> None:
        told[threading.get_ident()] = (m, d)  # other threads may be stepping

    mujoco.set_mjcb_passive(passive)
    try:
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    return told[threading.get_ident()]


@njit(cache=True, nogil=True, error_model="numpy")
def roll(
    arm: Any,
    plugin: Plugin,
    candidate: int,
    state: Any,
    commands: Any,
    torque: Any,
    steps: int,
    angle: Any,
    seen: Any,
    source: int = SOURCE,
) -> None:
    """Roll one candidate out, up to the first warning of MuJoCo's.

    Args:
        arm: an `Arm`, at the start.
        plugin: of the population.
        candidate: which one of it.
        state: its actuators, shape (J,) of JOINT_STATE.
        commands: held during each step [%], with those before the start, shape (past + T steps, J).
        torque: of the joints that follow a log, at each step [N·m], shape (T steps, P).
        steps: in a sample.
        angle: receives the angles after each of T samples [rad], shape (T, V).
        seen: receives the actuators after each of them, shape (T, J) of JOINT_STATE; or it is empty.
        source: the kernel's, for numba's cache.
    """
    columns, joints = arm.columns, arm.columns.size
    pad, here, speed = make_pad(joints), np.empty(joints), np.empty(joints)
    exchange = Exchange(here, speed, arm.mass, np.empty(joints), np.empty(joints))
    past = commands.shape[0] - angle.shape[0] * steps
    for k in range(angle.shape[0] * steps):
        for j in range(joints):
            here[j], speed[j] = arm.angle[columns[j]], arm.velocity[columns[j]]
        look_ahead(plugin, candidate, state, commands[: past + k + 1], exchange, pad)
        for j in range(joints):
            arm.applied[columns[j]] = exchange.torque[j]
            arm.armature[columns[j]] = arm.own[j] + exchange.armature[j]
        for i in range(arm.follows.size):
            arm.applied[arm.follows[i]] = torque[k, i]
        _mj_step(arm.model, arm.data)
        if arm.warnings.any():
            return
        for j in range(joints):
            speed[j] = arm.velocity[columns[j]]
        take_over(plugin, state, speed, arm.mass, here)
        for j in range(joints):
            arm.angle[columns[j]] = here[j]
        if (k + 1) % steps == 0:
            angle[k // steps] = arm.angle
            if seen.size:
                seen[k // steps] = state


def compile_rollout(announce: Callable[[], object]) -> None:
    """Make the compiled loop ready; call `announce` if that is more than reading it from numba's cache."""
    timer = threading.Timer(1.0, announce)
    timer.start()
    try:
        one, column = np.ones(1), np.zeros(1, np.intp)
        warnings = np.zeros((2, 2), np.int32)[:, 1]  # MuJoCo's lie apart
        arm = Arm(0, 0, one, one, one, one, one, warnings, column, one, column)
        record, square = np.ones((1, 1), COEFFICIENTS), np.ones((1, 1))
        plugin = Plugin(record, square, order=column, entries=column[None], idle=0, period=0.01, substeps=1)
        state, nothing = np.zeros(1, JOINT_STATE), np.empty((0, 1))
        roll(arm, plugin, 0, state, nothing, nothing, 1, nothing, np.empty((0, 1), JOINT_STATE))
    finally:
        timer.cancel()
