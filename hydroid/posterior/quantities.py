"""All quantities of a fit: what its logs determine, in the words of an engineer."""

from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import (
    CurveEstimate,
    Interval,
    QuantityEstimate,
    finite,
    finite_ends,
)
from hydroid.hydraulics.oil import volume
from hydroid.hydraulics.records import LINEAR
from hydroid.hydraulics.solenoid import FULL_SCALE, drive, resting_stroke
from hydroid.posterior.bench import ONSET, RISEN, Bench, actuator, make_bench
from hydroid.posterior.column import Column, Measured
from hydroid.posterior.curves import opening_curve, step_curves
from hydroid.posterior.posterior import Known
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.simulation import Candidates

Measure = Callable[[Candidates], Measured]
Test = Callable[[Candidates, Array], Measured]
"""measures n candidates with the loads of `Bench.loads`"""


Quantities = tuple[dict[str, QuantityEstimate], dict[str, CurveEstimate]]
"""what follows from an estimate: single quantities, and curves, by name"""


def quantities(problem: Problem, uncertainty: Uncertainty) -> Quantities:
    """Return the quantities of every compared joint at a fit's estimate.

    Those that no free parameter changes are left out: the settings give them, not the
    logs.
    """
    scalars = dict[str, QuantityEstimate]()
    curves = dict[str, CurveEstimate]()
    for joint in problem.settings.outputs:
        of_joint = _joint_quantities(problem, uncertainty, joint)
        scalars |= of_joint[0]
        curves |= of_joint[1]
    return scalars, curves


def _joint_quantities(
    problem: Problem, uncertainty: Uncertainty, joint: int
) -> Quantities:
    """Return the quantities of one joint, numbered from 1."""
    candidates = problem.bindings.candidates
    estimate = candidates(uncertainty.theta[None])
    measure = joint_measure(make_bench(problem.settings, problem.logs, joint), estimate)
    columns = [column for column, _ in measure(estimate)]

    def values(theta: Array) -> Array:
        return np.stack([value for _, value in measure(candidates(theta))], axis=1)

    parameters = problem.settings.parameters.values()
    concerned = np.array([p.joints is None or joint in p.joints for p in parameters])
    positive = np.array([column.positive for column in columns])
    known = uncertainty.posterior.propagate(values, positive, concerned)

    named = problem.settings.arm.joint_names[joint - 1]
    scalars = dict[str, QuantityEstimate]()
    points = defaultdict[str, list[int]](list)
    for i in np.flatnonzero(np.isfinite(known.value)).tolist():
        column = columns[i]
        if column.at is not None:
            points[column.name].append(i)
        elif not known.given[i]:
            scalars[f"{named}_{column.name}"] = QuantityEstimate(
                label=column.label,
                joint=joint,
                value=float(known.value[i]),
                unit=column.unit,
                sd=finite(known.sd[i]),
                interval=finite_ends(known.interval[i]),
            )
    curves = dict[str, CurveEstimate]()
    for name, of_curve in points.items():
        if not known.given[of_curve].all():
            curves[f"{named}_{name}"] = _curve(
                [columns[i] for i in of_curve], known, of_curve, joint
            )
    return scalars, curves


def _curve(
    columns: Sequence[Column], known: Known, rows: Sequence[int], joint: int
) -> CurveEstimate:
    """Return the curve of a joint whose points, at least one, are `rows` of what is
    known."""
    order = sorted(range(len(rows)), key=lambda i: columns[i].at or 0.0)
    last = columns[-1]
    return CurveEstimate(
        label=last.label,
        joint=joint,
        unit=last.unit,
        along=last.along,
        at=tuple(_rounded(columns[i].at) for i in order),
        value=tuple(_rounded(known.value[rows[i]]) for i in order),
        interval=tuple(_rounded_ends(known.interval[rows[i]]) for i in order),
    )


def _rounded(value: float | None) -> float:
    """Six digits: nobody calculates with the points of a curve, and a file holds
    hundreds."""
    return float(f"{value:.6g}")


