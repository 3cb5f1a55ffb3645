"""The compiled rollout: one candidate through its whole log, MuJoCo's steps
included.

`mujoco.batch` has a rollout, but nothing can be done between its steps; and where
Python does something at every step, threads wait for the interpreter. So the compiled
loop calls `mj_step` of MuJoCo's own library itself, on an MjModel and MjData of the
bindings, and no thread needs Python before the log's end. The bits are those of
`mujoco.batch`. Only an error of MuJoCo's, not a divergence, would end the process
instead of raising; a model that gets through `SteppedArm.start` has none to expect.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import ctypes
import logging
from collections.abc import Callable, Sequence
from copy import copy
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numba import njit, typeof, types
from numba.core import event
from numba.core.dispatcher import OmittedArg
from numpy.typing import NDArray

from hydroid.arrays import Array, Index, Structs
from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.kernel import (
    Plugin,
    look_ahead,
    make_pad,
    source_key,
    take_conditions,
    take_over,
)
from hydroid.hydraulics.pump import take_others
from hydroid.hydraulics.records import COEFFICIENTS, JOINT_STATE
from hydroid.simulation.gravity import LINK

_log = logging.getLogger(__name__)

NO_JOINTS = np.empty(0, np.intp)
NO_LINKS = np.empty(0, LINK)
NO_ACTUATORS = Plugin(
    np.empty(0, COEFFICIENTS), NO_JOINTS, np.empty((0, 0), np.intp), 0, 0.0, 1
)
"""of an arm whose joints are all pushed"""

# libmujoco.so.*, libmujoco.*.dylib or mujoco.dll: the one that the bindings have loaded
_file = next(Path(mujoco.__file__).parent.glob("*mujoco.*"))
_library = ctypes.CDLL(str(_file))


def mujoco_function(name: str, *arguments: Any) -> Any:
    """Return a function of MuJoCo for compiled code, which returns nothing, by its
    arguments' numba types."""
    address = ctypes.cast(getattr(_library, name), ctypes.c_void_p).value
    llvmlite.binding.add_symbol(name, address)
    return types.ExternalFunction(name, types.void(*arguments))


_mj_step = mujoco_function("mj_step", types.intp, types.intp)


class Handles(NamedTuple):
    """One MuJoCo simulation for compiled code: addresses, and live arrays over its V
    moving joints."""

    model: int
    data: int
    angle: Array
    velocity: Array
    mass: Array
    applied: Array
    armature: Array
    warnings: NDArray[np.int32]
    columns: Index  # joints with actuators and those they couple with, (J,)
    bare_armature: Array  # the arm's own, without oil, of these [kg·m²], (J,)
    pushed: Index  # the other joints, (P,)
    steps: int  # in one sample
    # the bodies, the world first, (V + 1,) of `gravity.LINK`; empty where a rollout asks
    # for no gravity
    links: Structs
    body_mass: Array  # of these [kg], (V + 1,)
    body_centre: Array  # of these, in their frames [m], (V + 1, 3)
    slack: Array  # angles at which springs are slack [rad], (V,)
    limits: Array  # of the angles [rad], (V, 2)


AT_REFERENCES = np.empty((0, 2))
"""conditions of a course that has neither engine speed nor oil temperature"""


class Course(NamedTuple):
    """What drives an arm from step to step.

    commands: held during each step [%], after those before the start, shape (past + T
    steps, J). torque: of pushed joints [N·m], shape (T steps, P). others: flow from
    the pump into pushed joints [m³/s], the part of the open centre that their valves
    shut, and 1 where one has a command, shape (T steps, 3); or it is empty. opening: of the
    valves in the mean [m²], shape (T steps, J), where they are known before a
    quasi-static rollout; or it is empty. conditions: engine speed over its reference,
    and how much warmer the oil is than at its own [K], shape (T steps, 2); or it is
    empty: both are at their references.
    """

    commands: Array
    torque: Array
    others: Array = np.empty((0, 0))
    opening: Array = np.empty((0, 0))
    conditions: Array = AT_REFERENCES


class Trace(NamedTuple):
    """What a rollout writes: angles of moving joints [rad], (T, V); states, (T, J) of
    JOINT_STATE, or ()."""

    angle: Array
    states: Structs


