"""The estimation problem: parameters in, objectives out (equations (17) to (22)).

Evaluating a population is one function, `Problem.evaluate`, behind which threads, processes or a
cluster may stand; the search knows only its arrays.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.model import load_model
from hydroid.identification.stage import Stage
from hydroid.log import Log
from hydroid.objective.norms import overall_objective
from hydroid.objective.segments import segment_bounds, segment_objectives
from hydroid.parameters import Array
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.simulation import HydraulicSimulation, MechanicalSimulation
from hydroid.simulation.record import Record


@dataclass(frozen=True)
class Evaluation:
    """Objectives of n parameter sets: by segment, shape (n, S), and over all, shape (n,) [rad or relative].

    A set whose simulation diverged has inf throughout.
    """

    segments: Array
    overall: Array

    def __len__(self) -> int:
        return len(self.overall)


class Problem:
    """Logs, the model that is to reproduce them, and how the difference is measured.

    Args:
        arm: the arm's settings.
        settings: the fit's settings.
        logs: one or more records, each with its own start pose.
    """

    def __init__(self, arm: Arm, settings: FitSettings, logs: Sequence[Log]) -> None:
        self._arm = arm
        spec = load_model(arm.model, arm)
        outputs = [j - 1 for j in settings.outputs]
        self.settings, self.logs, self.outputs = settings, tuple(logs), outputs
        self.stage = Stage(arm, settings)
        self.stage.refuse_idle(np.any([log.driven for log in logs], axis=0), outputs)
        self.parameters = self.stage.parameters
        self._simulations = [make_simulation(spec, arm, log, outputs, settings) for log in logs]
        self._measured = [log.angle[:, outputs].T for log in logs]  # (K, T) a log
        # one channel a log and output, one after the other: errors of several logs are one long row
        channels = [
            (log, angle) for log, measured in zip(logs, self._measured, strict=True) for angle in measured
        ]
        self.measured = np.concatenate([angle for _, angle in channels])
        starts = np.cumsum([0, *(len(angle) for _, angle in channels)])
        how = settings.objective.segments
        self.bounds: NDArray[np.int64] = np.concatenate(
            [
                segment_bounds(angle, log.period, how) + start
                for (log, angle), start in zip(channels, starts[:-1], strict=True)
            ]
        )

    def freed(self) -> "Problem":
        """Return the same problem with every parameter free that has bounds, those held fixed included."""
        free = {
            name: p if p.bounds is None else p.model_copy(update={"fixed": None})
            for name, p in self.settings.parameters.items()
        }
        settings = self.settings.model_copy(update={"parameters": free})
        return Problem(self._arm, settings, self.logs)

    def evaluate(self, theta: Array) -> Evaluation:
        """Simulate theta, shape (n, P), and measure it; memory does not grow with n beyond the result."""
        how = self.settings.objective
        segments = np.empty((len(theta), len(self.bounds)))
        overall = np.empty(len(theta))
        for rows in self._chunks(len(theta)):
            error = self.residuals(theta[rows])
            segments[rows] = segment_objectives(error, self.measured, self.bounds, how)
            overall[rows] = overall_objective(error, self.measured, how)
        return Evaluation(segments, overall)

    def residuals(self, theta: Array) -> Array:
        """Output errors y - y_hat of (17) [rad], shape (n, R): channel after channel; NaN where diverged."""
        parts = [
            measured - simulated.transpose(0, 2, 1)
            for measured, simulated in zip(self._measured, self.responses(theta), strict=True)
        ]
        return np.concatenate([p.reshape(len(theta), -1) for p in parts], axis=1)

    def responses(self, theta: Array) -> list[Array]:
        """Simulated outputs [rad], one array of shape (n, T, K) a log."""
        members = self.stage.members(theta)
        return [simulation.simulate(members).angle for simulation in self._simulations]

    def _chunks(self, n: int) -> Iterator[slice]:
        size = min(simulation.record.chunk for simulation in self._simulations)
        return (slice(i, min(i + size, n)) for i in range(0, n, size))


def make_simulation(
    spec: mujoco.MjSpec, arm: Arm, log: Log, outputs: list[int], settings: FitSettings
) -> MechanicalSimulation | HydraulicSimulation:
    """Return what simulates one log in the settings' stage; outputs are 0-based joints."""
    record = Record(spec, arm, log, outputs, settings.simulation)
    if settings.stage == "mech":
        return MechanicalSimulation(record, settings.simulation)
    return HydraulicSimulation(record, arm, settings.hydraulics, settings.simulation)


class Memo:
    """Evaluates each parameter set once: identical chromosomes are not simulated again."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._known: dict[bytes, tuple[Array, float]] = {}
        self.infeasible = 0
        """sets whose simulation diverged"""

    @property
    def simulated(self) -> int:
        """Sets simulated so far."""
        return len(self._known)

    @property
    def best(self) -> Array:
        """The set with the lowest objective over the whole record, shape (P,)."""
        return np.frombuffer(min(self._known, key=lambda key: self._known[key][1]))

    def evaluate(self, theta: Array) -> Evaluation:
        """Evaluate theta, shape (n, P), simulating what is new in it."""
        new = {row.tobytes(): row for row in theta if row.tobytes() not in self._known}
        if new:
            self._keep(np.array(list(new.values())))
        known = [self._known[row.tobytes()] for row in theta]
        return Evaluation(np.array([s for s, _ in known]), np.array([o for _, o in known]))

    def _keep(self, theta: Array) -> None:
        result = self.problem.evaluate(theta)
        self.infeasible += int(np.sum(~np.isfinite(result.overall)))
        for row, segments, overall in zip(theta, result.segments, result.overall, strict=True):
            self._known[row.tobytes()] = (segments, float(overall))

    def arrays(self) -> tuple[Array, Array]:
        """All sets and their objectives, overall last: shapes (m, P) and (m, S + 1)."""
        theta = np.array([np.frombuffer(key) for key in self._known])
        values = np.array([np.append(segments, overall) for segments, overall in self._known.values()])
        return theta, values

    def restore(self, theta: Array, values: Array) -> None:
        """Take back what `arrays` returned."""
        self._known = {t.tobytes(): (v[:-1].copy(), float(v[-1])) for t, v in zip(theta, values, strict=True)}
        self.infeasible = int(np.sum(~np.isfinite(values[:, -1])))
