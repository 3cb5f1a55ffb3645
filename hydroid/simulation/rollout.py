"""The compiled rollout of stage 2: one candidate through its whole record, MuJoCo's steps included.

`mujoco.batch` has a rollout, but nothing can be done between its steps; and where Python does something at
every step, threads wait for the interpreter. So the compiled loop calls `mj_step` of MuJoCo's own library
itself, on an MjModel and MjData of the bindings, and no thread needs Python before the record's end. The bits
are those of `mujoco.batch`. Only an error of MuJoCo's, not a divergence, would end the process instead of
raising; a model that gets through `SingleArm.start` has none to expect.
"""

import ctypes
import logging
import threading
from copy import copy
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import njit, types
from numba.core import event
from numpy.typing import NDArray

from hydroid.hydraulics.actuator import Actuator
from hydroid.hydraulics.kernel import SOURCE, Exchange, Plugin, look_ahead, make_pad, take_over
from hydroid.hydraulics.records import COEFFICIENTS, JOINT_STATE
from hydroid.simulation.scenario import Array

_log = logging.getLogger(__name__)

NOTHING = np.empty(0)

# libmujoco.so.*, libmujoco.*.dylib or mujoco.dll: the one that the bindings have loaded
_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))
llvmlite.binding.add_symbol("mj_step", ctypes.cast(_library.mj_step, ctypes.c_void_p).value)
_mj_step: Any = types.ExternalFunction("mj_step", types.void(types.intp, types.intp))


class Handles(NamedTuple):
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
    """joints with actuators and those they couple with, (J,)"""
    own: Array
    """the arm's own armature of these [kg·m²], (J,)"""
    follows: NDArray[np.intp]
    """joints that follow a log, (P,)"""


class SingleArm:
    """One arm in MuJoCo, which candidates take in turn.

    Attributes:
        model: a copy of the arm's, with the values of the candidate that was started last.
        data: its state.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = copy(model), mujoco.MjData(model)
        self._armature = model.dof_armature.copy()

    def start(self, values: dict[str, Array], row: int, pose: Array) -> Array:
        """Put the candidate of a row of `values` into `pose` [rad], shape (V,), as `ArmBatch.start` does.

        Call it within `quiet_mujoco`.

        Returns:
            What holds it there, tau0 = g(q0) of equation (1), and springs that are not slack there [N·m],
            shape (V,).
        """
        model, data = self.model, self.data
        for name, value in values.items():
            getattr(model, name)[:] = value[row]
        model.dof_armature[:] = self._armature  # stage 2 steps with another
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        data.warning.number[:] = 0
        return data.qfrc_bias - data.qfrc_passive

    @property
    def healthy(self) -> bool:
        """Whether the arm is finite and drew no warning of MuJoCo's since its start."""
        finite = np.isfinite([self.data.qpos, self.data.qvel]).all()
        return bool(finite) and not self.data.warning.number.any()


class HydraulicArm(SingleArm):
    """An arm that is stepped with its actuators by compiled code.

    Args:
        model: of the arm; it is copied.
        columns: the moving joints that `ArmActuators` names, shape (J,).
        follows: those that follow a log, shape (P,).
        steps: of MuJoCo in one sample.
    """

    def __init__(
        self, model: mujoco.MjModel, columns: NDArray[np.intp], follows: NDArray[np.intp], steps: int
    ) -> None:
        super().__init__(model)
        m, d = self.model, self.data
        live = (d.qpos, d.qvel, d.M, d.qfrc_applied, m.dof_armature, d.warning.number)
        self._handles = Handles(*_addresses(m, d), *live, columns, model.dof_armature[columns], follows)
        self._steps = steps

    def start(self, values: dict[str, Array], row: int, pose: Array) -> Array:
        """Do as `SingleArm.start`."""
        balance = super().start(values, row, pose)
        self.model.dof_damping[self._handles.columns] = 0.0  # the actuators integrate it
        return balance

    def attach(self, actuator: Actuator, state: NDArray[np.void], row: int) -> None:
        """Take the actuators of one candidate of a population; steps change `state`, (J,) of JOINT_STATE."""
        self._plugin, self._state, self._row = actuator.plugin, state, row

    def roll(
        self,
        commands: Array,
        angle: Array,
        seen: NDArray[np.void],
        servo: Array,
        taken: Array = NOTHING,
    ) -> None:
        """Step the arm, up to the first warning of MuJoCo's; call it within `quiet_mujoco`.

        Args:
            commands: held during each step [%], after those before the start, shape (past + T steps, J).
            angle: receives the angles after each of T samples [rad], shape (T, V).
            seen: receives the actuators after each of them, shape (T, J) of JOINT_STATE; or it is empty.
            servo: torque of the joints that follow a log at each step [N·m], shape (T steps, P).
            taken: flow from the pump into these joints at each step [m³/s], shape (T steps,); or it is empty.
        """
        plugin, state = self._plugin, self._state
        roll(self._handles, plugin, self._row, state, commands, servo, taken, self._steps, angle, seen)


