"""What is measured of one joint on the test bench: with and without movement."""

from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeAlias

import numpy as np

from hydroid.hydraulics.cylinder import rod_motion, volume
from hydroid.hydraulics.records import LINEAR, Records, coefficients, linkages
from hydroid.parameters import Array
from hydroid.posterior.bench import Bench, movement
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


COMMANDS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
"""of the curve of speed [%]"""
MOVES = 0.02
"""part of the speed at full command, added to that without a command, at which the joint begins to move"""
ONSET, RISEN = 0.1, 1.0 - float(np.exp(-1.0))
"""parts of the final speed: it takes the dead time to reach the first, and from there the time constant to
reach the second"""


def speed_tests(
    bench: Bench, estimate: Candidates, sign: float, ending: str, word: str
) -> Callable[[Candidates], Measured]:
    """Return what measures a joint in one direction, planned so that the estimate ends at its angle.

    Args:
        bench: the joint.
        estimate: one candidate.
        sign: of the commands.
        ending, word: at the end of names and labels.
    """
    steps = {u: movement(bench, sign * u).through_pose(estimate) for u in COMMANDS}
    rest = movement(bench, 0.0)
    reached = {u: step.speed(estimate)[0] for u, step in steps.items()}
    # the smallest command from 50 % that clearly moves the joint, or the largest
    clear = (u for u in COMMANDS if u >= 50.0 and reached[u] > ONSET * reached[100.0])
    rise = next(clear, 100.0)
    # the dead band is enclosed to 0.25 %
    level = MOVES * reached[100.0] + sign * rest.speed(estimate)[0]
    above = next((u for u in COMMANDS if reached[u] > level), 0.0)
    below = max((u for u in COMMANDS if u < above), default=0.0)
    while above - below > 0.25:
        middle = (below + above) / 2
        moves = movement(bench, sign * middle).speed(estimate)[0] > level
        below, above = (below, middle) if moves else (middle, above)

    def measure(candidates: Candidates) -> Measured:
        def row(name: str, label: str, unit: str, value: Array) -> tuple[Column, Array]:
            return Column(name + ending, label + word, unit), value

        per_second = "mm/s" if bench.slides else "deg/s"
        runs = {u: step.speeds(candidates) for u, step in steps.items()}
        speed = {u: steps[u].end(run) for u, run in runs.items()}
        for u, value in speed.items():
            point = Column("speed", "speed", per_second, False, sign * u)
            yield point, sign * bench.sense * value
        for u in (50.0, 100.0):
            yield row(f"speed_{u:.0f}", f"speed at {u:.0f} % command", per_second, speed[u])
        gain = (speed[60.0] - speed[40.0]) / (60.0 - 40.0)
        yield row("gain", "gain between command and speed", f"{per_second} per %", gain)
        onset, risen = (steps[rise].reaches(runs[rise], part * speed[rise]) for part in (ONSET, RISEN))
        yield row("dead_time", f"dead time at {rise:g} % command", "s", onset)
        yield row("time_constant", f"time constant at {rise:g} % command", "s", risen - onset)
        if below > 0.0:
            slow, fast = (movement(bench, sign * u).speed(candidates) for u in (below, above))
            part = (MOVES * speed[100.0] + sign * rest.speed(candidates) - slow) / (fast - slow)
            yield row("dead_band", "dead band", "%", below + part * (above - below))
        c, arm = actuator(bench, candidates)
        flow = (c.a if sign > 0 else c.b).area * np.abs(arm) * np.radians(speed[100.0])
        yield row("full_flow", "flow at 100 % command", "L/min", 6e4 * flow)

    return measure
