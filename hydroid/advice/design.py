"""The search for the next experiment: start pose, joints and commands with the most useful information.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and random
changes of the best. The design is local: motions and sensitivities are simulated at the present estimate.
Where that is far from the truth, design again after the next fit.
Only the simulated motion is kept within the limits; an arm that differs from the model moves differently.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hydroid.advice.experiment import (
    Experiment,
    RandomExperiments,
    Violation,
    repaired,
    violation,
)
from hydroid.arm.model import load_machine, load_model
from hydroid.arrays import Array, record
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.posterior.error_model import whitened
from hydroid.posterior.linear import estimate_box, prior_slopes, white_posterior
from hydroid.posterior.posterior import Posterior, regular
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.bindings import Bindings
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem, make_simulation
from hydroid.progress import Progress
from hydroid.search.axes import differentiate
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import DesignSettings

PRIOR_SD = 1.0
"""relative standard deviation that a forecast assumes of every parameter at most (ours): a fit's own prior is
so weak that a direction which stays unknown would outweigh all that an experiment can do"""


def forecast(known: Posterior) -> Posterior:
    """Return what is known if every parameter is known to PRIOR_SD at least."""
    return known.add(np.eye(len(known.root)) / PRIOR_SD)


def measured(settings: DesignSettings, signals: Sequence[Array], period: float) -> Array:
    """Return rows N of the information N' N that signals of the joints' angles give, shape (p, p).

    `signals` are derivatives by p parameters [rad], (p, T). The errors of a future log are those of an error
    model: the sensor's noise, and a drift.
    """
    noise, drift = np.radians([settings.noise_deg, settings.drift_deg])
    rows = [whitened(one, period, noise**2, drift**2 / 10.0) for one in signals]
    p = len(rows[0])
    floor = 1e-6 * max(float(np.abs(row).max()) for row in rows) + np.finfo(float).tiny
    return regular(np.vstack([floor * np.eye(p), *(row.T for row in rows)]))


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
        if settings.simulation.other_joints == "measured":  # an experiment has no measured motion
            settings = settings.changed({"simulation.other_joints": "locked"})
        self._settings, self._bindings = settings, Bindings(settings)
        self._outputs = [j - 1 for j in settings.outputs]
        arm, self._margin = settings.arm, settings.design.clearance_m
        self._spec, self._pose = load_model(arm), arm.pose(settings.start_pose)
        self._machine = None if self._margin is None else load_machine(arm, pair=arm.pair is not None)
        self._box, self._axes = known.box, known.axes(1e-5).one_sided  # little curvature

    def trial(self, experiment: Experiment) -> Trial | None:
        """Return the experiment, levels reversed or reduced until it keeps the limits, and its information.

        None where it still breaks them, or a simulation diverges.
        """
        for _ in range(60):
            (angle,) = self._simulate(experiment, self._box.at[None])
            if not np.isfinite(angle).all():
                return None
            first, machine = violation(angle, self._settings), self._machine
            if first is None and machine is not None:
                motion = machine.joined({machine.sides[0]: angle}, self._pose)
                if (near := machine.checker.first_below(motion, self._margin or 0.0)) is not None:
                    # the joint that turned most lately is the cause; those far out count as the others do
                    turned = np.ptp(angle[max(0, near - 20) : near + 1], axis=0)
                    first = Violation(near, int(np.argmax(turned)), False)
            if first is None:
                return self._kept(experiment, angle)
            if first.sample == 0:
                return None  # the start pose itself
            experiment = repaired(experiment, first)
        return None

    def _kept(self, experiment: Experiment, angle: Array) -> Trial | None:
        """The trial of an experiment whose angles are known, (T, J); None where it diverges beside them."""

        def outputs(theta: Array) -> Array:
            return self._simulate(experiment, theta)[:, :, self._outputs].reshape(len(theta), -1)

        slopes = differentiate(outputs, self._box, self._axes, angle[:, self._outputs].ravel())
        if not np.isfinite(slopes).all():
            return None
        each = np.moveaxis(slopes.reshape(len(slopes), -1, len(self._outputs)), -1, 0)
        gained = measured(self._settings.design, each, self._settings.log.period_s)
        return Trial(experiment, gained, replace(experiment.log(self._settings), angle=angle))

    def _simulate(self, experiment: Experiment, theta: Array) -> Array:
        """All joints' angles [rad] of candidates, (n, P) -> (n, T, J); NaN of what moves if one diverged."""
        log = experiment.log(self._settings)
        passive = self._settings.simulation.other_joints == "passive"
        moving = np.flatnonzero(log.driven | passive | np.isin(np.arange(log.joints), self._outputs))
        simulation = make_simulation(self._spec, log, moving.tolist(), self._settings)
        angle = np.tile(log.angle, (len(theta), 1, 1))
        angle[:, :, moving] = simulation.simulate(self._bindings.candidates(theta)).angle
        return angle


