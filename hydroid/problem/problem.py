"""The estimation problem: parameters in, objectives out (equations (17) to (22)).

Evaluating a population is one function, `Problem.evaluate`; the search knows only its arrays. Candidates are
simulated by threads of this process, or on workers (`Spread`); no bit of a result depends on how many.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.arm.model import load_model
from hydroid.arm.payload import add_payload
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.channels import Channel, make_channels
from hydroid.problem.norms import overall_objective
from hydroid.problem.priors import Priors
from hydroid.problem.segments import segment_bounds, segment_objectives
from hydroid.problem.stage import Stage
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import SegmentSettings
from hydroid.simulation import HydraulicSimulation, MechanicalSimulation, Response
from hydroid.simulation.scenario import Scenario


@dataclass(frozen=True)
class Evaluation:
    """Objectives of n candidates: by segment, shape (n, S), and overall, shape (n,) [rad or relative].

    A candidate whose simulation diverged has inf throughout.
    """

    segments: Array
    overall: Array

    def __len__(self) -> int:
        return len(self.overall)


class Spread(Protocol):
    """Computes rows of candidates on workers (`DaskWorkers`)."""

    def __call__(self, target: object, method: str, theta: Array, columns: int) -> Array:
        """Apply `target.method`, (m, P) -> (m, columns), to the rows of theta; NaN where no worker can."""
        ...


class Problem:
    """Logs, the model that should reproduce them, and how the difference is measured.

    Args:
        settings: the fit's settings.
        logs: one or more records, each with its own start pose.
        spread: where candidates are simulated; None: in this process. A worker has `simulation.threads`
            threads, one where that is 0.

    Attributes:
        channels: what is compared, in the order of a row of residuals.
        priors: about the parameters, from the settings.
        measured: all channels in a row, times their weights, shape (R,).
        bounds: [first, end) of each objective's samples in it, shape (S, 2).
    """

    def __init__(self, settings: FitSettings, logs: Sequence[Log], spread: Spread | None = None) -> None:
        spec = load_model(settings.arm.model, settings.arm)
        outputs = [j - 1 for j in settings.outputs]
        self.settings, self.logs, self.outputs = settings, tuple(logs), outputs
        self._spread = spread
        self.stage = Stage(settings)
        self.stage.refuse_idle(np.any([log.driven for log in logs], axis=0), outputs)
        self.parameters = self.stage.parameters
        if not self.parameters.free.any():
            raise SettingsError("no parameter is free", where="parameters", hint="fix fewer of them")
        self.priors = Priors(settings.priors, self.parameters)
        pressures = [compared_pressures(log, settings) for log in logs]
        self._simulations = [
            make_simulation(spec, log, outputs, settings, joints)
            for log, joints in zip(logs, pressures, strict=True)
        ]
        self.channels = make_channels(logs, outputs, pressures, settings.objective)
        self.measured = np.concatenate([c.weight * c.measured for c in self.channels])
        self.bounds: NDArray[np.int64] = np.concatenate([self._segments(c) for c in self.channels])

    def freed(self) -> "Problem":
        """Return the same problem with every parameter free that has bounds, those held fixed included."""
        return Problem(self.settings.freed(), self.logs, self._spread)

    def first(self, seconds: float) -> "Problem":
        """Return the problem of the first seconds after each log's first command, one segment per channel."""
        objective = self.settings.objective.model_copy(update={"segments": SegmentSettings(equal=1)})
        settings = self.settings.model_copy(update={"objective": objective})
        return Problem(settings, [log.first(seconds) for log in self.logs], self._spread)

    def theta(self, unit: Array) -> Array:
        """Return candidates, (n, P), from points of the unit box, moved to where the priors hold."""
        return self.priors.project(self.parameters.from_unit(unit))

    def evaluate(self, theta: Array) -> Evaluation:
        """Simulate theta, shape (n, P), and measure it; memory does not grow with n beyond the result."""
        if self._spread is None:
            values = self.objectives(theta)
        else:
            values = self._spread(self._on_worker, "objectives", theta, len(self.bounds) + 1)
            values[np.isnan(values)] = np.inf
        return Evaluation(values[:, :-1], values[:, -1])

    def objectives(self, theta: Array) -> Array:
        """Objectives of theta, shape (n, P), simulated in this process: shape (n, S + 1), overall last."""
        how = self.settings.objective
        values = np.empty((len(theta), len(self.bounds) + 1))
        for rows in self._chunks(len(theta)):
            error = self.output_errors(theta[rows])
            values[rows, :-1] = segment_objectives(error, self.measured, self.bounds, how)
            values[rows, -1] = overall_objective(error, self.measured, how)
        return values

    def residuals(self, theta: Array) -> Array:
        """Weighted output errors of (17) [rad], shape (n, R): channel after channel; NaN where diverged."""
        if self._spread is None:
            return self.output_errors(theta)
        return self._spread(self._on_worker, "output_errors", theta, len(self.measured))

    def output_errors(self, theta: Array) -> Array:
        """The residuals of theta, shape (n, P), simulated in this process."""
        responses = self.responses(theta)
        return np.concatenate([channel.residual(responses) for channel in self.channels], axis=1)

    def responses(self, theta: Array) -> list[Response]:
        """Simulate theta, shape (n, P); return one response of n candidates per log."""
        candidates = self.stage.candidates(theta)
        return [simulation.simulate(candidates) for simulation in self._simulations]

    def rms(self, residuals: Array) -> Array:
        """Rms error of the angles, unweighted [rad], shape (n,), from rows of residuals, shape (n, R)."""
        angles = [residuals[:, c.rows] / c.weight for c in self.channels if c.quantity == "angle"]
        return np.sqrt(np.mean(np.concatenate(angles, axis=1) ** 2, axis=1))

    @cached_property
    def _on_worker(self) -> "Problem":
        """The same problem as a worker has it."""
        threads = self.settings.simulation.threads or 1
        simulation = self.settings.simulation.model_copy(update={"threads": threads})
        return Problem(self.settings.model_copy(update={"simulation": simulation}), self.logs)

    def _segments(self, channel: Channel) -> NDArray[np.int64]:
        """Samples of each objective: an angle's segments; a pressure is one objective, however long."""
        if channel.quantity != "angle":
            return np.array([[channel.rows.start, channel.rows.stop]])
        period, how = self.logs[channel.log].period, self.settings.objective.segments
        return segment_bounds(channel.measured, period, how) + channel.rows.start

    def _chunks(self, n: int) -> Iterator[slice]:
        size = min(simulation.scenario.chunk for simulation in self._simulations)
        return (slice(i, min(i + size, n)) for i in range(0, n, size))


