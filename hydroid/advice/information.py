"""What measurements add to what is known, and what an experiment within the limits would measure.

Only the simulated motion is kept within the limits; an arm that differs from the model moves differently.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from hydroid.advice.experiment import Experiment, Violation, experiment_samples, repaired, violation
from hydroid.arm.model import load_machine, load_model
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.noise import Noise
from hydroid.posterior.posterior import Posterior
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import make_simulation
from hydroid.search.axes import differentiate
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings

PRIOR_SD = 1.0
"""relative standard deviation that a forecast assumes of every parameter at most (ours): a fit's own prior is
so weak that a direction which stays unknown would outweigh all that an experiment can do"""


def forecast(known: Posterior) -> Posterior:
    """Return what is known if every parameter is known to PRIOR_SD at least."""
    return known.add(np.eye(len(known.root)) / PRIOR_SD)


def measured(signals: Iterable[tuple[Array, Noise]]) -> Array:
    """Return rows N of the information N' N that a least-squares fit gains from signals, shape (p, p).

    It is (J J') (J S J')^-1 (J J'), the inverse covariance of plain least squares. That is less than the
    Fisher information unless the noise is white.

    Args:
        signals: derivatives per relative change, (p, T), and the noise.
    """
    parts = [(slopes @ slopes.T, noise.covariance_of(slopes)) for slopes, noise in signals]
    bread, scatter = np.sum(parts, axis=0)
    floor = 1e-12 * np.trace(scatter) + np.finfo(float).tiny
    lower = np.linalg.cholesky(scatter + floor * np.eye(len(scatter)))
    return np.asarray(solve_triangular(lower, bread, lower=True), dtype=float)


def sensor_noise(settings: DesignSettings, samples: int, period: float) -> Noise:
    """Return the noise of a future log of angles [rad]: white, or a first-order autoregression."""
    level, time = float(np.radians(settings.noise_deg)), settings.noise_correlation_s
    reflection = np.array([-np.exp(-period / time)]) if time > 0 else np.empty(0)
    return Noise(samples, level, reflection, "settings")


class Trial(NamedTuple):
    """A simulated experiment that keeps the limits.

    experiment: its commands. gained: rows of its information (`measured`), shape (p, p). log: its commands
    with the simulated angles.
    """

    experiment: Experiment
    gained: Array
    log: Log


class ExperimentSimulator:
    """Simulates experiments at an estimate within the limits of the settings."""

    def __init__(self, settings: FitSettings, known: Posterior) -> None:
        self._spec = load_model(settings.arm)
        if settings.simulation.other_joints == "measured":  # an experiment has no measured motion
            settings = settings.changed({"simulation.other_joints": "locked"})
        self._settings, self._outputs = settings, [j - 1 for j in settings.outputs]
        self._period, self._bindings = settings.log.period_s, Bindings(settings)
        self._noise = sensor_noise(settings.design, experiment_samples(settings), self._period)
        arm, self._machine = settings.arm, None
        if settings.design.clearance_m is not None:
            self._machine = load_machine(arm, pair=arm.pair is not None)
        self._box, self._axes = known.box, known.axes(1e-5).one_sided  # little curvature

    def trial(self, experiment: Experiment) -> Trial | None:
        """Return the experiment, changed to keep the limits, with its information; None where it cannot."""
        if (kept := self.within_limits(experiment)) is None:
            return None
        experiment, log = kept
        gained = self.information(experiment, log.angle)
        return None if gained is None else Trial(experiment, gained, log)

    def within_limits(self, experiment: Experiment) -> tuple[Experiment, Log] | None:
        """Reverse or reduce levels until the experiment keeps the limits; return it and its predicted log.

        None where it still breaks them, or its simulation diverges.
        """
        for _ in range(60):
            (angle,) = self._simulate(experiment, self._box.at[None])
            if not np.isfinite(angle).all():
                return None
            first = violation(angle, self._period, self._settings.arm, self._settings.design)
            first = first or self._too_near(angle)
            if first is None:
                return experiment, replace(experiment.log(self._settings), angle=angle)
            if first.sample == 0:
                return None  # the start pose itself
            experiment = repaired(experiment, first)
        return None

    def _too_near(self, angle: Array) -> Violation | None:
        """Where a motion [rad], shape (T, J), first brings bodies nearer to each other than the margin."""
        machine, margin = self._machine, self._settings.design.clearance_m
        if machine is None or margin is None:
            return None
        rest = self._settings.arm.pose(self._settings.start_pose)
        found = machine.checker.first_below(machine.joined({machine.sides[0]: angle}, rest), margin)
        if found is None:
            return None
        # the cause is the joint that turned most lately; joints far out on the arm count as the others do
        turned = np.ptp(angle[max(0, found[0] - 20) : found[0] + 1], axis=0)
        return Violation(found[0], int(np.argmax(turned)), False)

    def information(self, experiment: Experiment, angle: Array) -> Array | None:
        """Return the information of an experiment whose angles are known, (T, J); None where it diverges."""

        def outputs(theta: Array) -> Array:
            return self._simulate(experiment, theta)[:, :, self._outputs].reshape(len(theta), -1)

        value = angle[:, self._outputs].ravel()
        slopes = differentiate(outputs, self._box, self._axes, value)
        if not np.isfinite(slopes).all():
            return None
        each = slopes.reshape(len(slopes), -1, len(self._outputs))
        return measured((each[:, :, k], self._noise) for k in range(len(self._outputs)))

    def _simulate(self, experiment: Experiment, theta: Array) -> Array:
        """All joints' angles [rad] of candidates, (n, P) -> (n, T, J); NaN where one diverged."""
        log = experiment.log(self._settings)
        passive = self._settings.simulation.other_joints == "passive"
        moving = np.flatnonzero(log.driven | passive | np.isin(np.arange(log.joints), self._outputs))
        simulation = make_simulation(self._spec, log, moving.tolist(), self._settings)
        response = simulation.simulate(self._bindings.candidates(theta))
        angle = np.tile(log.angle, (len(theta), 1, 1))
        angle[:, :, moving] = response.angle
        angle[~response.feasible] = np.nan
        return angle
