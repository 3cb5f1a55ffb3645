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
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import begin, coast, command, load, net_opening, settle
from hydroid.hydraulics.pump import begin_line, close_line, draw, fill, open_line
from hydroid.hydraulics.records import LINE, SCRATCH
from hydroid.hydraulics.valve import meter
from hydroid.settings import linkage

RAMP_TORQUE, RAMP_WAY = 1.0 / 6.0, 1.0 / 2.0
"""means of t²/2 and t over a unit step: what a velocity error growing from 0 to 1 does
to oil and way"""


def source_key(*more: str | None) -> int:
    """Return a number that changes with the text of the hydraulics' files, and of
    `more` files.

    Numba keys its cache on one file only. As a default argument of a compiled function,
    this number makes all files part of the key from which the function takes code in.
    """
    files = [
        *sorted(Path(__file__).parent.glob("*.py")),
        Path(linkage.__file__),
        *map(Path, filter(None, more)),
    ]
    return int.from_bytes(
        hashlib.sha256(b"".join(file.read_bytes() for file in files)).digest()[:7]
    )


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
    """What stays the same during a run, of one candidate's J joints; `of` takes one of
    n."""

    coefficients: Any  # (J,), of COEFFICIENTS, or (n, J)
    order: Any  # the joints, those without actuator first, (J,)
    entries: Any  # where their M[i, j] stands in a row of masses, in this order, (J, J)
    idle: int  # how many have none
    period: float  # of a step [s]
    substeps: int

    @property
    def past(self) -> int:
        """Number of steps that the longest delay reaches back."""
        return max(self.coefficients[side]["late"].max(initial=0) for side in "ab")

    def of(self, candidate: int) -> "Plugin":
        """Return one candidate's."""
        return self._replace(coefficients=self.coefficients[candidate])


class Pad(NamedTuple):
    """Scratch space of one look-ahead: (J,) of SCRATCH, (1,) of LINE; what the matrices
    of all sub-steps share, and one of them, (J, J); the right side, then the gain in
    velocity, (J,)."""

    joints: Any
    line: Any
    common: Any
    matrix: Any
    gain: Any


@compilable
def make_pad(joints: int) -> Pad:
    """Return scratch space for so many joints."""
    square = (joints, joints)
    work, line = np.zeros(joints, SCRATCH), np.zeros(1, LINE)
    return Pad(work, line, np.empty(square), np.empty(square), np.empty(joints))


@compilable
def look_ahead(plugin: Plugin, state, commands, now: int, arm, pad: Pad) -> None:
    """Look ahead over one step of one candidate; writes torques and armatures of its
    `arm` in MuJoCo.

    `state` is its actuators', (J,) of JOINT_STATE; of the commands [%], (.., J), that
    at `now` holds. The joints are the `columns` of the arm's angle, velocity, applied
    torque and armature, and `own` is their armature without oil.
    """
    coefficients, order, entries, idle, period, substeps = plugin
    work, lines, common, matrix, gain = pad
    line = lines[0]
    joints = state.shape[0]
    # all joints with an actuator have the same pump: read it at one of them
    some, last = coefficients[order[joints - 1]], state[order[joints - 1]]
    shared = idle < joints and some.pump_flow < np.inf
    part = 1.0 / substeps
    step, demanded = part * period, False
    for a in range(joints):
        j = order[a]
        c, z, w = coefficients[j], state[j], work[j]
        begin(c, z, w, arm.angle[arm.columns[j]], arm.velocity[arm.columns[j]])
        w.inertia = arm.mass[entries[a, a]] - z.armature
        matrix[a, a] = w.inertia
        if a < idle:
            coast(c, z, w, step)
            matrix[a, a] += w.weight * step * w.drag
        else:
            command(c, z, w, commands[:, j], now)
            demanded |= commands[now, j] != 0.0
        for b in range(a + 1, joints):
            matrix[a, b] = arm.mass[entries[a, b]]
    if shared:
        begin_line(line, some, last, demanded, step)
    # joints without actuator bring the same to all sub-steps: they are eliminated once
    eliminate(matrix, 0, idle)
    for a in range(idle, joints):
        for b in range(a, joints):
            common[a, b] = matrix[a, b]
    for i in range(substeps):
        for a in range(joints):
            j = order[a]
            c, z, w = coefficients[j], state[j], work[j]
            if a >= idle:
                supply = (
                    min(line.pressure, c.supply_pressure)
                    if shared
                    else c.supply_pressure
                )
                meter(c, w, net_opening(c, z, w, i, step), supply)
                load(c, z, w, step)
                if shared:
                    draw(line, c, w)
            resistance = w.weight * w.stiffness + w.drag
            gain[a] = step * (w.push + z.external - resistance * w.speed)
            if a >= idle:
                matrix[a, a] = common[a, a] + w.weight * step * resistance
                for b in range(a + 1, joints):
                    matrix[a, b] = common[a, b]
        if shared:
            open_line(line, some, step)
            for a in range(idle, joints):  # the line joins the system of the velocities
                u = work[order[a]]
                gain[a] += step * u.weight * u.thrust * line.change
                for b in range(a, joints):
                    w = work[order[b]]
                    matrix[a, b] += (
                        step * line.softness * u.weight * u.pull * w.weight * w.pull
                    )
        eliminate(matrix, idle, joints)
        substitute(matrix, gain)
        if shared:
            for a in range(idle, joints):  # its pressure follows from them
                w = work[order[a]]
                line.change -= line.softness * w.sweep * w.weight * gain[a]
            for a in range(idle, joints):
                fill(line, work[order[a]], step)
            close_line(line, some)
        for a in range(joints):
            j = order[a]
            settle(coefficients[j], state[j], work[j], gain[a], step)
    for j in range(joints):
        z, w = state[j], work[j]
        z.way, z.predicted = w.way, w.speed
        z.a.flow, z.b.flow = part * w.a.flow, part * w.b.flow
        kappa = part * (
            RAMP_TORQUE * period * w.oil_stiffness + RAMP_WAY * w.resistance
        )
        z.armature = period * kappa
        z.torque = part * w.torque + kappa * (w.speed - z.velocity)
        arm.applied[arm.columns[j]], arm.armature[arm.columns[j]] = (
            z.torque,
            arm.own[j] + z.armature,
        )
        if shared:
            z.line, z.share, z.demand = line.pressure, line.share, line.demand


@compilable
def take_over(plugin: Plugin, state, arm, pad: Pad) -> None:
    """Take over one candidate's true new velocities from MuJoCo, and give it the new
    angles."""
    order, entries, period, change = (
        plugin.order,
        plugin.entries,
        plugin.period,
        pad.gain,
    )
    for a in range(order.size):
        z, place = state[order[a]], arm.columns[order[a]]
        velocity = arm.velocity[place]
        arm.angle[place] = (
            z.angle + z.way + RAMP_WAY * period * (velocity - z.predicted)
        )
        change[a], z.velocity = velocity - z.velocity, velocity
    for a in range(order.size):
        # (M + h κ) q̈ − torque is what neither oil nor damping did; the bound M
        # contains h κ
        momentum = 0.0
        for b in range(order.size):
            momentum += arm.mass[entries[a, b]] * change[b]
        state[order[a]].external = momentum / period - state[order[a]].torque