def _rounded_ends(interval: Array) -> Interval:
    low, high = finite_ends(interval)
    return None if low is None else _rounded(low), None if high is None else _rounded(
        high
    )


def joint_measure(bench: Bench, estimate: Candidates) -> Measure:
    """Return what computes the quantities of one joint.

    What is tested is planned at the estimate.
    """
    tests, further = list[Test](), gain_model
    if bench.settings.stage == "hyd":
        torque, signs = bench.weigh(estimate)[0][0], ("positive", "negative")
        words = (
            ("raising", "lowering")
            if torque * bench.sense > 0
            else ("lowering", "raising")
        )
        # below 1 N·m no direction is called raising
        words = words if abs(torque) >= 1.0 else signs
        names = zip((1.0, -1.0), signs, words, strict=True)
        tests, further = [direction_test(bench, estimate, *name) for name in names], oil

    def measure(candidates: Candidates) -> Measured:
        loads = bench.loads(candidates) if tests else np.empty((0, 3))
        torque, inertia = bench.weigh(candidates)
        word, of = ("force", "N") if bench.unit[1] == "mm" else ("torque", "N·m")
        for test in tests:
            yield from test(candidates, loads)
        yield from further(bench, candidates, inertia)
        yield (
            Column(
                "gravity_torque_at_pose", f"gravity {word} at {bench.pose}", of, False
            ),
            torque,
        )

    return measure


