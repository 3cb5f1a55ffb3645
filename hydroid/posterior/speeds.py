"""Quantities of stage 2 that test movements in one direction show: speeds, dead band, dead time."""

from collections.abc import Callable

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.bench import Bench, movement
from hydroid.posterior.statics import Column, Measured, actuator
from hydroid.simulation import Candidates

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

        runs = {u: step.speeds(candidates) for u, step in steps.items()}
        speed = {u: steps[u].end(run) for u, run in runs.items()}
        for u, value in speed.items():
            point = Column("speed", "speed", "deg/s", False, sign * u)
            yield point, sign * bench.sense * value
        for u in (50.0, 100.0):
            yield row(f"speed_{u:.0f}", f"speed at {u:.0f} % command", "deg/s", speed[u])
        gain = (speed[60.0] - speed[40.0]) / (60.0 - 40.0)
        yield row("gain", "gain between command and speed", "deg/s per %", gain)
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
