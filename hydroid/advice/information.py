"""What an experiment measures: its motion within the limits, its Fisher information, the precision after it.

Information is in relative changes of the free parameters, x = d theta / theta: units do not matter, and a
standard deviation of 0.1 means 10 %.

Only the simulated motion is kept within the limits; an arm that differs from the model moves differently.
"""

from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from hydroid.advice.commands import (
    Experiment,
    Violation,
    experiment_samples,
    meeting,
    repaired,
    violation,
)
from hydroid.arm.machine import load_machine
from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.jacobian import FINE_STEP, jacobian, relative_scale, score_slopes
from hydroid.posterior.noise import Noise, channel_noise
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem, make_simulation
from hydroid.problem.stage import Stage
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings

PRIOR_SD = 1.0
"""relative standard deviation of every parameter before any log or prior (ours)"""
MAX_REPAIRS = 60
"""changes after which an experiment that still breaks a limit is given up"""


def information(slopes: Array, noise: Noise) -> Array:
    """Fisher information in one channel, (F, F), from its derivatives per relative change, shape (F, T)."""
    white = noise.whitened(slopes)
    return white @ white.T


def sensor_noise(settings: DesignSettings, samples: int, period: float) -> Noise:
    """Return the noise of a future log of angles [rad]: white, or a first-order autoregression."""
    level, time = float(np.radians(settings.noise_deg)), settings.noise_correlation_s
    reflection = np.array([-np.exp(-period / time)]) if time > 0 else np.empty(0)
    return Noise(samples, level, reflection, "settings")


def log_information(problem: Problem, theta: Array) -> Array:
    """Information of logs about the free parameters, for the noise that they show, shape (F, F)."""
    at, objective = jacobian(problem, theta), problem.settings.objective
    slopes = np.nan_to_num(at.slopes[problem.parameters.free])
    parts = [
        information(slopes[:, c.rows], channel_noise(c, at.residual[c.rows], objective))
        for c in problem.channels
    ]
    return np.sum(parts, axis=0)


def prior_information(priors: Priors, parameters: ParameterSet, theta: Array) -> Array:
    """Information of the priors about the free parameters, shape (F, F)."""
    slopes = score_slopes(priors, theta, relative_scale(parameters, theta))[parameters.free]
    return slopes @ slopes.T


@dataclass(frozen=True, eq=False)
class Precision:
    """How precisely the parameters are known, with and without one more experiment.

    Every parameter has a weak prior of PRIOR_SD. A direction without any information then stays at 100 %,
    and the covariance stays finite. Such a direction must not hide the others, so the E criterion looks at
    `directions` only.

    Attributes:
        known: information of earlier logs and of the priors in the settings, shape (F, F).
        directions: orthonormal basis of the directions that such experiments improve on PRIOR_SD, (F, d).
    """

    known: Array
    directions: Array

    @staticmethod
    def of(known: Array, typical: Array) -> "Precision":
        """Return the precision for experiments whose mean information is `typical`, shape (F, F)."""
        values, vectors = np.linalg.eigh(known + typical)
        improved = values > 1 / PRIOR_SD**2
        improved[-1] = True  # at least one direction to compare experiments by
        return Precision(known, vectors[:, improved])

    def deviations(self, information: Array | float = 0.0) -> Array:
        """Relative standard deviation of each free parameter, (F,), after an experiment's information."""
        return np.sqrt(np.diag(self._covariance(information)))

    def spread(self, slopes: Array, information: Array | float = 0.0) -> Array:
        """Standard deviation of functions with derivatives (k, F) per relative change, shape (k,)."""
        return np.sqrt(np.sum((slopes @ self._covariance(information)) * slopes, axis=1))

    def weakest(self, information: Array | float = 0.0) -> tuple[float, Array]:
        """Relative standard deviation and unit vector (F,) of the least known of `directions`."""
        basis = self.directions
        values, vectors = np.linalg.eigh(basis.T @ self._covariance(information) @ basis)
        return float(np.sqrt(values[-1])), basis @ vectors[:, -1]

    def score(self, information: Array, criterion: str) -> float:
        """Merit, higher is better: minus the log of the weakest deviation (E), half a log determinant (D)."""
        if criterion == "E":
            return -float(np.log(self.weakest(information)[0]))
        return 0.5 * float(np.linalg.slogdet(self._total(information))[1])

    def _total(self, information: Array | float) -> Array:
        return self.known + information + np.eye(len(self.known)) / PRIOR_SD**2

    def _covariance(self, information: Array | float) -> Array:
        total = self._total(information)
        # constraints leave a matrix of very unequal scales: unit diagonal first
        scale = 1 / np.sqrt(np.diag(total))
        inverse = cho_solve(cho_factor(total * np.outer(scale, scale)), np.eye(len(total)))
        return inverse * np.outer(scale, scale)