def gain_model(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 1: what the joint does under K u = D q̇ + F_c sign(q̇), before springs and
    gravity's change act.
    """
    joint = candidates.joints[:, bench.joint - 1]
    gain, damping, friction = joint["gain"], joint["damping"], joint["friction"]
    factor, unit = bench.unit
    with np.errstate(all="ignore"):
        ratio = factor * (gain / damping)
        yield (
            Column("gain", "gain between command and speed, K/D", f"{unit}/s per %"),
            ratio,
        )
        yield (
            Column("time_constant", "time constant, inertia/D", "s"),
            inertia / damping,
        )
        yield Column("dead_band", "dead band, friction/K", "%"), friction / gain
        for u in (-100.0, -75.0, -50.0, -25.0, -10.0, 10.0, 25.0, 50.0, 75.0, 100.0):
            torque = np.sign(u) * np.maximum(gain * abs(u) - friction, 0.0)
            yield (
                Column("speed", "speed", f"{unit}/s", False, u),
                factor * (torque / damping),
            )


def oil(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 2: the arm on its oil with the valve shut, and the ratio of areas.

    The oil is a spring of stiffness r² β (A_A²/V_A + A_B²/V_B) at the joint. Leakage
    and the seals' friction are left out of the damping.
    """
    c, travel, arm = actuator(bench, candidates)
    volumes = c.dead_volume, c.dead_volume
    if c.kind[0] == LINEAR:
        volumes = (
            volume(travel, c.a.area, c.dead_volume),
            volume(c.stroke - travel, c.b.area, c.dead_volume),
        )
    stiffness = (
        arm**2 * c.bulk_modulus * (c.a.area**2 / volumes[0] + c.b.area**2 / volumes[1])
    )
    frequency = np.sqrt(stiffness / inertia) / (2.0 * np.pi)
    damping = c.damping / (2.0 * np.sqrt(stiffness * inertia))
    if not bench.settings.quasi_static:  # it knows of neither oil nor inertia
        yield (
            Column(
                "natural_frequency", "natural frequency of the arm on the oil", "Hz"
            ),
            frequency,
        )
        yield (
            Column("damping_ratio", "damping ratio of the arm on the oil", ""),
            damping,
        )
    yield Column("area_ratio", "ratio of areas, A/B", ""), c.a.area / c.b.area


# of the curve of speed [%]
COMMANDS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
# how long the step is held in which dead time and time constant are sought [s]
LASTS = 3.0


def direction_test(
    bench: Bench, estimate: Candidates, sign: float, ending: str, word: str
) -> Test:
    """Return what measures a joint in a direction.

    `sign` is that of the commands; `ending` and `word` stand at the end of names and
    labels.
    """
    commands, (factor, unit) = sign * np.array(COMMANDS), bench.unit
    towards = sign * bench.sense
    planned = dict(
        zip(
            COMMANDS,
            towards * bench.steady(estimate, commands, bench.loads(estimate))[0],
            strict=True,
        )
    )
    told = [u for u in COMMANDS if bench.tells(sign * u)]
    # the smallest command from 50 % that clearly moves the joint, or the largest
    clear = (u for u in told if u >= 50.0 and planned[u] > ONSET * planned[100.0])
    rise = next(clear, told[-1] if told else 100.0)
    step = bench.movement(sign * rise, LASTS)
    after_step = step_curves(step, estimate, ending, word)
    opens_later = valve_opens(bench, estimate, sign)[1][0] > 0.0

    def measure(candidates: Candidates, loads: Array) -> Measured:
        steady = bench.steady(candidates, commands, loads)
        for u, velocity in zip(commands.tolist(), steady.T, strict=True):
            if abs(u) in told:
                yield (
                    Column("speed", f"speed at {bench.pose}", f"{unit}/s", False, u),
                    velocity,
                )
        speed = dict(zip(COMMANDS, towards * steady.T, strict=True))
        gain = (speed[60.0] - speed[40.0]) / (60.0 - 40.0)
        run = step.speeds(candidates)
        onset, risen = (
            step.reaches(run, part * speed[rise]) for part in (ONSET, RISEN)
        )
        c, _, arm = actuator(bench, candidates)
        flow = (
            6e4 * (c.a if sign > 0 else c.b).area * np.abs(arm) * speed[100.0] / factor
        )
        pose = bench.pose
        rows = [  # each with the command that must move the joint
            (
                50.0,
                "speed_50",
                f"speed at 50 % command and {pose}",
                f"{unit}/s",
                speed[50.0],
            ),
            (
                100.0,
                "speed_100",
                f"speed at 100 % command and {pose}",
                f"{unit}/s",
                speed[100.0],
            ),
            (
                60.0,
                "gain",
                f"gain between command and speed at {pose}",
                f"{unit}/s per %",
                gain,
            ),
            (rise, "dead_time", f"dead time at {rise:g} % command", "s", onset),
            (
                rise,
                "time_constant",
                f"time constant at {rise:g} % command",
                "s",
                risen - onset,
            ),
            (100.0, "full_flow", f"flow at 100 % command and {pose}", "L/min", flow),
        ]
        for u, name, label, own_unit, value in rows:
            of_several = name == "gain" and len(told) < len(COMMANDS)
            if planned[u] != 0.0 and u in told and not of_several:
                yield Column(f"{name}_{ending}", f"{label}, {word}", own_unit), value
        if opens_later:
            band = np.add(*valve_opens(bench, candidates, sign))
            yield (
                Column(
                    f"dead_band_{ending}",
                    f"dead band with the spool's overlap, {word}",
                    "%",
                ),
                band,
            )
        yield from opening_curve(bench, candidates, sign)
        if planned[rise] != 0.0:
            yield from after_step(run)

    return measure


def valve_opens(
    bench: Bench, candidates: Candidates, sign: float
) -> tuple[Array, Array]:
    """Return the parameter `dead_band` of a direction [%], and how much further its
    valve opens, (n,) each.

    The pilot stage passes nothing up to the first. From there on the spool crosses its
    overlap, unless the voltage at the smallest command has done it: then the second is
    not above 0.
    """
    c, *_ = actuator(bench, candidates)
    side = c.a if sign > 0 else c.b
    idle = resting_stroke(drive(0.0, c), c.gap, c.plunger_stiffness)
    stroke = idle + side.overlap
    with np.errstate(all="ignore"):  # of a coil without force
        current = np.sqrt(c.plunger_stiffness * stroke / c.coil) * (stroke + c.gap)
        voltage = (
            FULL_SCALE * (current - c.current_min) / (c.current_max - c.current_min)
        )
        beyond = (
            (voltage - side.onset)
            * (100.0 - side.dead_band)
            / (FULL_SCALE - side.onset)
        )
    return side.dead_band, np.where(voltage > FULL_SCALE, np.nan, beyond)
