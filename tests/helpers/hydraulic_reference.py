"""The shoulder as a pendulum, twice: on MuJoCo under the actuator plugin, and in plain
equations under Radau.

The plain side shares no code with hydroid: it integrates plungers, oil and arm
together, (4) to (9), with rtol 1e-7 or less, restarted at every change of the command.
"""

from dataclasses import fields as fields_of
from itertools import pairwise
from math import cos, inf, log, radians, sin, sqrt

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from observation import Observation, observe as observed
from scipy.integrate import Radau

from hydroid.hydraulics.actuator import at_rest, make_plugin
from hydroid.hydraulics.cylinder import triangle
from hydroid.hydraulics.records import JOINT, JOINT_STATE, LINEAR, ROTARY, Records
from hydroid.mjcf import quiet_mujoco
from hydroid.quantity_table import QUANTITIES, TARGETS
from hydroid.settings.hydraulics import HydraulicSettings, actuator_values
from hydroid.simulation.rollout import Course, SteppedArm, Trace

INERTIA, DAMPING, STIFFNESS, MASS, CENTRE, TILT = (
    23.6,
    231.8,
    53.4,
    45.0,
    0.6,
    radians(-15.0),
)
START, PERIOD, GRAVITY = radians(10.0), 0.01, 9.81
A, B, THETA0, STROKE = 0.30, 0.08, radians(70.0), 0.135
SHORTEST = sqrt(A * A + B * B - 2 * A * B * cos(radians(40.0)))
TRUTH = {"area_a": 1000.0, "area_b": 750.0, "opening_a": 0.4, "opening_b": 0.4}
PIVOTS = {"pivot_distance_1": A, "pivot_distance_2": B, "pivot_angle": 70.0}
TEN = {
    "area_a": 1000.0, "area_b": 750.0, "current_max": 0.9, "current_min": 0.3, "onset_a": 1.4, "onset_b": 1.2,
    "force_1": 8.0, "force_2": 0.7, "stroke_1": 0.8, "stroke_2": 12.0,
}  # fmt: skip


def changed(joints: Records, **values: ArrayLike) -> Records:
    """Joints, (n, V), with some quantities replaced, in drawing units; n may grow from
    1."""
    shape = np.broadcast_shapes(joints.shape, *(np.shape(v) for v in values.values()))
    replaced = np.broadcast_to(joints, shape).copy().view(np.recarray)
    for name, value in values.items():
        for target in TARGETS[name]:
            replaced[target] = np.asarray(value) * QUANTITIES[target].factor
    return replaced


def parameters(settings: HydraulicSettings, **values: ArrayLike) -> Records:
    """The shoulder alone, once a candidate; `values` in drawing units, scalars or
    (n,)."""
    stated = {
        k: inf if v is None else v
        for k, v in actuator_values(None, settings).items()
        if k != "mass"
    }
    one = changed(
        np.zeros((1, 1), JOINT).view(np.recarray),
        **stated | TRUTH | PIVOTS | {"damping": DAMPING},
    )
    one.kind, one.half, one.sense, one.retracted, one.stroke = (
        LINEAR,
        1.0,
        1.0,
        radians(-30.0),
        STROKE,
    )
    return changed(
        one, **{k: np.reshape(np.asarray(v), (-1, 1)) for k, v in values.items()}
    )


def rotary(joints: Records) -> Records:
    turned = joints.copy()
    turned.kind, turned.middle, turned.half = ROTARY, 0.0, 1.0
    return turned