class Trial(NamedTuple):
    """A simulated experiment that keeps the limits.

    experiment: its commands. information: about relative changes of the free parameters, shape (F, F).
    log: its commands with the simulated angles.
    """

    experiment: Experiment
    information: Array
    log: Log


class ExperimentSimulator:
    """Simulates experiments at the present estimate theta, shape (P,), within the limits of the settings."""

    def __init__(self, settings: FitSettings, theta: Array) -> None:
        self._spec = load_model(settings.arm)
        if settings.simulation.other_joints == "measured":  # an experiment has no measured motion
            simulation = settings.simulation.model_copy(update={"other_joints": "locked"})
            settings = settings.model_copy(update={"simulation": simulation})
        self._settings, self._outputs = settings, [j - 1 for j in settings.outputs]
        self._period = settings.log.period_s
        self._noise = sensor_noise(settings.design, experiment_samples(settings), self._period)
        arm, self._machine = settings.arm, None
        if settings.design.clearance_m is not None:
            self._machine = load_machine(arm, pair=arm.pair is not None)
        stage = Stage(settings)
        # one-sided differences take a quarter of the simulations of `jacobian` and agree to 0.1 %
        moved = theta + FINE_STEP * np.diag(relative_scale(stage.parameters, theta))[stage.parameters.free]
        self._candidates = stage.candidates(np.vstack([theta, moved]))

    def trial(self, experiment: Experiment) -> Trial | None:
        """Return the experiment, changed to keep the limits, with its information; None where it cannot."""
        if (kept := self.within_limits(experiment)) is None:
            return None
        gained = self.information(kept[0])
        return None if gained is None else Trial(kept[0], gained, kept[1])

    def within_limits(self, experiment: Experiment) -> tuple[Experiment, Log] | None:
        """Reverse or reduce levels until the experiment keeps the limits; return it and its predicted log.

        None where it still breaks them, or its simulation diverges.
        """
        changes: Counter[tuple[int, int]] = Counter()
        for _ in range(MAX_REPAIRS):
            angle = self._simulate(experiment, 1)
            if angle is None:
                return None
            first = violation(angle[0], self._period, self._settings.arm, self._settings.design)
            first = first or self._too_near(angle[0])
            if first is None:
                return experiment, replace(experiment.log(self._settings), angle=angle[0])
            if first.sample == 0:
                return None  # the start pose itself
            experiment = repaired(experiment, first, changes)
        return None

    def _too_near(self, angle: Array) -> Violation | None:
        """Where a motion [rad], shape (T, J), first brings bodies nearer to each other than the margin."""
        machine, margin = self._machine, self._settings.design.clearance_m
        if machine is None or margin is None:
            return None
        rest = self._settings.arm.pose(self._settings.start_pose)
        found = machine.checker.first_below(machine.joined({machine.sides[0]: angle}, rest), margin)
        return None if found is None else meeting(angle, found[0])

    def information(self, experiment: Experiment) -> Array | None:
        """Return the information of an experiment as it is, shape (F, F); None where it diverges."""
        rows = self._simulate(experiment, len(self._candidates))
        if rows is None:
            return None
        slopes = (rows[1:] - rows[0])[:, :, self._outputs] / FINE_STEP
        return np.sum([information(slopes[:, :, k], self._noise) for k in range(len(self._outputs))], axis=0)

    def _simulate(self, experiment: Experiment, count: int) -> Array | None:
        """All joints' angles [rad], (count, T, J), of the first candidates; None where one diverged."""
        log = experiment.log(self._settings)
        passive = self._settings.simulation.other_joints == "passive"
        moving = np.flatnonzero(log.driven | passive | np.isin(np.arange(log.joints), self._outputs))
        simulation = make_simulation(self._spec, log, moving.tolist(), self._settings)
        response = simulation.simulate(self._candidates[:count])
        if not response.feasible.all():
            return None
        angle = np.tile(log.angle, (count, 1, 1))
        angle[:, :, moving] = response.angle
        return angle
