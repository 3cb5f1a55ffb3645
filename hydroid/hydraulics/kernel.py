"""The compiled loop: all joints of every candidate look ahead over one MuJoCo step.

Oil is stiff: with the arm it rings at 60 to 300 rad/s, so a torque that is computed,
then held for 0.01 s, is unstable or wrong. Instead the actuators look ahead. With the
arm's mass matrix M as it is, and all that is neither hydraulic nor damping (gravity,
Coriolis, springs, stops) as a torque e per joint held over the step as it was in the
last one, they integrate

    M v̇ = r F_R − D v + e,   ẏ_A = β Q_A/V_A,   ẏ_B = β Q_B/V_B,   and the plungers

in sub-steps of a linearised trapezoidal rule: chambers are eliminated, then one
symmetric system gives the velocities of all joints. The result is each joint's way, its
mean torque τ* and a predicted velocity v*.

MuJoCo then finds the true new velocity v from true forces; the torque answers a
difference, which grows over the step, by −κ (v − v*) in the mean, κ = h C / 6 + D / 2
with C the stiffness of the oil [N·m/rad]. To be solved for v at once, κ is added to
MuJoCo's inertia:

    M (v − v₀)/h = τ* − κ (v − v*) + …   is   (M + h κ) (v − v₀)/h = τ* + κ (v* − v₀) + …

As a damping it would be the same but for stops and contacts: their solver ignores
implicit damping, and where that is strong throws the arm about. After the step
`take_over` puts the joint at q + way + h (v − v*)/2 and takes e from what really
happened. Where M and e do not change within a step, this *is* the sub-stepped solution,
of second order in the sub-step and stable for any stiffness; their change is first
order in MuJoCo's step.

Every candidate is computed from its own numbers in a fixed order, so threads change no
bit.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import hashlib
from collections.abc import Iterator
from inspect import getfile
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import begin, coast, command, load, net_opening, settle
from hydroid.hydraulics.pump import (
    begin_line,
    close_line,
    draw_from_line,
    fill,
    left_open,
    open_line,
)
from hydroid.hydraulics.records import LINE, SCRATCH
from hydroid.hydraulics.valve import faster, meter
from hydroid.settings import linkage

# means of t²/2 and t over a unit step: what a velocity error that grows from 0 to 1
# does to the oil's torque and to the way
RAMP_TORQUE = 1.0 / 6.0
RAMP_WAY = 1.0 / 2.0


def source_key(*inlined: FunctionType) -> int:
    """Return a number that changes with the text of the hydraulics' files, and of those
    from which `inlined` functions take code in.

    Numba keys its cache on one file only. As a default argument of a compiled function,
    this number makes all files part of the key from which the function takes code in.
    """
    seen = set[FunctionType]()
    for function in inlined:
        _follow(function, seen)
    files = {Path(linkage.__file__), *(Path(getfile(one)) for one in seen)}
    files.update(Path(__file__).parent.glob("*.py"))
    texts = b"".join(file.read_bytes() for file in sorted(files))
    return int.from_bytes(hashlib.sha256(texts).digest()[:7])


def _follow(function: FunctionType, seen: set[FunctionType]) -> None:
    """Add a function and those that it takes code in from, of hydroid and of its own
    package.

    Raises TypeError: it names a module of theirs, whose functions nobody follows.
    """
    if function in seen:
        return
    seen.add(function)
    ours = {"hydroid", _package(function.__module__)}
    for name in _names(function.__code__):
        used: Any = function.__globals__.get(name)
        if isinstance(used, ModuleType) and _package(used.__name__) in ours:
            raise TypeError(f"{function.__name__}: import what it uses of {name}")
        # what is compiled by itself is taken in, too
        used = getattr(used, "py_func", used)
        if isinstance(used, FunctionType) and _package(used.__module__) in ours:
            _follow(used, seen)


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code uses, its inner functions' among them."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _package(module: str) -> str:
    return module.partition(".")[0]


SOURCE = source_key()


@compilable
def eliminate(matrix, start: int, stop: int) -> None:
    """Factorise rows `start` to `stop` of a symmetric positive matrix, (J, J), in place
    as L D Lᵀ.

    Only diagonal and upper half are used: they come to hold D⁻¹ and Lᵀ, and from `stop`
    on what is left.
    """
    size = matrix.shape[0]
    for k in range(start, stop):
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, size):
            factor = matrix[k, i] * inverse
            for j in range(i, size):
                matrix[i, j] -= factor * matrix[k, j]
            matrix[k, i] = factor
        matrix[k, k] = inverse


@compilable
def substitute(matrix, vector) -> None:
    """Replace `vector`, (J,), by the solution of a system that is factorised
    throughout."""
    size = matrix.shape[0]
    for k in range(size):
        for i in range(k + 1, size):
            vector[i] -= matrix[k, i] * vector[k]
    for k in range(size):
        vector[k] *= matrix[k, k]
    for k in range(size - 1, 0, -1):
        for i in range(k):
            vector[i] -= matrix[i, k] * vector[k]


class Plugin(NamedTuple):
    """What stays the same during a run: the actuators of J joints, of one candidate or
    of n.

    Compiled code takes that of one candidate, which `candidate` picks.
    """

    coefficients: Any  # (J,), of COEFFICIENTS, or (n, J)
    order: Any  # the joints, those without actuator first, (J,)
    entries: Any  # where their M[i, j] stands in a row of masses, in this order, (J, J)
    idle: int  # how many have none
    period: float  # of a step [s]
    substeps: int

    @property
    def past(self) -> int:
        """Number of steps that the longest delay reaches back."""
        return max(
            self.coefficients[side]["delay_steps"].max(initial=0) for side in "ab"
        )

    def candidate(self, row: int) -> "Plugin":
        """Return the actuators of one of n candidates."""
        return self._replace(coefficients=self.coefficients[row])


class Pad(NamedTuple):
    """Scratch space of the look-ahead over J joints.

    joints: (J,) of SCRATCH. line: of the pump, (1,) of LINE. common: what the matrices
    of all sub-steps share, (J, J). matrix: of the present sub-step, (J, J). gain: first
    the right side of its system, then the joints' gains in velocity [rad/s], (J,).
    """

    joints: Any
    line: Any
    common: Any
    matrix: Any
    gain: Any


@compilable
def make_pad(joints: int) -> Pad:
    """Return scratch space for so many joints."""
    square = (joints, joints)
    return Pad(
        joints=np.zeros(joints, SCRATCH),
        line=np.zeros(1, LINE),
        common=np.empty(square),
        matrix=np.empty(square),
        gain=np.empty(joints),
    )


@compilable
def take_conditions(plugin: Plugin, pad: Pad, conditions) -> None:
    """Let pump and valves of one candidate work as at an engine speed over its
    reference, and in oil warmer than at its own [K], (2,)."""
    engine = conditions[0]
    pad.line[0].faster = engine - 1.0
    for j in range(plugin.order.size):
        c = plugin.coefficients[j]
        pad.joints[j].faster = faster(c, engine, conditions[1])


@compilable
def look_ahead(plugin: Plugin, state, commands, now: int, arm, pad: Pad) -> None:
    """Look ahead over one step of one candidate; writes torques and armatures of its
    `arm` in MuJoCo.

    `state` is its actuators', (J,) of JOINT_STATE; of the commands [%], (.., J), that
    at `now` holds. The joints are the `columns` of the arm's angle, velocity, applied
    torque and armature, and `bare_armature` is theirs without oil.
    """
    coefficients, order, entries, idle, period, substeps = plugin
    work, lines, common, matrix, gain = pad
    line = lines[0]
    joints = state.shape[0]
    # what belongs to the joints with an actuator; a function that took `plugin` and
    # `pad` whole would count references to all of their arrays at every call
    driven = order[idle:]
    driven_matrix = matrix[idle:, idle:]
    driven_gain = gain[idle:]
    # all joints with an actuator have the same pump: read it at the last of them
    pump = coefficients[order[joints - 1]]
    shared = has_line(pump, joints - idle)
    part = 1.0 / substeps
    step = part * period
    demanded = False
    take_masses(arm.mass, entries, matrix)
    for a in range(joints):
        j = order[a]
        c = coefficients[j]
        z = state[j]
        w = work[j]
        begin(c, z, w, arm.angle[arm.columns[j]], arm.velocity[arm.columns[j]])
        # MuJoCo's mass matrix still has the armature h κ of the last step
        matrix[a, a] -= z.armature
        w.inertia = matrix[a, a]
        if a < idle:
            coast(c, z, w, step)
            matrix[a, a] += w.weight * step * w.drag
        else:
            command(c, z, w, commands[:, j], now)
            demanded |= commands[now, j] != 0.0
    line.pressure = np.inf
    if shared:
        begin_line(line, pump, state[order[joints - 1]], demanded, step)
    # joints without actuator bring the same to all sub-steps: they are eliminated once
    eliminate(matrix, 0, idle)
    copy_upper(driven_matrix, common)
    for substep in range(substeps):
        copy_upper(common, driven_matrix)
        for a in range(joints):
            j = order[a]
            z = state[j]
            w = work[j]
            if a >= idle:
                drive_joint(coefficients[j], z, w, line, substep, step)
            resistance = w.weight * w.stiffness + w.drag
            gain[a] = step * (w.push + z.external - resistance * w.speed)
            if a >= idle:
                matrix[a, a] += w.weight * step * resistance
        if shared:
            open_line(line, pump, step)
            couple_by_line(line, work, driven, driven_matrix, driven_gain, step)
        eliminate(matrix, idle, joints)
        substitute(matrix, gain)
        if shared:
            take_line_pressure(line, pump, work, driven, driven_gain, step)
        for a in range(joints):
            j = order[a]
            settle(coefficients[j], state[j], work[j], gain[a], step)
    for j in range(joints):
        z = state[j]
        hand_over(z, work[j], line, part, period)
        arm.applied[arm.columns[j]] = z.torque
        arm.armature[arm.columns[j]] = arm.bare_armature[j] + z.armature


@compilable
def has_line(pump, driven: int) -> bool:
    """Whether so many driven joints share a line: the flow of their pump is limited."""
    return driven > 0 and pump.pump_flow < np.inf


@compilable
def take_masses(mass, entries, matrix) -> None:
    """Write the upper half of M, (J, J), from a row of MuJoCo's masses."""
    size = matrix.shape[0]
    for a in range(size):
        for b in range(a, size):
            matrix[a, b] = mass[entries[a, b]]