def compared_pressures(log: Log, settings: FitSettings) -> list[int]:
    """Joints whose chamber pressures count in the objectives, 0-based: driven ones that the log measures."""
    if settings.stage != "hyd" or settings.objective.pressure_weight == 0 or log.pressure is None:
        return []
    return [j for j in range(log.joints) if log.driven[j] and not np.isnan(log.pressure[0, j]).all()]


def make_simulation(
    spec: mujoco.MjSpec,
    log: Log,
    outputs: list[int],
    settings: FitSettings,
    pressures: Sequence[int] = (),
) -> MechanicalSimulation | HydraulicSimulation:
    """Return the simulation of one log in the settings' stage.

    Args:
        spec: the arm's MJCF.
        log: the record.
        outputs: joints whose angles are wanted, 0-based.
        settings: the fit's settings.
        pressures: joints whose chamber pressures are wanted, 0-based.
    """
    payload = settings.payloads.get(Path(log.source).name)
    if payload:
        spec = add_payload(spec, settings.arm, payload)
    scenario = Scenario(spec, settings.arm, log, outputs, settings.simulation)
    if settings.stage == "mech":
        return MechanicalSimulation(scenario, settings.simulation)
    return HydraulicSimulation(scenario, settings.arm, settings.hydraulics, settings.simulation, pressures)


class Memo:
    """Evaluates each candidate once: identical chromosomes are not simulated again."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._known: dict[bytes, tuple[Array, float]] = {}
        self.infeasible = 0
        """candidates whose simulation diverged"""

    @property
    def simulated(self) -> int:
        """Candidates simulated so far."""
        return len(self._known)

    @property
    def best(self) -> Array:
        """The candidate with the lowest overall objective, shape (P,)."""
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
        # a candidate with one infinite objective is infeasible: none of its objectives may win
        finite = np.isfinite(np.column_stack([result.segments, result.overall]))
        failed = np.logical_not(np.all(finite, axis=1))
        self.infeasible += int(failed.sum())
        all_segments = np.where(failed[:, None], np.inf, result.segments)
        all_overall = np.where(failed, np.inf, result.overall)
        for row, segments, overall in zip(theta, all_segments, all_overall, strict=True):
            self._known[row.tobytes()] = (segments, float(overall))

    def arrays(self) -> tuple[Array, Array]:
        """Return all candidates and their objectives, overall last: shapes (m, P) and (m, S + 1)."""
        theta = np.array([np.frombuffer(key) for key in self._known])
        values = np.array([np.append(segments, overall) for segments, overall in self._known.values()])
        return theta, values

    def restore(self, theta: Array, values: Array) -> None:
        """Restore what `arrays` returned."""
        self._known = {t.tobytes(): (v[:-1].copy(), float(v[-1])) for t, v in zip(theta, values, strict=True)}
        self.infeasible = int(np.sum(~np.isfinite(values[:, -1])))
