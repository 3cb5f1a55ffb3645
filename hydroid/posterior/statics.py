"""Quantities that need no movement: gravity, stage 1's ratios, the arm on its oil, the ratio of areas."""

import numpy as np

from hydroid.hydraulics.cylinder import rod_motion, volume
from hydroid.hydraulics.records import LINEAR, Records, coefficients, linkages
from hydroid.parameters import Array
from hydroid.posterior.bench import Bench
from hydroid.posterior.column import Column, Measured
from hydroid.simulation import Candidates

GRAVITY_POINTS = 9
COMMANDS = (-100.0, -75.0, -50.0, -25.0, -10.0, 10.0, 25.0, 50.0, 75.0, 100.0)
"""at which stage 1's speeds are stated [%]"""


def gravity(bench: Bench, candidates: Candidates) -> Measured:
    """The torque that holds the joint against gravity, over its travel and where it is tested [N·m]."""
    angles = np.append(np.linspace(*bench.travel, GRAVITY_POINTS), bench.angle)
    torque = bench.weigh(candidates, angles)[0].T
    name, label = f"{bench.name}_gravity_torque", "gravity torque"
    curve = [Column(name, label, "N·m", False, "angle [deg]", float(np.degrees(q))) for q in angles[:-1]]
    one = Column(f"{name}_at_pose", f"{label} at {np.degrees(bench.angle):.0f} deg", "N·m", False)
    return list(zip((*curve, one), torque, strict=True))


def gain_model(bench: Bench, candidates: Candidates) -> Measured:
    """Stage 1: what the joint does under K u = D q̇ + F_c sign(q̇), before springs and gravity's change act."""
    j, name = bench.joint - 1, bench.name
    gain, damping, friction = (candidates.joints[name][:, j] for name in ("gain", "damping", "friction"))
    inertia = bench.weigh(candidates, np.array([bench.angle]))[1][:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        torques = [np.sign(u) * np.maximum(gain * abs(u) - friction, 0.0) for u in COMMANDS]
        return [
            (
                Column(f"{name}_gain", "gain between command and speed, K/D", "deg/s per %"),
                np.degrees(gain / damping),
            ),
            (Column(f"{name}_time_constant", "time constant, inertia/D", "s"), inertia / damping),
            (Column(f"{name}_dead_band", "dead band, friction/K", "%"), friction / gain),
            *(
                (
                    Column(f"{name}_speed", "speed", "deg/s", False, "command [%]", u),
                    np.degrees(torque / damping),
                )
                for u, torque in zip(COMMANDS, torques, strict=True)
            ),
        ]


def oil(bench: Bench, candidates: Candidates) -> Measured:
    """Stage 2: the arm on its oil with the valve shut, and the ratio of areas.

    The oil is a spring of stiffness r² β (A_A²/V_A + A_B²/V_B) at the joint. Leakage and the seals' friction
    are left out of the damping.
    """
    c, arm = actuator(bench, candidates)
    if c.kind[0] == LINEAR:
        travel = rod_motion(np.full(len(c), bench.angle), c)[0]
        volumes = volume(travel, c.a.area, c.dead_volume), volume(c.stroke - travel, c.b.area, c.dead_volume)
    else:
        volumes = c.dead_volume, c.dead_volume
    stiffness = arm**2 * c.bulk_modulus * (c.a.area**2 / volumes[0] + c.b.area**2 / volumes[1])
    inertia = bench.weigh(candidates, np.array([bench.angle]))[1][:, 0]
    damping = c.damping / (2.0 * np.sqrt(stiffness * inertia))
    name = bench.name
    return [
        (
            Column(f"{name}_natural_frequency", "natural frequency of the arm on the oil", "Hz"),
            np.sqrt(stiffness / inertia) / (2.0 * np.pi),
        ),
        (Column(f"{name}_damping_ratio", "damping ratio of the arm on the oil", ""), damping),
        (Column(f"{name}_area_ratio", "ratio of areas, A/B", ""), c.a.area / c.b.area),
    ]


def actuator(bench: Bench, candidates: Candidates) -> tuple[Records, Array]:
    """Return n candidates' COEFFICIENTS of the joint, (n,), and their moment arm at its angle [m], (n,).

    Of a rotary actuator, whose areas are displacements, the moment arm is 1.
    """
    j = bench.joint - 1
    joints: Records = candidates.joints[:, [j]]  # pyright: ignore[reportAssignmentType]
    c: Records = coefficients(joints, linkages(bench.settings.arm, [j], [j], joints))[:, 0]  # pyright: ignore[reportAssignmentType]
    return c, rod_motion(np.full(len(c), bench.angle), c)[1]
