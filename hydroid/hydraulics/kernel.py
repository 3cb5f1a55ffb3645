"""The compiled loop: all joints of every member look ahead over one MuJoCo step.

Oil is stiff: with the arm it rings at 60 to 300 rad/s, so a torque that is computed, then held for 0.01 s, is
unstable or wrong. Instead the actuators look ahead. With the arm's mass matrix M as it is, and all that is
neither hydraulic nor damping (gravity, Coriolis, springs, stops) as a torque e per joint held over the step
as it was in the last one, they integrate

    M v̇ = r F_R − D v + e,   ẏ_A = β Q_A/V_A,   ẏ_B = β Q_B/V_B,   and the plungers

in sub-steps of a linearised trapezoidal rule: chambers are eliminated, then one symmetric system gives the
velocities of all joints. The result is each joint's way, its mean torque τ* and a predicted velocity v*.

MuJoCo then finds the true new velocity v from true forces; the torque answers a difference, which grows over
the step, by −κ (v − v*) in the mean, κ = h C / 6 + D / 2 with C the stiffness of the oil [N·m/rad]. To be
solved for v at once, κ is lent to MuJoCo as an inertia:

    M (v − v₀)/h = τ* − κ (v − v*) + …   is   (M + h κ) (v − v₀)/h = τ* + κ (v* − v₀) + …

As a damping it would be the same but for stops and contacts: their solver ignores implicit damping, and where
that is strong throws the arm about. After the step `close` puts the joint at q + way + h (v − v*)/2 and takes
e from what really happened. Where M and e do not change within a step, this *is* the sub-stepped solution, of
second order in the sub-step and stable for any stiffness; their change is first order in MuJoCo's step.

Every member is computed from its own numbers in a fixed order: neither threads nor chunks change a bit of it.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from hydroid.hydraulics.elementwise import compilable
from hydroid.hydraulics.joint import begin, command, idle, load, meter, move_spool, settle
from hydroid.hydraulics.parameters import NONE

RAMP_TORQUE, RAMP_WAY = 1.0 / 6.0, 1.0 / 2.0
"""means of t²/2 and t over a unit step: what a velocity error growing from 0 to 1 does to oil and way"""

# numba keys its cache on one file; as a default argument, the text of all these files is part of the key
_SOURCE = int.from_bytes(
    hashlib.sha256(b"".join(p.read_bytes() for p in sorted(Path(__file__).parent.glob("*.py")))).digest()[:7]
)


@compilable
def solve(matrix: Any, vector: Any) -> None:
    """Replace `vector`, (J,), by matrix⁻¹ vector.

    Of the symmetric positive matrix, (J, J), only diagonal and upper half are read; they are used up.
    """
    size = matrix.shape[0]
    for k in range(size):
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, size):
            factor = matrix[k, i] * inverse
            for j in range(i, size):
                matrix[i, j] -= factor * matrix[k, j]
            vector[i] -= factor * vector[k]
        matrix[k, k] = inverse
    for i in range(size - 1, -1, -1):
        rest = vector[i]
        for k in range(i + 1, size):
            rest -= matrix[i, k] * vector[k]
        vector[i] = rest * matrix[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    coefficients: Any,
    state: Any,
    work: Any,
    commands: Any,
    newest: int,
    angle: Any,
    velocity: Any,
    mass: Any,
    entries: Any,
    damping: Any,
    period: float,
    substeps: int,
    torque: Any,
    armature: Any,
    source: int = _SOURCE,
) -> None:
    """Look ahead over one step of `period` [s]; arguments as in `hydroid.hydraulics.actuator`."""
    members, joints = coefficients.shape
    step = period / substeps
    matrix, gain = np.empty((joints, joints)), np.empty(joints)
    for n in range(members):
        for j in range(joints):
            c, z, w = coefficients[n, j], state[n, j], work[j]
            begin(c, z, w, angle[n, j], velocity[n, j])
            w.inertia = mass[n, entries[j, j]] - z.armature
            if c.kind == NONE:
                idle(z, w, damping[n, j], step)
            else:
                command(c, w, commands, newest, j, period, substeps)
        for i in range(substeps):
            for j in range(joints):
                c, z, w = coefficients[n, j], state[n, j], work[j]
                if c.kind != NONE:
                    meter(c, w, move_spool(c, z, w, i, step))
                    load(c, w, damping[n, j], step)
                drag = w.share * w.stiff + w.resist
                gain[j] = step * (w.push + z.external - drag * w.speed)
                matrix[j, j] = w.inertia + w.share * step * drag
                for k in range(j + 1, joints):
                    matrix[j, k] = mass[n, entries[j, k]]
            solve(matrix, gain)
            for j in range(joints):
                settle(coefficients[n, j], state[n, j], work[j], gain[j], step)
        for j in range(joints):
            z, w = state[n, j], work[j]
            z.way, z.predicted = w.way, w.speed
            z.flow_a, z.flow_b = w.flow_a / substeps, w.flow_b / substeps
            kappa = (RAMP_TORQUE * period * w.oil_stiffness + RAMP_WAY * w.resistance) / substeps
            z.armature = period * kappa
            z.torque = w.torque / substeps + kappa * (w.speed - velocity[n, j])
            torque[n, j], armature[n, j] = z.torque, z.armature


@njit(cache=True, nogil=True, error_model="numpy")
def close(
    state: Any,
    velocity: Any,
    mass: Any,
    entries: Any,
    period: float,
    angle: Any,
    source: int = _SOURCE,
) -> None:
    """Take over the true new velocity [rad/s]; writes the new angle [rad] to `angle`."""
    members, joints = state.shape
    for n in range(members):
        for j in range(joints):
            z = state[n, j]
            angle[n, j] = z.angle + z.way + RAMP_WAY * period * (velocity[n, j] - z.predicted)
            # (M + h κ) q̈ − torque is what neither oil nor damping did; M is bound with the lent inertia in it
            z.external = -z.torque
            for k in range(joints):
                z.external += mass[n, entries[j, k]] * (velocity[n, k] - state[n, k].velocity) / period