class SteppedArm:
    """An arm in MuJoCo, a copy of a model, which candidates take in turn and compiled
    code steps.

    Without hydraulics several can be stepped at once (`hydroid.arm.locked.repeat`): V
    and P count the joints of all of them, and each takes a candidate.

    Args:
        columns: the moving joints with actuators, and those they couple with, shape
            (J,). The torques of the P others are given.
        steps: of MuJoCo in one sample.
        rollout: with the arguments of `roll`, which it is by default.
        copies: how often the arm is in the model.
        links: as of `Handles`.

    Attributes:
        model, data: with the values of the candidate that was started last, and its
            state.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        columns: Index = NO_JOINTS,
        steps: int = 1,
        rollout: Callable[..., None] | None = None,
        copies: int = 1,
        links: Structs = NO_LINKS,
    ) -> None:
        self._roll = compiled(rollout or roll)
        self.copies = copies
        self.model = copy(model)
        self.data = mujoco.MjData(model)
        self._has_constants = False
        self._armature = model.dof_armature.copy()
        self._inertia = model.stat.meaninertia
        m = self.model
        d = self.data
        endless = [-np.inf, np.inf]
        # addresses of the bindings: compiled code calls MuJoCo without them
        self._handles = Handles(
            model=m._address,  # pyright: ignore[reportPrivateUsage]
            data=d._address,  # pyright: ignore[reportPrivateUsage]
            angle=d.qpos,
            velocity=d.qvel,
            mass=d.M,
            applied=d.qfrc_applied,
            armature=m.dof_armature,
            warnings=d.warning.number,
            columns=columns,
            bare_armature=self._armature[columns],
            pushed=np.setdiff1d(np.arange(m.nv), columns),
            steps=steps,
            links=links,
            body_mass=m.body_mass,
            body_centre=m.body_ipos,
            slack=m.qpos_spring,
            limits=np.where(m.jnt_limited[:, None], m.jnt_range, endless),
        )

    def start(
        self, values: dict[str, Array], rows: Sequence[int] | Index, pose: Array
    ) -> Array:
        """Put the candidate of a row of `values` into `pose` [rad], shape (V,), at
        rest; within `quiet_mujoco`. `rows` has one for each copy of the arm.

        `values` is what candidates change in the model, as `Scenario.values` returns
        it. Returned is what holds it there, tau0 = g(q0) of equation (1), and springs
        that are not slack there [N·m], shape (V,).
        """
        model = self.model
        data = self.data
        is_other = False
        for name, value in values.items():
            field = getattr(model, name)
            # its row stands before those of all copies
            world = len(field) % self.copies
            of_copies = field[world:]
            given = value[rows, world:].reshape(of_copies.shape)
            if name.startswith("body_"):
                is_other |= not np.array_equal(of_copies, given)
            of_copies[:] = given
        model.dof_armature[:] = self._armature  # a rollout steps with another
        # what follows from the bodies; most candidates have those of the one before
        if is_other or not self._has_constants:
            mujoco.mj_setConst(model, data)
            self._has_constants = True
        # constraints are solved as well whoever stands beside
        model.stat.meaninertia = self._inertia
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        data.warning.number[:] = 0
        balance = data.qfrc_bias - data.qfrc_passive
        model.dof_damping[self._handles.columns] = 0.0  # the actuators integrate it
        return balance

    @property
    def healthy(self) -> bool:
        """Whether the arm is finite and drew no warning of MuJoCo's since its start."""
        finite = np.isfinite([self.data.qpos, self.data.qvel]).all()
        return bool(finite) and not self.data.warning.number.any()

    def roll(
        self, plugin: Plugin, state: Structs, course: Course, trace: Trace
    ) -> None:
        """Step one candidate up to the first warning of MuJoCo's; call it within
        `quiet_mujoco`.

        `state` is its actuators', (J,) of JOINT_STATE: steps change it.
        """
        call_compiled(self._roll, self._handles, plugin, state, course, trace)

    @property
    def handles(self) -> Handles:
        """What compiled code steps."""
        return self._handles

    def bind(
        self, plugin: Plugin, state: Structs, course: Course, trace: Trace
    ) -> Callable[[], object]:
        """Return a call of `roll` with these arrays, whatever they hold by then."""
        return bind(self._roll, self._handles, plugin, state, course, trace)