@record
class Design:
    """A designed experiment beside the random ones it was chosen from.

    random: those drawn at random that keep the limits. known: what is known without it. directions:
    orthonormal basis of the directions that such experiments improve on PRIOR_SD, (p, d); the others stay at
    it, and must not hide them. names: of the p parameters.
    """

    best: Trial
    random: tuple[Trial, ...]
    known: Posterior
    directions: Array
    names: tuple[str, ...]

    @property
    def log(self) -> Log:
        """The commands to run, every angle in the start pose."""
        angle = np.broadcast_to(self.best.experiment.pose, self.best.log.angle.shape)
        return replace(self.best.log, angle=angle)

    @property
    def after(self) -> Posterior:
        """What is known after the experiment."""
        return self.known.add(self.best.gained)

    @property
    def random_deviations(self) -> Array:
        """Relative standard deviation of each parameter after a random experiment, the median; (p,)."""
        return np.median([self.known.add(t.gained).deviations for t in self.random], axis=0)


def weakest(known: Posterior, directions: Array) -> float:
    """Relative standard deviation of the least known of some directions, (p, d)."""
    return np.sqrt(np.linalg.eigh(directions.T @ known.covariance @ directions)[0][-1])


def design(settings: FitSettings, theta: Array, logs: Sequence[Log], seed: int, progress: Progress) -> Design:
    """Choose start pose, joints and commands of an experiment at an estimate, shape (P,), beside its logs.

    Random experiments are drawn and kept within the limits. The best few are then changed at random, and a
    changed one replaces the worst of them where it is better. The same seed gives the same experiment.
    """
    effort, parameters = settings.design.effort, settings.parameter_set()
    rng = np.random.default_rng(seed)
    if logs:
        fitted = uncertainty(Problem(settings, logs), theta).posterior
    else:
        box = estimate_box(parameters, theta)
        fitted = white_posterior(box, prior_slopes(Priors(settings.priors, parameters), box))
    known = forecast(fitted)
    experiments, simulator = RandomExperiments(settings, rng), ExperimentSimulator(settings, known)
    random: list[Trial] = []
    first = max(min(8, effort), effort // 6)  # one in six is drawn at random
    for drawn in range(1, first + 1):
        trial = simulator.trial(experiments.draw())
        random += [trial] if trial is not None else []
        progress("random experiments", drawn, effort)
    if not random:
        raise SettingsError(
            f"none of {first} random experiments keeps the limits in simulation",
            "design",
            "allow more speed, less margin or clearance, a smaller command, or other poses",
        )
    typical = np.mean([t.gained.T @ t.gained for t in random], axis=0)
    values, vectors = np.linalg.eigh(fitted.root.T @ fitted.root + typical)
    directions = vectors[:, (values > 1 / PRIOR_SD**2) | (values == values[-1])]

    def score(trial: Trial) -> float:
        return -weakest(known.add(trial.gained), directions)

    elite = sorted(((score(t), i, t) for i, t in enumerate(random)), reverse=True)[:4]
    for tried in range(first + 1, effort + 1):
        parent = elite[min(rng.integers(len(elite)), rng.integers(len(elite)))][2]
        child = simulator.trial(experiments.change(parent.experiment))
        if child is not None and score(child) > elite[-1][0]:
            elite = sorted([*elite[:-1], (score(child), tried, child)], reverse=True)
        progress(f"improving: weakest {-100 * elite[0][0]:.3g} %", tried, effort)
    return Design(elite[0][2], tuple(random), known, directions, parameters.named(known.box.varied))
