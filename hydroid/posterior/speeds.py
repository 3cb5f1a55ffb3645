"""Quantities of stage 2 that test movements in one direction show: speeds, dead band, dead time."""

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.bench import Bench
from hydroid.posterior.column import Column, Measured
from hydroid.posterior.movement import Movement, movement
from hydroid.posterior.statics import actuator
from hydroid.simulation import Candidates

COMMANDS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
"""of the curve of speed [%]"""
GAIN = (40.0, 60.0)
"""commands between which the gain is taken [%]"""
STEP = 50.0
"""command of the speed over poses [%]; of dead time and time constant too, where it moves the joint"""
POSES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""parts of the travel at which the speed over poses is stated"""
MOVES = 0.02
"""part of the speed at full command, added to that without a command, at which the joint begins to move"""
BRACKET = 0.25
"""width to which the command at which it begins to move is enclosed [%]"""
ONSET, RISEN = 0.1, 1.0 - float(np.exp(-1.0))
"""parts of the final speed: it takes the dead time to reach the first, and from there the time constant to
reach the second"""


class SpeedTests:
    """Test movements of one joint in one direction.

    They are planned so that the estimate passes the joint's angle at their end.

    Args:
        bench: the joint.
        estimate: one candidate.
        sign: of the commands.
        words: ends the names of the quantities, and their labels.
    """

    def __init__(self, bench: Bench, estimate: Candidates, sign: float, words: tuple[str, str]) -> None:
        self._bench, self._sign, self._words = bench, sign, words
        self._steps = {u: movement(bench, sign * u).through_pose(estimate) for u in COMMANDS}
        low, high = bench.travel
        poses = [bench.at(low + part * (high - low)) for part in POSES]
        self._over_poses = [movement(pose, sign * STEP).through_pose(estimate) for pose in poses]
        self._onset = self._enclose(estimate)
        self._rise = self._moving_step(estimate)

    def measure(self, candidates: Candidates) -> Measured:
        """Return the quantities of n candidates."""
        runs = {u: step.speeds(candidates) for u, step in self._steps.items()}
        speed = {u: self._steps[u].final(run) for u, run in runs.items()}
        name = self._bench.name
        curve = [
            (
                Column(f"{name}_speed", "speed", "deg/s", False, "command [%]", self._sign * u),
                self._sign * self._bench.sense * value,
            )
            for u, value in speed.items()
        ]
        poses = [
            self._named("speed_50_over_poses", "speed at 50 % command", "deg/s", step.speed(candidates),
                        "angle [deg]", float(np.degrees(step.bench.angle)))
            for step in self._over_poses
        ]  # fmt: skip
        step = self._rise
        rises = [self._steps[step].reaches(runs[step], part * speed[step]) for part in (ONSET, RISEN)]
        gain = (speed[GAIN[1]] - speed[GAIN[0]]) / (GAIN[1] - GAIN[0])
        c, arm = actuator(self._bench, candidates)
        flow = (c.a if self._sign > 0 else c.b).area * np.abs(arm) * np.radians(speed[100.0])
        return [
            *curve,
            *poses,
            self._named("speed_50", "speed at 50 % command", "deg/s", speed[50.0]),
            self._named("speed_100", "speed at 100 % command", "deg/s", speed[100.0]),
            self._named("gain", "gain between command and speed", "deg/s per %", gain),
            self._named("dead_time", f"dead time at {step:g} % command", "s", rises[0]),
            self._named("time_constant", f"time constant at {step:g} % command", "s", rises[1] - rises[0]),
            *self._dead_band(candidates, speed[100.0]),
            self._named("full_flow", "flow at 100 % command", "L/min", 6e4 * flow),
        ]

    def _named(
        self, name: str, label: str, unit: str, value: Array, along: str = "", at: float = 0.0
    ) -> tuple[Column, Array]:
        ending, word = self._words
        column = Column(f"{self._bench.name}_{name}_{ending}", f"{label}, {word}", unit, True, along, at)
        return column, value

    def _dead_band(self, candidates: Candidates, full: Array) -> Measured:
        """Interpolate where the speed begins to rise between two commands."""
        if self._onset is None:
            return []
        below, above = (step.speed(candidates) for step in self._onset)
        low, high = (abs(step.command) for step in self._onset)
        part = (MOVES * full + self._rest(candidates) - below) / (above - below)
        return [self._named("dead_band", "dead band", "%", low + part * (high - low))]

    def _moving_step(self, estimate: Candidates) -> float:
        """Return the smallest command from STEP on that clearly moves the estimate, or the largest."""
        full = self._steps[100.0].speed(estimate)[0]
        enough = (u for u in COMMANDS if u >= STEP and self._steps[u].speed(estimate)[0] > ONSET * full)
        return next(enough, 100.0)

    def _rest(self, candidates: Candidates) -> Array:
        """Speed without a command, shape (n,)."""
        return self._sign * movement(self._bench, 0.0).speed(candidates)

    def _enclose(self, estimate: Candidates) -> tuple[Movement, Movement] | None:
        """Return movements just below and above the dead band of the estimate; None where it has none."""
        level = MOVES * self._steps[100.0].speed(estimate)[0] + self._rest(estimate)[0]
        moves = [u for u, step in self._steps.items() if step.speed(estimate)[0] > level]
        if not moves:
            return None
        high = moves[0]
        low = max((u for u in COMMANDS if u < high), default=0.0)
        while high - low > BRACKET:
            middle = (low + high) / 2
            moving = movement(self._bench, self._sign * middle).speed(estimate)[0] > level
            low, high = (low, middle) if moving else (middle, high)
        if low == 0.0:
            return None
        first, second = (movement(self._bench, self._sign * u) for u in (low, high))
        return first, second
