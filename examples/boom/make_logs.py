"""Make the logs of the example's boom: one joint, constant duties, up from its stop and
down from above.

    python examples/boom/make_logs.py

NO MACHINE: a virtual boom, and no hydroid model. It is a separate simulation in plain
equations (Radau, rtol 1e-7), and it differs where a machine would: pilot pressure with
a lag instead of solenoids, a polynomial valve curve, another one for each edge, an
engine whose speed lifts flow and pressure together, oil with air, Stribeck friction, a
spring for a stop, and a pendulum for the arm. Its sizes are near those of our shoulder,
all ours. What it shares with the model is the kind of physics.
"""

import sys
from math import cos, exp, inf, radians, sin, sqrt, tanh
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

FITTED, UNSEEN = (40, 60, 100), (50, 80)
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


def slope(raising: float, lowering: float, asked: float, stop: float):
    """Right-hand side for (pilots, engine, pressures of line, A and B, angle, speed).

    Of pilot commands from 0 to 1, the engine's speed that is asked for, and the angle
    of the stop.
    """

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
        if q < stop:
            torque += CONTACT * (stop - q) - (1e4 * w if w < 0 else 0.0)
        volume_a, volume_b = DEAD + AREA_A * x, DEAD + AREA_B * (STROKE - x)
        return [
            (raising - up) / PILOT_LAG[0],
            (lowering - down) / PILOT_LAG[1],
            (asked - engine) / ENGINE_LAG,
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
    load, arm = MASS * 9.81 * CENTRE * cos(start + TILT), geometry(start)[1]
    pilots = (duty / 100, 0.0) if sign > 0 else (0.0, duty / 100)
    if sign > 0:  # on its stop
        pa, pb = TRAPPED
        stop = start + (load - arm * (AREA_A * pa - AREA_B * pb)) / CONTACT
    else:
        pb, stop = 8e5, -inf
        pa = (load / arm + AREA_B * pb) / AREA_A
    z = np.array(
        [0.0, 0.0, IDLE, SUPPLY * (0.5 + 0.5 * IDLE) - 1.0, pa, pb, start, 0.0]
    )
    scale = np.array([1e-7, 1e-7, 1e-7, 10.0, 10.0, 10.0, 1e-9, 1e-8])
    begun, risen = REST + PILOT_DELAY[0 if sign > 0 else 1], REST + ENGINE_DELAY
    phases = (
        (0.0, begun, (0.0, 0.0), IDLE),
        (begun, risen, pilots, IDLE),
        (risen, LENGTH, pilots, 1.0),
    )
    grid, out = np.arange(0.0, LENGTH + PERIOD / 2, PERIOD), []
    for first, last, pilot, asked in phases:
        times = grid[len(out) : np.searchsorted(grid, last + 1e-12)]
        how: dict[str, Any] = {
            "t_eval": np.minimum(times, last),
            "atol": scale,
            "rtol": 1e-7,
            "max_step": 0.05,
        }
        solved = solve_ivp(slope(*pilot, asked, stop), (first, last), z, "Radau", **how)
        z, out = solved.y[:, -1], [*out, *solved.y[6]]
    return np.array(out)


def main(folder: Path) -> None:
    """Write one CSV per duty and direction."""
    rng = np.random.default_rng(0)
    for way, (_, sign) in STAGES.items():
        for duty in (*FITTED, *UNSEEN):
            angle = np.degrees(boom(duty, way)) + rng.normal(
                0, NOISE_DEG, round(5.0 / PERIOD) + 1
            )
            time = PERIOD * np.arange(len(angle))
            command = np.where(time >= REST - 1e-9, sign * duty, 0.0)
            kind = "fit" if duty in FITTED else "check"
            rows, header = (
                np.column_stack([time, command, angle]),
                "time [s],duty [%],angle [deg]",
            )
            path = folder / f"{kind}_{way}_{duty}.csv"
            np.savetxt(
                path, rows, fmt="%.5g", delimiter=",", header=header, comments=""
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
