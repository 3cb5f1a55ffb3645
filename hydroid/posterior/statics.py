"""Quantities that need no movement: gravity, stage 1's ratios, the arm on its oil, the ratio of areas."""

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np

from hydroid.hydraulics.cylinder import rod_motion, volume
from hydroid.hydraulics.records import LINEAR, Records, coefficients, linkages
from hydroid.parameters import Array
from hydroid.posterior.bench import Bench
from hydroid.simulation import Candidates


class Column(NamedTuple):
    """One quantity of a joint, or one point of a curve against the command.

    name: plain ASCII. label: the same in words. positive: it cannot be negative, and its interval is
    multiplicative. command: of a curve: where this point is [%].
    """

    name: str
    label: str
    unit: str
    positive: bool = True
    command: float | None = None


Measured: TypeAlias = Iterator[tuple[Column, Array]]
"""quantities of n candidates, each of shape (n,), the same for every population;
NaN where one is undefined"""


def gravity(bench: Bench, torque: Array) -> tuple[Column, Array]:
    """Gravity's torque on the joint at its angle, (n,)."""
    label = f"gravity torque at {np.degrees(bench.angle):.0f} deg"
    return Column("gravity_torque_at_pose", label, "N·m", False), torque


def gain_model(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 1: what the joint does under K u = D q̇ + F_c sign(q̇), before springs and gravity's change act."""
    joint = candidates.joints[:, bench.joint - 1]
    gain, damping, friction = joint["gain"], joint["damping"], joint["friction"]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.degrees(gain / damping)
        yield Column("gain", "gain between command and speed, K/D", "deg/s per %"), ratio
        yield Column("time_constant", "time constant, inertia/D", "s"), inertia / damping
        yield Column("dead_band", "dead band, friction/K", "%"), friction / gain
        for u in (-100.0, -75.0, -50.0, -25.0, -10.0, 10.0, 25.0, 50.0, 75.0, 100.0):
            torque = np.sign(u) * np.maximum(gain * abs(u) - friction, 0.0)
            yield Column("speed", "speed", "deg/s", False, u), np.degrees(torque / damping)


def oil(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 2: the arm on its oil with the valve shut, and the ratio of areas.

    The oil is a spring of stiffness r² β (A_A²/V_A + A_B²/V_B) at the joint. Leakage and the seals' friction
    are left out of the damping.
    """
    c, arm = actuator(bench, candidates)
    volumes = c.dead_volume, c.dead_volume
    if c.kind[0] == LINEAR:
        travel = rod_motion(np.full(len(c), bench.angle), c)[0]
        volumes = volume(travel, c.a.area, c.dead_volume), volume(c.stroke - travel, c.b.area, c.dead_volume)
    stiffness = arm**2 * c.bulk_modulus * (c.a.area**2 / volumes[0] + c.b.area**2 / volumes[1])
    frequency = np.sqrt(stiffness / inertia) / (2.0 * np.pi)
    damping = c.damping / (2.0 * np.sqrt(stiffness * inertia))
    if not bench.settings.quasi_static:  # it knows of neither oil nor inertia
        yield Column("natural_frequency", "natural frequency of the arm on the oil", "Hz"), frequency
        yield Column("damping_ratio", "damping ratio of the arm on the oil", ""), damping
    yield Column("area_ratio", "ratio of areas, A/B", ""), c.a.area / c.b.area


def actuator(bench: Bench, candidates: Candidates) -> tuple[Records, Array]:
    """Return n candidates' COEFFICIENTS of the joint, (n,), and their moment arm at its angle [m], (n,).

    Of a rotary actuator, whose areas are displacements, the moment arm is 1.
    """
    j = bench.joint - 1
    joints: Records = candidates.joints[:, [j]]  # pyright: ignore[reportAssignmentType]
    c: Records = coefficients(joints, linkages(bench.settings.arm, [j], [j], joints))[:, 0]  # pyright: ignore[reportAssignmentType]
    return c, rod_motion(np.full(len(c), bench.angle), c)[1]