def bind(compiled: Any, *arguments: Any) -> Callable[[], object]:
    """Return a call of a compiled function with these arguments, whose last one,
    `source`, is left out.

    It takes 3 µs beside the function itself. Without it numba looks at the types at
    every call, and takes 1 ms or more for those of structured arrays.
    """
    return partial(_entry(compiled, arguments), *arguments, _source(compiled))


_entries: dict[Any, Callable[..., object]] = {}
"""what `call_compiled` calls, by the function and the kinds of its arguments"""


def call_compiled(compiled: Any, *arguments: Any) -> None:
    """Call a compiled function as `bind` does, for arguments that are others each time:
    numba looks at their types only where their kinds are new."""
    key = (compiled, *map(_kind, arguments))
    entry = _entries.get(key)
    if entry is None:
        entry = _entry(compiled, arguments)
        _entries[key] = entry
    entry(*arguments, _source(compiled))


def _entry(compiled: Any, arguments: Sequence[Any]) -> Callable[..., object]:
    """Return a compiled function for the types of its arguments, `source` left out."""
    omitted = types.Omitted(_source(compiled).value)
    return compiled.compile((*map(typeof, arguments), omitted))


def _source(compiled: Any) -> OmittedArg:
    (source,) = compiled.py_func.__defaults__
    return OmittedArg(source)


def _kind(argument: Any) -> Any:
    """Return what the type of an argument depends on for numba, or what tells more
    apart."""
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    if isinstance(argument, tuple):
        return type(argument), *map(_kind, argument)
    return type(argument)


@compilable
def write_sample(arm, trace, state, k: int) -> None:
    """Write the sample that step k ends, if it ends one."""
    if (k + 1) % arm.steps == 0:
        sample = k // arm.steps
        # a loop: numba first looks whether two arrays overlap
        for i in range(arm.angle.size):
            trace.angle[sample, i] = arm.angle[i]
        if trace.states.size:
            trace.states[sample] = state


@compilable
def roll(arm, plugin, state, course, trace) -> None:
    """Roll one candidate out as `SteppedArm.roll` does."""
    commands, torque, others, _, conditions = course
    steps = torque.shape[0]
    past = commands.shape[0] - steps
    pad = make_pad(state.size)
    for k in range(steps):
        if others.size:
            take_others(pad.line[0], others[k])
        if conditions.size:
            take_conditions(plugin, pad, conditions[k])
        if state.size:
            look_ahead(plugin, state, commands, past + k, arm, pad)
        for i in range(arm.pushed.size):
            arm.applied[arm.pushed[i]] = torque[k, i]
        _mj_step(arm.model, arm.data)
        if arm.warnings.any():
            return
        take_over(plugin, state, arm, pad)
        write_sample(arm, trace, state, k)


@cache
def compiled(rollout: Any) -> Any:
    """Return a rollout, which is `compilable`, as a function of its own.

    Numba's cache tells the rollouts apart by what stands in the closure.
    """

    @njit(cache=True, nogil=True, error_model="numpy")
    def rolled(arm, plugin, state, course, trace, source: int = source_key(rollout)):
        rollout(arm, plugin, state, course, trace)

    return rolled


class _Announcement(event.Listener):
    """Says once that numba compiles, which it does only where its cache holds nothing
    usable."""

    _made = False

    def on_start(self, event) -> None:
        if not self._made:
            _log.warning("compiling the simulation, once on this machine ...")
        self._made = True

    def on_end(self, event) -> None:
        pass


@cache
def compile_rollout() -> None:
    """Make the compiled loop ready: read it from numba's cache, or compile it and say
    so in the log."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
    )
    nothing = np.empty((0, 1))
    course = Course(nothing, nothing)
    trace = Trace(nothing, np.empty((0, 1), JOINT_STATE))
    no_state = np.empty(0, JOINT_STATE)
    with event.install_listener("numba:compile", _Announcement()):
        SteppedArm(model).roll(NO_ACTUATORS, no_state, course, trace)