@compilable
def copy_upper(source, target) -> None:
    """Copy diagonal and upper half of a matrix to the first rows and columns of
    another."""
    size = min(source.shape[0], target.shape[0])
    for a in range(size):
        for b in range(a, size):
            target[a, b] = source[a, b]


@compilable
def drive_joint(c, z, w, line, substep: int, step: float) -> None:
    """Valve and oil of a joint in a sub-step: its flows, stiffness, torque and
    resistance.

    The pressure of the pump's line is inf where the pump's flow has no limit.
    """
    opening = net_opening(c, z, w, substep, step)
    meter(c, w, opening, min(line.pressure, c.supply_pressure))
    load(c, z, w, step)
    if line.pressure < np.inf:
        draw_from_line(line, c, w)
        line.centre = left_open(line.centre, c, opening)


@compilable
def couple_by_line(line, work, driven, matrix, gain, step: float) -> None:
    """Add to the system of the driven joints' velocities that they share the line."""
    for a in range(driven.size):
        u = work[driven[a]]
        gain[a] += step * u.weight * u.thrust * line.change
        for b in range(a, driven.size):
            w = work[driven[b]]
            matrix[a, b] += step * line.softness * u.weight * u.pull * w.weight * w.pull


@compilable
def take_line_pressure(line, pump, work, driven, gain, step: float) -> None:
    """Take over the line's change of pressure, which follows from the joints' gains in
    velocity."""
    for a in range(driven.size):
        w = work[driven[a]]
        line.change -= line.softness * w.sweep * w.weight * gain[a]
    # every joint takes the whole change, so it must be complete before
    for a in range(driven.size):
        fill(line, work[driven[a]], step)
    close_line(line, pump)


