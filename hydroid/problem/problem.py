"""The estimation problem: parameters in, objectives out (equations (17) to (22)).

Evaluating a population is one function, `Problem.evaluate`; the search knows only its
arrays. Candidates are simulated by threads of this process, or on workers
(`DaskWorkers`); no bit of a result depends on how many.
"""

from collections.abc import Collection, Sequence
from functools import cached_property

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, Ints, rms
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parallel.workers import DaskWorkers
from hydroid.problem.bindings import Bindings
from hydroid.problem.channels import (
    compared_pressures,
    make_channels,
    overall_objective,
    segment_bounds,
    segment_objectives,
)
from hydroid.problem.priors import Priors
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Candidates, Response, Simulation, make_simulation
from hydroid.simulation.roles import roles

CHUNK = 2**23  # residuals that are held in memory at a time, 64 MiB

TRIED = 2  # candidates of a step of least squares at most
KEPT = 4  # candidates whose responses are kept

WHITE = 1.6
"""mean square of the change between samples, in variances of the error, from which the
error is noise; it is 2 of white noise, and that of J. von Neumann (1941)"""


class Problem:
    """Logs, each with its start pose, a model that should reproduce them, and the
    measure of the difference.

    Candidates are simulated by `spread`, where a worker has `simulation.threads`
    threads, one where that is 0; None: in this process.

    Attributes:
        channels: the compared signals, in the order of a row of residuals.
        driven: joints that any log drives, shape (J,).
        measured: all channels in a row, times their weights, shape (R,).
        bounds: [first, end) of each objective's samples in it, shape (S, 2).
    """

    def __init__(
        self,
        settings: FitSettings,
        logs: Sequence[Log],
        spread: DaskWorkers | None = None,
    ) -> None:
        spec = load_model(settings.arm)
        outputs = [joint - 1 for joint in settings.outputs]
        self.settings = settings
        self.logs = tuple(logs)
        self.outputs = outputs
        self._spread = spread
        self.bindings = Bindings(settings)
        self.driven = np.any([log.driven for log in logs], axis=0)
        self.bindings.refuse_idle(self.driven, outputs)
        self.parameters = settings.parameter_set()
        if not self.parameters.free.any():
            raise SettingsError(
                "no parameter is free", "parameters", "fix fewer of them"
            )
        self.priors = Priors(settings.priors, self.parameters)
        self._tried = dict[bytes, list[Response]]()
        self._simulations: list[Simulation] = []
        for log in logs:
            pressures = compared_pressures(log, settings)
            simulation = make_simulation(spec, log, outputs, settings, pressures)
            self._simulations.append(simulation)
        self._groups = [self.bindings.group_of(log.source) for log in logs]
        self.channels = make_channels(logs, settings)
        self.measured = np.concatenate([c.weight * c.measured for c in self.channels])
        segments: list[Ints] = []
        for channel in self.channels:
            # a pressure is one objective, however long
            count = 1
            if channel.quantity == "angle":
                count = settings.objective.segments
            within = segment_bounds(len(channel.measured), count)
            segments.append(channel.rows.start + within)
        self.bounds: Ints = np.concatenate(segments)

    @property
    def active_joints(self) -> tuple[int, ...]:
        """Joints that a log drives or that are compared, numbered from 1."""
        driven = (np.flatnonzero(self.driven) + 1).tolist()
        return tuple(sorted({*driven, *self.settings.outputs}))

    def varied(
        self, settings: FitSettings, logs: Sequence[Log] | None = None
    ) -> "Problem":
        """Return the problem with other settings, or other logs too, simulated in the
        same place."""
        if settings is self.settings and logs is None:
            return self
        if logs is None:
            logs = self.logs
        return Problem(settings, logs, self._spread)

    def started(self, log: Log) -> list[int]:
        """Joints whose measured angle only their start is simulated from, numbered from
        1."""
        compared = np.isin(np.arange(log.joints), self.outputs)
        active = log.driven | compared
        of_joints = roles(active, self.settings.simulation.other_joints)
        # those that follow the log are where it has them throughout
        only_start = log.has_angle & ~of_joints.following
        return (np.flatnonzero(only_start) + 1).tolist()

    def theta(self, unit: Array) -> Array:
        """Return candidates, (n, P), from points of the search's unit box, moved to
        where the priors hold."""
        return self.priors.project(self.priors.searched.from_unit(unit))

    @property
    def start(self) -> Array | None:
        """The point of the search's unit box where it starts, shape (p,); None: not
        stated."""
        searched = self.priors.searched
        for parameter in searched.parameters:
            if parameter.start is not None and parameter.fixed is None:
                return searched.to_unit(searched.start)
        return None

    def evaluate(self, theta: Array) -> Array:
        """Return the objectives of theta, (n, P), by segment and overall last, shape
        (n, S + 1).

        They are in rad, or relative; inf throughout where a simulation diverged. Memory
        does not grow with n beyond the result.
        """
        if self._spread is None:
            return self.objectives(theta)
        columns = len(self.bounds) + 1
        values = self._spread(self._on_worker, "objectives", theta, columns)
        # NaN: candidates that killed their workers
        values[np.isnan(values)] = np.inf
        return values

    def objectives(self, theta: Array) -> Array:
        """Evaluate theta, shape (n, P), in this process."""
        size = max(1, CHUNK // len(self.measured))
        parts = list[Array]()
        for first in range(0, len(theta), size):
            responses = self.responses(theta[first : first + size])
            parts.append(self.norms(self.errors(responses)))
        return np.vstack(parts)

    def norms(self, errors: Array) -> Array:
        """Return the objectives of output errors, (n, R), by segment and overall last:
        shape (n, S + 1)."""
        objective = self.settings.objective
        segments = segment_objectives(errors, self.measured, self.bounds, objective)
        overall = overall_objective(errors, self.measured, objective)
        return np.column_stack([segments, overall])

    def output_errors(self, theta: Array) -> Array:
        """Weighted output errors of (17) [rad] of theta, shape (n, P): (n, R); NaN
        where one diverged."""
        if self._spread is not None:
            return self._spread(
                self._on_worker, "output_errors", theta, len(self.measured)
            )
        return self.errors(self.responses(theta))

    def errors(self, responses: Sequence[Response]) -> Array:
        """Return the weighted output errors of n candidates' responses to all logs
        [rad], shape (n, R)."""
        errors = [channel.error(responses[channel.log]) for channel in self.channels]
        return np.concatenate(errors, axis=1)

    def leaves_noise(self, theta: Array) -> bool:
        """Return whether errors at an estimate, (P,), change between samples as white
        noise does."""
        errors = self.output_errors(theta[None])[0]
        for channel in self.channels:
            error = errors[channel.rows]
            change = np.mean(np.diff(error) ** 2)
            # NaN, of a simulation that diverged, is not larger
            if not change > WHITE * np.var(error):
                return False
        return True

    def responses(self, theta: Array) -> list[Response]:
        """Simulate theta, shape (n, P); return one response of n candidates per log.

        Least squares tries one or two, and asks for the better one again: the last ones
        are kept.
        """
        key = theta.tobytes()
        if key in self._tried:
            return self._tried[key]
        responses: list[Response] = []
        of_group = dict[str, Candidates]()
        for simulation, group in zip(self._simulations, self._groups, strict=True):
            if group not in of_group:
                of_group[group] = self.bindings.of_group(theta, group)
            responses.append(simulation.simulate(of_group[group]))
        if len(theta) <= TRIED:
            for i, row in enumerate(theta):
                self._tried[row.tobytes()] = [one[i : i + 1] for one in responses]
            for old in [*self._tried][:-KEPT]:
                del self._tried[old]
        return responses

    def angles(self, errors: Array, joints: Collection[int] = ()) -> Array:
        """Return the output errors, of (n, R), of the angles of joints (from 1), or
        all, unweighted [rad]."""
        angles = list[Array]()
        for channel in self.channels:
            is_meant = not joints or channel.joint in joints
            if channel.quantity == "angle" and is_meant:
                angles.append(errors[:, channel.rows] / channel.weight)
        return np.concatenate(angles, axis=1)

    def rms(self, errors: Array, joints: Collection[int] = ()) -> Array:
        """Return the rms of the same, shape (n,)."""
        return rms(self.angles(errors, joints), axis=1)

    @cached_property
    def _on_worker(self) -> "Problem":
        threads = {"simulation.threads": self.settings.simulation.threads or 1}
        return Problem(self.settings.changed(threads), self.logs)
