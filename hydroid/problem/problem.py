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
from hydroid.simulation import Response, make_simulation
from hydroid.simulation.roles import roles

CHUNK = 2**23  # residuals that are held in memory at a time, 64 MiB

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
        self._simulations = [
            make_simulation(
                spec, log, outputs, settings, compared_pressures(log, settings)
            )
            for log in logs
        ]
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
        return Problem(settings, self.logs if logs is None else logs, self._spread)

    def started(self, log: Log) -> list[int]:
        """Joints whose measured angle only their start is simulated from, numbered from
        1."""
        compared = np.isin(np.arange(log.joints), self.outputs)
        of_joints = roles(log.driven | compared, self.settings.simulation.other_joints)
        return (np.flatnonzero(log.has_angle & ~of_joints.following) + 1).tolist()

    def theta(self, unit: Array) -> Array:
        """Return candidates, (n, P), from points of the search's unit box, moved to
        where the priors hold."""
        return self.priors.project(self.priors.searched.from_unit(unit))

    @property
    def start(self) -> Array | None:
        """The point of the search's unit box where it starts, shape (p,); None: not
        stated."""
        searched = self.priors.searched
        stated = any(
            p.start is not None and p.fixed is None for p in searched.parameters
        )
        return searched.to_unit(searched.start) if stated else None

    def evaluate(self, theta: Array) -> Array:
        """Return the objectives of theta, (n, P), by segment and overall last, shape
        (n, S + 1).

        They are in rad, or relative; inf throughout where a simulation diverged. Memory
        does not grow with n beyond the result.
        """
        if self._spread is None:
            return self.objectives(theta)
        values = self._spread(
            self._on_worker, "objectives", theta, len(self.bounds) + 1
        )
        values[np.isnan(values)] = np.inf
        return values

    def objectives(self, theta: Array) -> Array:
        """Evaluate theta, shape (n, P), in this process."""
        size = max(1, CHUNK // len(self.measured))
        chunks = [theta[at : at + size] for at in range(0, len(theta), size)]
        parts = [self.norms(self.errors(self.responses(chunk))) for chunk in chunks]
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
        return np.concatenate(
            [c.error(responses[c.log]) for c in self.channels], axis=1
        )

    def leaves_noise(self, theta: Array) -> bool:
        """Whether errors at an estimate, (P,), change between samples as white noise
        does."""
        errors = self.output_errors(theta[None])[0]
        for channel in self.channels:
            error = errors[channel.rows]
            if not np.mean(np.diff(error) ** 2) > WHITE * np.var(error):
                return False
        return True

    def responses(self, theta: Array) -> list[Response]:
        """Simulate theta, shape (n, P); return one response of n candidates per log."""
        responses: list[Response] = []
        for simulation, log in zip(self._simulations, self.logs, strict=True):
            candidates = self.bindings.candidates(theta, log.source)
            responses.append(simulation.simulate(candidates))
        return responses

    def angles(self, errors: Array, joints: Collection[int] = ()) -> Array:
        """Return the output errors, of (n, R), of the angles of joints (from 1), or
        all, unweighted [rad]."""
        angles = [
            errors[:, c.rows] / c.weight
            for c in self.channels
            if c.quantity == "angle" and (not joints or c.joint in joints)
        ]
        return np.concatenate(angles, axis=1)

    def rms(self, errors: Array, joints: Collection[int] = ()) -> Array:
        """Return the rms of the same, shape (n,)."""
        return rms(self.angles(errors, joints), axis=1)

    @cached_property
    def _on_worker(self) -> "Problem":
        threads = {"simulation.threads": self.settings.simulation.threads or 1}
        return Problem(self.settings.changed(threads), self.logs)