def draw(rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """Feasible sets from the whole search space, 0.25 to 2.5 times the article's ten,
    (count,) each."""
    rows: list[np.ndarray] = []
    while len(rows) < count:
        row = np.array(list(TEN.values())) * rng.uniform(0.25, 2.5, len(TEN))
        f1, f2, x1, x2 = row[6:]
        if f1 > f2 and x2 > x1 and f1 / f2 < (x2 / x1) ** 2:
            rows.append(row)
    return dict(zip(TEN, np.array(rows).T, strict=True))


def pulses(rng: np.random.Generator, samples: int) -> np.ndarray:
    """Pseudo-random commands [%], (samples,): pulses of random size and length, a third
    of them rests."""
    command = np.zeros(samples)
    at = 0
    while at < samples:
        length = int(rng.integers(20, 120))
        command[at : at + length] = rng.choice(
            [-1.0, 1.0, 0.0], p=[0.35, 0.35, 0.3]
        ) * rng.uniform(20, 100)
        at += length
    return command


def pendulum() -> mujoco.MjModel:
    """The shoulder with all that hangs on it, as one rigid body without joint
    limits."""
    own = INERTIA - MASS * CENTRE**2
    at = f"{CENTRE * cos(TILT)} 0 {CENTRE * sin(TILT)}"
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{PERIOD}" gravity="0 0 -{GRAVITY}"/><worldbody><body>
        <joint axis="0 -1 0" stiffness="{STIFFNESS}" springref="{np.degrees(START)}"/>
        <inertial pos="{at}" mass="{MASS}" diaginertia="{own} {own} {own}"/></body></worldbody></mujoco>"""
    )


def wheel(inertia: float) -> mujoco.MjModel:
    """An inertia [kg·m²] that nothing but its actuator moves.

    It is turned, lest MuJoCo take the short cut for aligned inertias, which ignores a
    changed armature.
    """
    tensor = f"{inertia} {inertia} {inertia}"
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{PERIOD}" gravity="0 0 0"/><worldbody><body><joint/>
        <inertial pos="0 0 0" quat="4 1 2 3" mass="1" diaginertia="{tensor}"/></body></worldbody></mujoco>"""
    )


def simulate(
    p, command, settings, steps=1, observe=None, start=START, model=None, velocity=0.0
):
    """Angles [rad], (n, T + 1), of one joint under commands (T,), with `steps` MuJoCo
    steps a sample.

    It is the pendulum on its cylinder, or another. `observe` receives of each candidate
    an Observation, shapes (T, 1), and the velocities [rad/s], (T, 1), after its samples.
    """
    model, n, samples = pendulum() if model is None else model, len(p), len(command)
    model.opt.timestep = PERIOD / steps
    entries = np.zeros((1, 1), np.intp)
    plugin = make_plugin(p, entries, model.opt.timestep, settings.substeps)
    arm, pose = SteppedArm(model, np.zeros(1, np.intp), steps=steps), np.array([start])
    angle, states = (
        np.full((n, samples + 1, 1), start),
        np.zeros((n, samples, 1), JOINT_STATE),
    )
    with quiet_mujoco():
        balance = np.tile(arm.start({}, [0], pose), (n, 1))
        state = at_rest(plugin, np.full((n, 1), start), balance)
        for i in range(n):
            arm.start({}, [0], pose)
            arm.data.qvel[:] = velocity
            one = plugin.candidate(i)
            held = np.concatenate([np.zeros(one.past), np.repeat(command, steps)])[
                :, None
            ]
            course = Course(held, np.empty((samples * steps, 0)))
            arm.roll(one, state[i], course, Trace(angle[i, 1:], states[i]))
    if observe is not None:
        for i in range(n):
            seen = observed(plugin.candidate(i).coefficients, states[i], angle[i, 1:])
            observe.append((seen, states[i]["velocity"]))
    return angle[:, :, 0]


def watched(p: Records, command: np.ndarray, settings: HydraulicSettings, **how):
    """The first candidate of `simulate`: angles [rad], (T + 1,), and after each sample
    what it did."""
    seen: list = []
    angle = simulate(p, command, settings, observe=seen, **how)[0]
    first, velocity = seen[0]
    fields = {f.name: getattr(first, f.name)[:, 0] for f in fields_of(Observation)}
    return angle, Observation(**fields), velocity[:, 0]


