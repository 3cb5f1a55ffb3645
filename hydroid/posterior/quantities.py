"""All quantities of a fit: what its logs determine, in the words of an engineer."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, record
from hydroid.estimate import (
    CurveEstimate,
    Interval,
    QuantityEstimate,
    finite,
    finite_ends,
)
from hydroid.hydraulics.oil import volumes
from hydroid.hydraulics.records import LINEAR
from hydroid.hydraulics.solenoid import FULL_SCALE, drive, resting_stroke
from hydroid.posterior.bench import (
    ONSET,
    RISEN,
    Bench,
    Direction,
    Movement,
    actuator,
    make_bench,
)
from hydroid.posterior.column import Column, Measured
from hydroid.posterior.curves import StepCurves, opening_curve, step_curves
from hydroid.posterior.linear import Linear, white_posterior
from hydroid.posterior.posterior import Estimated, Posterior
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates

Measure = Callable[[Candidates], Measured]
Quantities = tuple[dict[str, QuantityEstimate], dict[str, CurveEstimate]]
"""what follows from an estimate: single quantities, and curves, by name"""

COMMANDS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
"""of the curve of speed in each direction [%]"""
GAIN_COMMANDS = (-100.0, -75.0, -50.0, -25.0, -10.0, 10.0, 25.0, 50.0, 75.0, 100.0)
"""the same of stage 1, whose directions are alike"""
LEAST_STEP = 50.0
"""command of a step response, if it clearly moves the joint [%]"""
LEAST_OF_GAIN = 40.0
"""command from which on a gain is taken, likewise [%]"""
GAIN_OVER = 20.0
"""how much further it goes [%]"""
LASTS = 3.0
"""how long the step is held in which dead time and time constant are sought [s]"""


class Figure(NamedTuple):
    """A quantity of a direction, (n,), with the command that must move the joint [%].

    `of_several`: whether it compares commands, so that the logs must tell all of them.
    `what`: what the label begins with, before the direction.
    """

    command: float
    name: str
    label: str
    unit: str
    value: Array
    of_several: bool = False
    what: str = ""


def quantities(problem: Problem, uncertainty: Uncertainty) -> Quantities:
    """Return the quantities of every compared joint at a fit's estimate.

    Those that no free parameter changes are left out: the settings give them, not the
    logs.
    """
    scalars = dict[str, QuantityEstimate]()
    curves = dict[str, CurveEstimate]()
    for joint in problem.settings.outputs:
        joint_scalars, joint_curves = _joint_quantities(problem, uncertainty, joint)
        scalars |= joint_scalars
        curves |= joint_curves
    return scalars, curves


def known_columns(
    settings: FitSettings, posterior: Posterior, joint: int, measure: Measure
) -> tuple[list[Column], Estimated]:
    """Return the quantities of one joint, numbered from 1, that a measure gives, and
    what a posterior knows of them."""
    candidates = Bindings(settings).candidates
    columns = [column for column, _ in measure(candidates(posterior.box.at[None]))]

    def values(theta: Array) -> Array:
        return np.stack([value for _, value in measure(candidates(theta))], axis=1)

    parameters = settings.parameters.values()
    concerned = np.array([p.joints is None or joint in p.joints for p in parameters])
    positive = np.array([column.positive for column in columns])
    return columns, posterior.propagate(values, positive, concerned)


def _joint_quantities(
    problem: Problem, uncertainty: Uncertainty, joint: int
) -> Quantities:
    """Return the quantities of one joint, numbered from 1."""
    settings = problem.settings
    estimate = problem.bindings.candidates(uncertainty.theta[None])
    measure = joint_measure(make_bench(settings, problem.logs, joint), estimate)
    columns, estimated = known_columns(settings, uncertainty.posterior, joint, measure)
    shares = _data_shares(uncertainty.linear, estimated)

    joint_name = problem.settings.arm.name_of(joint)
    scalars = dict[str, QuantityEstimate]()
    points = defaultdict[str, list[int]](list)
    for i in np.flatnonzero(np.isfinite(estimated.value)).tolist():
        column = columns[i]
        if column.at is not None:
            points[column.name].append(i)
        elif not estimated.given[i]:
            scalars[f"{joint_name}_{column.name}"] = QuantityEstimate(
                label=column.label,
                joint=joint,
                value=float(estimated.value[i]),
                unit=column.unit,
                sd=finite(estimated.sd[i]),
                interval=finite_ends(estimated.interval[i]),
                reach=column.reach,
                data_share=finite(shares[i]),
            )
    curves = dict[str, CurveEstimate]()
    for name, rows in points.items():
        # a curve of which a parameter changes one point is stated as a whole
        if not estimated.given[rows].all():
            of_points = [columns[i] for i in rows]
            curves[f"{joint_name}_{name}"] = _curve(of_points, estimated, rows, joint)
    return scalars, curves


def _data_shares(linear: Linear, estimated: Estimated) -> Array:
    """Return the part of the information on each quantity that the logs gave, 1 -
    posterior / prior variance, (m,): as `ParameterStatus` has it of a parameter."""
    before = white_posterior(linear.box, linear.prior_slopes)
    with np.errstate(all="ignore"):
        share = 1.0 - (estimated.sd / before.sd(estimated.slopes)) ** 2
    # of a quantity that is not determined, nothing is known from anywhere
    return np.where(np.isfinite(estimated.sd), np.clip(share, 0.0, 1.0), np.nan)


def _curve(
    columns: Sequence[Column], estimated: Estimated, rows: Sequence[int], joint: int
) -> CurveEstimate:
    """Return the curve of a joint whose points, at least one, are `rows` of what is
    estimated."""
    # points come direction by direction; a curve goes on from one to the other
    order = sorted(range(len(rows)), key=lambda i: columns[i].at or 0.0)
    last = columns[-1]
    return CurveEstimate(
        label=last.label,
        joint=joint,
        unit=last.unit,
        along=last.along,
        step=last.step,
        moves=last.moves,
        at=tuple(_rounded(columns[i].at) for i in order),
        value=tuple(_rounded(estimated.value[rows[i]]) for i in order),
        interval=tuple(_rounded_ends(estimated.interval[rows[i]]) for i in order),
    )


def _rounded(value: float | None) -> float:
    """Return a number with six digits.

    Nobody calculates with the points of a curve, and a file holds hundreds.
    """
    return float(f"{value:.6g}")


def _rounded_ends(interval: Array) -> Interval:
    low, high = finite_ends(interval)
    if low is not None:
        low = _rounded(low)
    if high is not None:
        high = _rounded(high)
    return low, high


def joint_measure(bench: Bench, estimate: Candidates) -> Measure:
    """Return what computes the quantities of one joint.

    What is tested is planned at the estimate.
    """
    tests: list[DirectionTest] = []
    further = gain_model
    if bench.settings.stage == "hyd":
        further = oil
        for direction in directions(bench, estimate):
            tests.append(direction_test(bench, estimate, direction))

    def measure(candidates: Candidates) -> Measured:
        loads = bench.loads(candidates) if tests else np.empty((0, 3))
        gravity, inertia = bench.weigh(candidates)
        for test in tests:
            yield from test.measure(candidates, loads)
        yield from further(bench, candidates, inertia)
        word = "torque"
        unit = "N·m"
        if bench.slides:
            word = "force"
            unit = "N"
        label = f"gravity {word} at {bench.pose}"
        yield Column("gravity_torque_at_pose", label, unit, False), gravity

    return measure


def directions(bench: Bench, estimate: Candidates) -> list[Direction]:
    """Return both directions of a joint with the words that gravity gives them, or of
    one that slides its rod."""
    gravity = bench.weigh(estimate)[0][0]
    words = ("lowering", "raising")
    if bench.slides:
        words = ("extending", "retracting")
    elif abs(gravity) < 1.0:
        # below 1 N·m no direction is called raising
        words = ("positive", "negative")
    elif gravity * bench.sense > 0:
        words = ("raising", "lowering")
    return [
        Direction(1.0, "positive", words[0]),
        Direction(-1.0, "negative", words[1]),
    ]


def gain_model(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 1: what the joint does under K u = D q̇ + F_c sign(q̇), before springs and
    gravity's change act.
    """
    joint = candidates.joints[:, bench.joint - 1]
    gain = joint["gain"]
    damping = joint["damping"]
    friction = joint["friction"]
    factor, unit = bench.unit
    with np.errstate(all="ignore"):
        label = "gain between command and speed, K/D"
        yield Column("gain", label, f"{unit}/s per %"), factor * (gain / damping)
        label = "time constant, inertia/D"
        yield Column("time_constant", label, "s"), inertia / damping
        yield Column("dead_band", "dead band, friction/K", "%"), friction / gain
        for command in GAIN_COMMANDS:
            size = np.maximum(gain * abs(command) - friction, 0.0)
            torque = np.sign(command) * size
            column = Column("speed", "speed", f"{unit}/s", False, command)
            yield column, factor * (torque / damping)


