"""Duties that a fit has not seen: a virtual boom with a pump that comes up, trapped oil and an unlike valve.

The boom is no hydroid model. It is a separate simulation in plain equations (Radau, rtol 1e-7), and it
differs where a machine would: pilot pressure with a lag instead of solenoids, a polynomial valve curve,
another one for each edge, an engine whose speed lifts flow and pressure together, oil with air, Stribeck
friction, a spring for a stop, and a pendulum for the arm. Its sizes are near those of our shoulder, all ours.
What it shares with the model is the kind of physics: so this shows that the terms are the right ones for such
a machine, not that a real machine is one.

It is logged at constant duties of 40, 60 and 100 %, up from its stop and down from above, and predicted at
50, 70, 80 and 90 %.

    python benchmarks/virtual_boom.py [--seeds 3]
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import cos, exp, radians, sin, sqrt, tanh

import numpy as np
from common import Clock, options
from scipy.integrate import Radau

import hydroid
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

FITTED, UNSEEN = (40, 60, 100), (50, 70, 80, 90)
PERIOD, REST, LENGTH, NOISE_DEG = 0.01, 0.5, 5.0, 0.02
STAGES = {"up": (-30.0, 1.0), "down": (60.0, -1.0)}
"""angle at the start [deg] and sign of the command"""

# the pendulum, and its cylinder: pivots [m], their angle [rad], lengths [m], areas [m²]
INERTIA, DAMPING, MASS, CENTRE, TILT = 24.8, 210.0, 46.0, 0.59, radians(-13.0)
A, B, THETA0 = 0.30, 0.08, radians(70.0)
SHORTEST, STROKE = sqrt(A * A + B * B - 2 * A * B * cos(radians(40.0))), 0.135
AREA_A, AREA_B, DEAD = 1.0e-3, 0.75e-3, 60e-6
ORIFICE, SUPPLY, TANK, DROOP = 0.7 * sqrt(2 / 860), 160e5, 4e5, 45e5
EDGES = {"PA": 0.50e-6, "BT": 0.32e-6, "PB": 0.22e-6, "AT": 0.30e-6}
CHECK, LEAK, LINE, PUMP = 2e-6, 1.5e-10, 150e-6, 2.4e-3 / 60
IDLE, ENGINE_DELAY, ENGINE_LAG = 0.42, 1.6, 0.15
PILOT_DELAY, PILOT_LAG = (0.11, 0.06), (0.14, 0.05)
CONTACT, TRAPPED = 2e6, (6e5, 4e5)


@dataclass(frozen=True)
class Drive:
    """Pilot commands (0 to 1) of raising and lowering, and whether the engine has been asked to come up."""

    raising: float
    lowering: float
    engine: bool


def geometry(q: float) -> tuple[float, float]:
    """Travel [m] and moment arm [m] of the cylinder."""
    length = sqrt(A * A + B * B - 2 * A * B * cos(q + THETA0))
    return length - SHORTEST, A * B * sin(q + THETA0) / length


def orifice(area: float, drop: float) -> float:
    """Flow [m³/s]: turbulent, laminar below 0.5 bar."""
    return ORIFICE * area * drop / sqrt(abs(drop) + 0.5e5)


def bulk(pressure: float) -> float:
    """Stiffness of oil with a little air [Pa]."""
    return 8e8 * (max(pressure, 0.0) + 2e5) / (max(pressure, 0.0) + 9e5)


def slope(drive: Drive, stop: float | None):
    """Right-hand side for (pilots, engine, pressures of line, A and B, angle, speed)."""

    def f(_: float, z: np.ndarray) -> list[float]:
        up, down, engine, line, pa, pb, q, w = z
        x, r = geometry(q)
        s = min(max((up - 0.28) / 0.72, 0.0), 1.0)
        raised = 0.2 * s + 0.8 * s * s
        s = min(max((down - 0.22) / 0.78, 0.0), 1.0)
        lowered = 0.7 * s + 0.3 * s**3
        to_a = max(orifice(LEAK + EDGES["PA"] * raised, line - pa), 0.0)
        to_b = max(orifice(LEAK + EDGES["PB"] * lowered, line - pb), 0.0)
        check_a, check_b = (CHECK if p < TANK else 0.0 for p in (pa, pb))
        qa = to_a - orifice(LEAK + EDGES["AT"] * lowered + check_a, pa - TANK)
        qb = to_b - orifice(LEAK + EDGES["BT"] * raised + check_b, pb - TANK)
        # the engine lifts both what the pump gives and up to which pressure
        most = SUPPLY * (0.5 + 0.5 * engine)
        given = PUMP * engine * min(max((most - line) / DROOP, 0.0), 1.0)
        speed = r * w
        friction = (250 + 120 * exp(-((speed / 0.008) ** 2))) * tanh(speed / 0.0015)
        torque = r * (AREA_A * pa - AREA_B * pb - friction) - DAMPING * w
        torque -= MASS * 9.81 * CENTRE * cos(q + TILT)
        if stop is not None and q < stop:
            torque += CONTACT * (stop - q) - (1e4 * w if w < 0 else 0.0)
        volume_a, volume_b = DEAD + AREA_A * x, DEAD + AREA_B * (STROKE - x)
        return [
            (drive.raising - up) / PILOT_LAG[0],
            (drive.lowering - down) / PILOT_LAG[1],
            ((1.0 if drive.engine else IDLE) - engine) / ENGINE_LAG,
            bulk(line) / LINE * (given - to_a - to_b),
            bulk(pa) / volume_a * (qa - AREA_A * speed),
            bulk(pb) / volume_b * (qb + AREA_B * speed),
            w,
            torque / INERTIA,
        ]

    return f


def boom(duty: float, way: str) -> np.ndarray:
    """Angles [rad] at the samples of one log, (T,)."""
    start, sign = radians(STAGES[way][0]), STAGES[way][1]
    load = MASS * 9.81 * CENTRE * cos(start + TILT)
    arm = geometry(start)[1]
    side = 0 if sign > 0 else 1
    if sign > 0:  # on its stop
        pa, pb = TRAPPED
        stop = start + (load - arm * (AREA_A * pa - AREA_B * pb)) / CONTACT
    else:
        pb, stop = 8e5, None
        pa = (load / arm + AREA_B * pb) / AREA_A
    z = np.array([0.0, 0.0, IDLE, SUPPLY * (0.5 + 0.5 * IDLE) - 1.0, pa, pb, start, 0.0])
    events = [0.0, REST + PILOT_DELAY[side], REST + ENGINE_DELAY, LENGTH]
    grid, out = np.arange(0.0, LENGTH + PERIOD / 2, PERIOD), []
    scale = np.array([1e-7, 1e-7, 1e-7, 10.0, 10.0, 10.0, 1e-9, 1e-8])
    for k, (first, last) in enumerate(pairwise(events)):
        pilot = duty / 100 if k > 0 else 0.0
        drive = Drive(pilot * (sign > 0), pilot * (sign < 0), k == 2)
        solver = Radau(slope(drive, stop), first, z, last, rtol=1e-7, atol=scale, max_step=0.05)  # pyright: ignore[reportArgumentType]
        while solver.status == "running":
            solver.step()
            dense = solver.dense_output()
            while len(out) < len(grid) and grid[len(out)] <= solver.t + 1e-12:
                out.append(float(dense(grid[len(out)])[6]))
        z = solver.y
    return np.array(out)


def log_of(duty: float, way: str, pose: np.ndarray, rng: np.random.Generator) -> Log:
    """One log of the boom as joint 2 of our arm, with sensor noise."""
    angle = boom(duty, way)
    time = PERIOD * np.arange(len(angle), dtype=float)
    command, measured = np.zeros((len(time), len(pose))), np.tile(pose, (len(time), 1))
    command[time >= REST - 1e-9, 1] = STAGES[way][1] * duty
    measured[:, 1] = angle + rng.normal(0, radians(NOISE_DEG), len(angle))
    return Log(f"{way}_{duty:g}", time, command, measured, PERIOD)


COMMON = {
    "opening_a": (0.05, 3.0, 0.4), "opening_b": (0.05, 3.0, 0.4),
    "overlap_a": (0.0, 1.5, 0.3), "overlap_b": (0.0, 1.5, 0.3),
    "dry_friction": (0.0, 2000.0, 100.0), "dead_volume": (10.0, 300.0, 50.0),
}  # fmt: skip
BEFORE = COMMON | {
    "delay": (0.0, 0.5, 0.1), "plunger_damping": (5.0, 2000.0, 100.0),
    "opening_exponent": (0.5, 4.0, 1.5), "flow_limit": (0.2, 20.0, 3.0),
}  # fmt: skip
"""quantities with lowest, highest and start value: one for both directions, no pump, no stop"""
NOW = COMMON | {
    "delay_a": (0.0, 0.5, 0.1), "delay_b": (0.0, 0.5, 0.1),
    "plunger_damping_a": (5.0, 2000.0, 100.0), "plunger_damping_b": (5.0, 2000.0, 100.0),
    "opening_exponent_a": (0.5, 4.0, 1.5), "opening_exponent_b": (0.5, 4.0, 1.5),
    "return_a": (0.1, 10.0, 1.0), "return_b": (0.1, 10.0, 1.0), "trapped_pressure": (0.0, 100.0, 20.0),
    "pump_flow": (0.3, 20.0, 3.0), "pump_droop": (0.0, 120.0, 30.0), "pump_idle": (0.1, 1.0, 0.7),
    "pump_delay": (0.0, 3.0, 1.0), "pump_rise": (0.01, 2.0, 0.3),
}  # fmt: skip


def make_settings(seed: int, rows: Mapping[str, tuple[float, float, float]]) -> FitSettings:
    """Settings of a fit of these quantities; those of the pump have no joints."""
    parameters: dict[str, object] = {
        "S": {"quantity": "stiffness", "fixed": 0.0},
        "D": {"quantity": "damping", "bounds": [20.0, 2000.0], "start": 230.0},
        "M3": {"quantity": "mass", "link": "link3", "bounds": [15.0, 35.0], "start": 22.5},
    }
    for quantity, (low, high, start) in rows.items():
        joints = {} if quantity.startswith("pump_") else {"joints": [2]}
        parameters[quantity] = {"quantity": quantity, "bounds": [low, high], "start": start} | joints
    changes = {
        "parameters": parameters,
        "joint_refinement": False,
        "hydraulics.substeps": 10,
        "hydraulics.anticavitation": 2.0 if "return_a" in rows else 0.0,
        "search.algorithm": "multistart",
        "search.seed": seed,
        # the stated start, and whole logs at once: a boom on its stop says nothing in its first half second
        "search.multistart.starts": 1,
        "search.multistart.horizons": (),
        "objective": {"norm": 2, "segments": {"equal": 1}},
    }
    return hydroid.load_settings("fit-hyd-machine", changes)


def describe(error: Mapping[tuple[str, int], float]) -> str:
    """The mean absolute errors of some logs [deg] in words."""
    values = np.array(list(error.values()))
    each = ", ".join(f"{way} {duty} %: {value:.2f}" for (way, duty), value in error.items())
    return f"median {np.median(values):.2f}, worst {values.max():.2f} deg ({each})"


def study(seed: int, what: str, rows: Mapping[str, tuple[float, float, float]]) -> list[float]:
    """Fit the logs of the fitted duties, print the errors of all, return those of the unseen ones."""
    settings, rng, clock = make_settings(seed, rows), np.random.default_rng(seed), Clock()
    duties, pose = [(way, d) for way in STAGES for d in (*FITTED, *UNSEEN)], settings.arm.pose("study")
    logs = {(way, d): log_of(d, way, pose, rng) for way, d in duties}
    fitted = hydroid.fit(settings, [log for (_, d), log in logs.items() if d in FITTED]).model
    problem = Problem(fitted.settings, list(logs.values()))
    residual = np.degrees(np.abs(problem.residuals(fitted.theta[None])[0]))
    error = {k: float(residual[c.rows].mean()) for k, c in zip(logs, problem.channels, strict=True)}
    known, unseen = ({k: e for k, e in error.items() if k[1] in some} for some in (FITTED, UNSEEN))
    print(f"{what}, seed {seed}: {clock}, fitted: {describe(known)}; unseen: {describe(unseen)}", flush=True)
    return list(unseen.values())


if __name__ == "__main__":
    seeds = options(__doc__, seeds=3).seeds
    for what, rows in (("before", BEFORE), ("now", NOW)):
        errors = [error for seed in range(seeds) for error in study(seed, what, rows)]
        print(f"{what}: unseen median {np.median(errors):.2f}, worst {max(errors):.2f} deg, {seeds} seeds\n")