def valve_curve(share: float, exponent: float, factors: list[float]) -> float:
    """Part of the full opening at a part of the travel: increments of a power law, each
    times its factor."""
    ends = [0.0, 0.04, 0.15, 0.4, 0.7, 1.0]

    def height(end: float) -> float:
        steps = [
            min(high, end) ** exponent - min(low, end) ** exponent
            for low, high in pairwise(ends)
        ]
        return sum(factor * step for factor, step in zip(factors, steps, strict=True))

    return height(share) / height(1.0)


def cylinder(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rod's way [m] and its moment arm [m]."""
    return triangle(angle, A, B, THETA0, SHORTEST)[:2]


def reference(
    p: Records, command: np.ndarray, rtol: float = 1e-7
) -> tuple[np.ndarray, np.ndarray]:
    """One candidate in plain equations: angles [rad], (T + 1,), and chamber pressures
    [Pa], (T + 1, 2)."""
    v = {name: float(p[name][0, 0]) for name in JOINT.names or ()}
    ratio = sqrt(v["force_1"] / v["force_2"])
    gap = (v["stroke_2"] - ratio * v["stroke_1"]) / (ratio - 1)
    coil = v["force_1"] * (v["stroke_1"] + gap) ** 2 / v["rated_current"] ** 2
    beta, gain = v["bulk_modulus"], v["flow_coefficient"] * sqrt(2 / 860)
    shortest, pump = SHORTEST, v["pump_flow"]
    backflow = -inf if pump == inf else 0.0

    def geometry(q: float) -> tuple[float, float]:
        length = sqrt(A * A + B * B - 2 * A * B * cos(q + THETA0))
        return length - shortest, A * B * sin(q + THETA0) / length

    def volumes(x: float) -> tuple[float, float]:
        dead = v["dead_volume"]
        return max(dead + v["area_a"] * x, 0.1 * dead), max(
            dead + v["area_b"] * (STROKE - x), 0.1 * dead
        )

    def flow(area: float, drop: float) -> float:
        return gain * area * drop / (drop**2 + v["transition_pressure"] ** 2) ** 0.25

    def current(voltage: float) -> float:
        return v["current_min"] + min(voltage, 10.0) / 10.0 * (
            v["current_max"] - v["current_min"]
        )

    def pressures(z: np.ndarray, x: float) -> tuple[float, float]:
        va, vb = volumes(x)
        return max(beta * (z[4] - log(va)), 0.0), max(beta * (z[5] - log(vb)), 0.0)

    def slope(drive_a: float, drive_b: float):
        pt, m = v["tank_pressure"], v["plunger_mass"]

        def f(_: float, z: np.ndarray) -> list[float]:
            xa, ua, xb, ub, _, _, q, w, line = z
            ps = beta * line if pump < inf else v["supply_pressure"]
            x, r = geometry(q)
            va, vb = volumes(x)
            pa, pb = pressures(z, x)
            spool = xa - xb
            side = "a" if spool > 0 else "b"
            share = min(
                max(abs(spool) - v[f"overlap_{side}"], 0) / v[f"slot_width_{side}"], 1
            )
            exponent = v[f"opening_exponent_{side}"]
            factors = [v[f"curve_{k}_{side}"] for k in (1, 2, 3, 4)]
            area = v[f"opening_{side}"] * valve_curve(share, exponent, [*factors, 1.0])
            ahead, back = (area, 0.0) if spool > 0 else (0.0, area)
            in_a, in_b = (
                max(flow(v["leakage"] + a, ps - p), backflow)
                for a, p in ((ahead, pa), (back, pb))
            )
            fill_a, fill_b = (v["anticavitation"] if p < pt else 0.0 for p in (pa, pb))
            qa = in_a - flow(v["leakage"] + back * v["return_a"] + fill_a, pa - pt)
            qb = in_b - flow(v["leakage"] + ahead * v["return_b"] + fill_b, pb - pt)
            rise = 0.0
            if pump < inf:
                left = v["supply_pressure"] - ps
                given = (
                    pump
                    * min(1.0, max(left, 0.0) / v["pump_droop"])
                    ** (1.0 / v["pump_exponent"])
                    if v["pump_droop"] > 0
                    else pump
                )
                relieved = pump * max(-left, 0.0) / 1e3  # all of it at 0.01 bar above
                if left > v["pump_limit"]:
                    # whatever is taken at 0.01 bar below
                    given += 10 * pump * (left - v["pump_limit"]) / 1e3
                closed = min((ahead + back) / v[f"opening_{side}"], 1.0)
                full = max(ps, 0.0) / v["supply_pressure"]
                given -= v["pump_bypass"] * pump * (1.0 - closed) * sqrt(full)
                rise = (given - relieved - in_a - in_b) / v["line_volume"]
            speed = r * w
            force = v["area_a"] * pa - v["area_b"] * pb
            if x > STROKE and speed > 0:
                force -= v["stop_penetration"] * (x - STROKE) * speed
            if x < 0 and speed < 0:
                force -= v["stop_penetration"] * -x * speed
            force -= v["dry_friction"] * speed / sqrt(speed**2 + 1e-6)
            weight = MASS * GRAVITY * CENTRE * cos(q + TILT)
            turn = (
                r * force - weight - DAMPING * w - STIFFNESS * (q - START)
            ) / INERTIA
            push_a = (
                drive_a / (xa + gap) ** 2
                - v["plunger_damping_a"] * ua
                - v["plunger_stiffness"] * xa
            )
            push_b = (
                drive_b / (xb + gap) ** 2
                - v["plunger_damping_b"] * ub
                - v["plunger_stiffness"] * xb
            )
            return [ua, push_a / m, ub, push_b / m, qa / va, qb / vb, w, turn, rise]

        return f

    x0, r0 = geometry(START)
    force = MASS * GRAVITY * CENTRE * cos(START + TILT) / r0
    low = max(
        v["tank_pressure"], (v["area_a"] * v["tank_pressure"] - force) / v["area_b"]
    )
    high = min(
        v["supply_pressure"], (v["area_a"] * v["supply_pressure"] - force) / v["area_b"]
    )
    pb = max(low, min(high, 50e5))
    pa = (force + v["area_b"] * pb) / v["area_a"]
    at_rest = np.roots(
        [1, 2 * gap, gap**2, -coil * v["current_min"] ** 2 / v["plunger_stiffness"]]
    )
    rest = float(max(at_rest[abs(at_rest.imag) < 1e-9].real))
    va, vb = volumes(x0)
    oil = [pa / beta + log(va), pb / beta + log(vb)]
    z = np.array([rest, 0, rest, 0, *oil, START, 0.0, v["supply_pressure"] / beta])
    atol = np.array([1e-11, 1e-9, 1e-11, 1e-9, 1e-11, 1e-11, 1e-10, 1e-9, 1e-11])
    states = np.empty((len(command) + 1, 9))
    states[0] = z
    edges = [0, *(np.flatnonzero(np.diff(command)) + 1), len(command)]
    for first, last in pairwise(edges):
        u = float(command[first])
        ia = current(v["onset_a"] + u * (10.0 - v["onset_a"]) / 100 if u > 0 else 0.0)
        ib = current(v["onset_b"] - u * (10.0 - v["onset_b"]) / 100 if u < 0 else 0.0)
        motion, end = slope(coil * ia**2, coil * ib**2), (last - first) * PERIOD
        solver = Radau(motion, 0.0, states[first], end, rtol=rtol, atol=atol)
        wanted = 1
        while solver.status == "running":
            solver.step()
            dense = solver.dense_output()
            while first + wanted <= last and wanted * PERIOD <= solver.t + 1e-12:
                states[first + wanted] = dense(wanted * PERIOD)
                wanted += 1
        assert solver.status == "finished"
        assert wanted == last - first + 1
    assert states[:, [0, 2]].min() >= 0
    both = np.array([pressures(s, geometry(s[6])[0]) for s in states])
    return states[:, 6], both