def oil(bench: Bench, candidates: Candidates, inertia: Array) -> Measured:
    """Stage 2: the arm on its oil with the valve shut, and the ratio of areas.

    The oil is a spring of stiffness r² β (A_A²/V_A + A_B²/V_B) at the joint. Leakage
    and the seals' friction are left out of the damping.
    """
    c, travel, arm = actuator(bench, candidates)
    if bench.settings.rung.has("bulk_modulus"):
        volume_a = c.dead_volume
        volume_b = c.dead_volume
        if c.kind[0] == LINEAR:
            volume_a, volume_b = volumes(travel, c)
        springs = c.a.area**2 / volume_a + c.b.area**2 / volume_b
        stiffness = arm**2 * c.bulk_modulus * springs
        frequency = np.sqrt(stiffness / inertia) / (2.0 * np.pi)
        critical = 2.0 * np.sqrt(stiffness * inertia)
        damping = c.damping / critical
        label = "natural frequency of the arm on the oil"
        yield Column("natural_frequency", label, "Hz"), frequency
        label = "damping ratio of the arm on the oil"
        yield Column("damping_ratio", label, ""), damping
    yield Column("area_ratio", "ratio of areas, A/B", ""), c.a.area / c.b.area


@record
class DirectionTest:
    """What is measured of a joint in one direction, planned at an estimate.

    Attributes:
        planned: speed at the estimate under each of COMMANDS, above 0 where it goes in
            the direction.
        told: those of COMMANDS whose effect the logs tell.
        step: in which dead time and time constant are sought.
        after_step: the curves of this step.
        opens_later: whether the spool crosses an overlap beyond the dead band.
    """

    bench: Bench
    direction: Direction
    planned: dict[float, float]
    told: list[float]
    step: Movement
    after_step: StepCurves
    opens_later: bool

    @property
    def rise(self) -> float:
        """Size of the command of the step [%]."""
        return abs(self.step.command)

    @property
    def _place(self) -> str:
        """The joint and its pose, in words."""
        names = self.bench.settings.arm.joint_names
        return f"{names[self.bench.joint - 1]} at {self.bench.pose}"

    def measure(self, candidates: Candidates, loads: Array) -> Measured:
        """Measure n candidates with the loads of `Bench.loads`, (n, 3)."""
        bench = self.bench
        commands = self.direction.sign * np.array(COMMANDS)
        steady = bench.steady(candidates, commands, loads)
        unit = f"{bench.unit[1]}/s"
        for command, velocity in zip(commands.tolist(), steady.T, strict=True):
            if abs(command) in self.told:
                label = f"speed at {bench.pose}"
                yield Column("speed", label, unit, False, command), velocity
        towards = self.direction.sign * bench.sense
        speed = dict(zip(COMMANDS, towards * steady.T, strict=True))
        after = self.step.speeds(candidates)
        yield from self._stated(self._steady_figures(speed))
        yield from self._stated(self._step_figures(after, speed[self.rise]))
        yield from self._stated(self._full_flow(candidates, speed[100.0]))
        if self.opens_later:
            label = f"dead band with the spool's overlap, {self.direction.word}"
            column = Column(f"dead_band_{self.direction.ending}", label, "%")
            dead_band, beyond = valve_opens(bench, candidates, self.direction.sign)
            yield column, np.add(dead_band, beyond)
        yield from opening_curve(bench, candidates, self.direction.sign)
        if self.planned[self.rise] != 0.0:
            yield from self.after_step(after)

    def _stated(self, figures: Iterable[Figure]) -> Measured:
        """Return the figures that the logs tell, of commands that move the joint."""
        for figure in figures:
            moved = self.planned[figure.command] != 0.0
            told = figure.command in self.told
            if figure.of_several:
                told = len(self.told) == len(COMMANDS)
            if moved and told:
                name = f"{figure.name}_{self.direction.ending}"
                label = f"{figure.label}, {self.direction.word}"
                if figure.what:
                    label = f"{figure.what} {self.direction.when}: {figure.label}"
                reach = self.bench.beyond(self.direction.sign * figure.command)
                yield Column(name, label, figure.unit, reach=reach), figure.value

    def _steady_figures(self, speed: dict[float, Array]) -> Iterator[Figure]:
        """Return what speeds, by command, say."""
        pose = self.bench.pose
        unit = f"{self.bench.unit[1]}/s"
        for command in (50.0, 100.0):
            label = f"{command:g} % command, {self._place}"
            name = f"speed_{command:g}"
            yield Figure(command, name, label, unit, speed[command], what="speed")
        # below, part of the commands would lie in the dead band
        low = first_moving(self.planned, COMMANDS, LEAST_OF_GAIN)
        high = low + GAIN_OVER
        if high in speed:
            gain = (speed[high] - speed[low]) / GAIN_OVER
            label = (
                f"gain between command and speed from {low:g} to {high:g} % command, "
                f"at {pose}"
            )
            yield Figure(high, "gain", label, f"{unit} per %", gain, of_several=True)

    def _step_figures(self, after: Array, steady: Array) -> Iterator[Figure]:
        """Return what speeds after the step, (n, samples), say beside the steady one,
        (n,)."""
        onset = self.step.reaches(after, ONSET * steady)
        risen = self.step.reaches(after, RISEN * steady)
        at = f"at {self.rise:g} % command"
        yield Figure(self.rise, "dead_time", f"dead time {at}", "s", onset)
        lag = risen - onset
        yield Figure(self.rise, "time_constant", f"time constant {at}", "s", lag)

    def _full_flow(self, candidates: Candidates, speed: Array) -> Iterator[Figure]:
        """Return the flow into the chamber at full command, from the speed there.

        A joint whose speed follows its command alone tells no area.
        """
        if self.bench.settings.ignores("area", self.bench.joint):
            return
        c, _, arm = actuator(self.bench, candidates)
        side = c.a if self.direction.sign > 0 else c.b
        # from m³/s to L/min
        flow = 6e4 * side.area * np.abs(arm) * speed / self.bench.unit[0]
        label = f"100 % command, {self._place}"
        yield Figure(100.0, "full_flow", label, "L/min", flow, what="flow")