@compilable
def hand_over(z, w, line, part: float, period: float) -> None:
    """Turn a joint's sums over the sub-steps into what MuJoCo's step takes; one
    sub-step is a `part` of the period [s]."""
    z.way = w.way
    z.predicted = w.speed
    z.a.flow = part * w.a.flow
    z.b.flow = part * w.b.flow
    kappa = part * (RAMP_TORQUE * period * w.oil_stiffness + RAMP_WAY * w.resistance)
    z.armature = period * kappa
    z.torque = part * w.torque + kappa * (w.speed - z.velocity)
    if line.pressure < np.inf:
        z.line = line.pressure
        z.share = line.share
        z.demand = line.demand


@compilable
def take_over(plugin: Plugin, state, arm, pad: Pad) -> None:
    """Take over one candidate's true new velocities from MuJoCo, and give it the new
    angles."""
    order = plugin.order
    period = plugin.period
    # the gains of the look-ahead are no longer needed
    change = pad.gain
    for a in range(order.size):
        z = state[order[a]]
        column = arm.columns[order[a]]
        velocity = arm.velocity[column]
        unforeseen = RAMP_WAY * period * (velocity - z.predicted)
        arm.angle[column] = z.angle + z.way + unforeseen
        change[a] = velocity - z.velocity
        z.velocity = velocity
    for a in range(order.size):
        # (M + h κ) q̈ − torque is what neither oil nor damping did; the bound M
        # contains h κ
        momentum = 0.0
        for b in range(order.size):
            momentum += arm.mass[plugin.entries[a, b]] * change[b]
        state[order[a]].external = momentum / period - state[order[a]].torque
