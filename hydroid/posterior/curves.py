"""Curves of a joint, point by point: its valve's opening, its answer to a step, its
frequency response.

The frequency response is that of the step: the Fourier transform of the derivative of
the speed, over the command. A linear joint has no other. That of a hydraulic one
depends on the size of the command, which the curve's label says. It is taken from the
start of the step alone: further on the joint has left its pose.
"""

from collections.abc import Callable

import numpy as np

from hydroid.arrays import Array
from hydroid.hydraulics.joint import open_share
from hydroid.hydraulics.solenoid import drive, resting_stroke, side_voltage
from hydroid.posterior.bench import ONSET, RISEN, Bench, Direction, Movement, actuator
from hydroid.posterior.column import Column, Measured
from hydroid.simulation import Candidates

OPENING_COMMANDS = tuple(range(5, 101, 5))
"""at which a valve's opening is stated [%]"""
START_POINTS = 40
"""of a step response in its start, where a joint may ring"""
REST_POINTS = 15
"""the same after its start"""
FREQUENCY_POINTS = 24
LEAST_PERIODS = 4.0
"""samples in a period of the highest frequency"""
DENSE = 400
"""frequencies between which a phase is followed: a late joint turns it by several
circles"""
MARGIN = 0.02
"""part of a joint's range before its ends where a step response stops to be one"""
LEAST_START = 1.0
"""how long the start of a step lasts at least [s]"""
TIME_CONSTANTS = 5.0
"""the same in time constants after the dead time"""
LOWEST = 0.2
"""the lowest frequency [Hz]: below it the speed follows the command"""

StepCurves = Callable[[Array], Measured]
"""curves from the speeds of n candidates after a step, shape (n, samples)"""


def opening_curve(bench: Bench, candidates: Candidates, sign: float) -> Measured:
    """Return the opening of the pump edge against commands of a sign that are held
    [mm²], without leakage.

    Commands that are on or off in the logs tell of no others.
    """
    c, *_ = actuator(bench, candidates)
    side = c.a if sign > 0 else c.b
    idle = resting_stroke(drive(0.0, c), c.gap, c.plunger_stiffness)
    for command in OPENING_COMMANDS:
        if not bench.tells(sign * command):
            continue
        beyond = np.maximum(command - side.dead_band, 0.0)
        passed = np.where(beyond > 0.0, 1.0, 0.0)
        voltage = side_voltage(beyond, passed, side.onset, side.dead_band)
        travel = resting_stroke(drive(voltage, c), c.gap, c.plunger_stiffness) - idle
        # the law of the compiled loops, candidate by candidate: it branches
        share = np.empty(len(travel))
        for i, (valve, way) in enumerate(zip(side, travel, strict=True)):
            share[i] = open_share(valve, float(way))
        label = "opening of the valve"
        column = Column("opening", label, "mm²", False, sign * command)
        yield column, 1e6 * side.opening * share


def step_curves(
    step: Movement, estimate: Candidates, direction: Direction
) -> StepCurves:
    """Return what makes the curves of a step from the speeds of candidates, up to an
    end of the range."""
    bench = step.bench
    angles = step.angles(estimate)
    samples = _before_the_end(bench, angles[0, 1:])
    speeds_before_the_end = step.speeds_of(angles)[:, :samples]
    start = min(_start(step, speeds_before_the_end), samples)
    unit = f"{bench.unit[1]}/s"
    size = f"{abs(step.command):g} % command, {direction.word}"
    begun = np.linspace(0, start - 1, START_POINTS)
    rest = np.linspace(start - 1, samples - 1, REST_POINTS)
    points = np.unique(np.concatenate([begun, rest]).round().astype(int))
    highest = max(1.0 / (LEAST_PERIODS * bench.period), 2.0 * LOWEST)
    frequencies = np.geomspace(LOWEST, highest, FREQUENCY_POINTS)

    def point(
        kind: str, label: str, unit: str, at: float, along: str, positive: bool = False
    ) -> Column:
        name = f"{kind}_{direction.ending}"
        answered = (step.command, direction.moves)
        return Column(name, label, unit, positive, at, along, *answered)

    def curves(speeds: Array) -> Measured:
        label = f"speed after a step to {size}"
        for k in points.tolist():
            at = (k + 0.5) * bench.period  # a speed is that between two samples
            yield point("step", label, unit, at, "time [s]"), speeds[:, k]
        amplitude, phase = frequency_response(
            speeds[:, :start], frequencies, bench.period
        )
        label = f"speed over command after a step to {size}"
        along = "frequency [Hz]"
        per = f"{unit} per %"
        for i, at in enumerate(frequencies.tolist()):
            gain = amplitude[:, i] / abs(step.command)
            yield point("amplitude", label, per, at, along, positive=True), gain
        for i, at in enumerate(frequencies.tolist()):
            yield point("phase", label, "deg", at, along), phase[:, i]

    return curves


def frequency_response(
    speeds: Array, frequencies: Array, period: float
) -> tuple[Array, Array]:
    """Return amplitude and phase [deg] over a unit step, (n, F), from speeds after it,
    (n, samples).

    A speed is the mean between two samples, `period` [s] apart; after the last one it
    is taken to stay. The mean and the difference each damp a frequency by a sinc, which
    is divided out again.
    """
    impulse = np.diff(speeds, axis=1, prepend=0.0)
    time = period * np.arange(speeds.shape[1])
    # from next to 0, where it is 0
    dense = np.geomspace(frequencies[0] / 100.0, frequencies[-1], DENSE)
    every = np.unique(np.concatenate([dense, frequencies]))
    # the Fourier transform, at these frequencies alone
    swings = np.exp(-2j * np.pi * np.outer(time, every))
    response = impulse @ swings
    wanted = np.searchsorted(every, frequencies)
    turned = np.unwrap(np.angle(response), axis=1)
    phase = np.degrees(turned)
    # once for the mean between two samples, once for their difference
    damped = np.sinc(period * frequencies) ** 2
    amplitude = np.abs(response[:, wanted]) / damped
    return amplitude, phase[:, wanted]


def _before_the_end(bench: Bench, angles: Array) -> int:
    """Return how many of the angles after a step, (samples,), come before an end of the
    joint's range.
    """
    lower, upper = bench.settings.arm.stops(bench.joint)
    margin = 0.0
    if np.isfinite(upper - lower):
        margin = MARGIN * (upper - lower)
    below = angles < lower + margin
    above = angles > upper - margin
    beyond = np.flatnonzero(below | above)
    if not len(beyond):
        return len(angles)
    # two points make a curve
    return max(int(beyond[0]), 2)


def _start(step: Movement, speeds: Array) -> int:
    """Return how many samples of a step, speeds of shape (1, samples), are its
    start."""
    highest = speeds.max(axis=1)
    onset = step.reaches(speeds, ONSET * highest)[0]
    risen = step.reaches(speeds, RISEN * highest)[0]
    seconds = onset + TIME_CONSTANTS * (risen - onset)
    if not np.isfinite(seconds):
        return speeds.shape[1]
    return max(round(max(seconds, LEAST_START) / step.bench.period), 2)