def direction_test(
    bench: Bench, estimate: Candidates, direction: Direction
) -> DirectionTest:
    """Return what measures a joint in a direction."""
    commands = direction.sign * np.array(COMMANDS)
    towards = direction.sign * bench.sense
    steady = towards * bench.steady(estimate, commands, bench.loads(estimate))[0]
    planned = dict(zip(COMMANDS, steady, strict=True))
    told = [size for size in COMMANDS if bench.tells(direction.sign * size)]
    step = bench.movement(
        direction.sign * first_moving(planned, told, LEAST_STEP), LASTS
    )
    return DirectionTest(
        bench=bench,
        direction=direction,
        planned=planned,
        told=told,
        step=step,
        after_step=step_curves(step, estimate, direction),
        opens_later=valve_opens(bench, estimate, direction.sign)[1][0] > 0.0,
    )


def first_moving(
    planned: Mapping[float, float], commands: Sequence[float], least: float
) -> float:
    """Return the smallest of some commands, from `least` on, that clearly moves the joint
    [%], or the largest; 100 of none."""
    for size in commands:
        if size >= least and planned[size] > ONSET * planned[100.0]:
            return size
    return commands[-1] if commands else 100.0


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
    span = c.current_max - c.current_min
    with np.errstate(all="ignore"):  # of a coil without force
        current = np.sqrt(c.plunger_stiffness * stroke / c.coil) * (stroke + c.gap)
        voltage = FULL_SCALE * (current - c.current_min) / span
        lifted = (voltage - side.onset) * (100.0 - side.dead_band)
        beyond = lifted / (FULL_SCALE - side.onset)
    return side.dead_band, np.where(voltage > FULL_SCALE, np.nan, beyond)