def _addresses(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[int, int]:
    """Where MuJoCo keeps a model and its data: it tells every physics callback."""
    addresses: dict[int, tuple[int, int]] = {}

    @ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    def passive(m: int, d: int) -> None:
        addresses[threading.get_ident()] = (m, d)  # other threads may be stepping

    mujoco.set_mjcb_passive(passive)
    try:
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    return addresses[threading.get_ident()]


@njit(cache=True, nogil=True, error_model="numpy")
def roll(
    arm: Any,
    plugin: Plugin,
    candidate: int,
    state: Any,
    commands: Any,
    servo: Any,
    taken: Any,
    steps: int,
    angle: Any,
    seen: Any,
    source: int = SOURCE,
) -> None:
    """Roll one candidate of the plugin's population out, up to the first warning of MuJoCo's.

    `arm` is `Handles` at the start, `state` its actuators, shape (J,) of JOINT_STATE; the other arrays are as
    in `HydraulicArm.roll`. `source` is the kernel's, for numba's cache.
    """
    columns, joints = arm.columns, arm.columns.size
    pad, here, speed = make_pad(joints), np.empty(joints), np.empty(joints)
    exchange = Exchange(here, speed, arm.mass, np.empty(joints), np.empty(joints))
    past = commands.shape[0] - angle.shape[0] * steps
    for k in range(angle.shape[0] * steps):
        for j in range(joints):
            here[j], speed[j] = arm.angle[columns[j]], arm.velocity[columns[j]]
        if taken.size:
            pad.line[0].taken = taken[k]
        look_ahead(plugin, candidate, state, commands[: past + k + 1], exchange, pad)
        for j in range(joints):
            arm.applied[columns[j]] = exchange.torque[j]
            arm.armature[columns[j]] = arm.own[j] + exchange.armature[j]
        for i in range(arm.follows.size):
            arm.applied[arm.follows[i]] = servo[k, i]
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


class _Announcement(event.Listener):
    """Says once that numba compiles, which it does only where its cache holds nothing usable."""

    def __init__(self) -> None:
        self._made = False

    def on_start(self, event: Any) -> None:
        if not self._made:
            _log.warning("compiling the actuator's kernels, once on this machine ...")
        self._made = True

    def on_end(self, event: Any) -> None:
        pass


@cache
def compile_rollout() -> None:
    """Make the compiled loop ready: read it from numba's cache, or compile it and say so in the log."""
    one, column = np.ones(1), np.zeros(1, np.intp)
    warnings = np.zeros((2, 2), np.int32)[:, 1]  # MuJoCo's lie apart
    arm = Handles(0, 0, one, one, one, one, one, warnings, column, one, column)
    table, square = np.ones((1, 1), COEFFICIENTS), np.ones((1, 1))
    plugin = Plugin(table, square, order=column, entries=column[None], idle=0, period=0.01, substeps=1)
    state, nothing, none = np.zeros(1, JOINT_STATE), np.empty((0, 1)), np.empty(0)
    with event.install_listener("numba:compile", _Announcement()):
        roll(arm, plugin, 0, state, nothing, nothing, none, 1, nothing, np.empty((0, 1), JOINT_STATE))
