"""The search for the next experiment: start pose,
joints and commands with the most useful information.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by
random draws and random changes of the best. The design is local: motions and
sensitivities are simulated at the present estimate. Where that is far from the truth,
design again after the next fit. Only the simulated motion is kept within the limits; an
arm that differs from the model moves differently.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hydroid.advice.experiment import (
    Experiment,
    RandomExperiments,
    Violation,
    beyond,
    repaired,
    violation,
)
from hydroid.arm.model import load_machine, load_model
from hydroid.arrays import Array, Mask, record
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.posterior.error_filter import whitened
from hydroid.posterior.linear import estimate_box, prior_slopes, white_posterior
from hydroid.posterior.posterior import Posterior, regular
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.bindings import Bindings
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.search.axes import differentiate
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import DesignSettings
from hydroid.simulation import make_simulation
from hydroid.simulation.roles import roles
from hydroid.words import listed

PRIOR_SD = 1.0
"""relative standard deviation that a forecast assumes of every parameter at most
(ours): a fit's own prior is so weak that a direction which stays unknown would outweigh
all that an experiment can do"""
POSES = 50
"""random poses that show which distances change"""
ATTEMPTS = 60
"""to make an experiment keep the limits"""
ELITE = 4
"""experiments that are changed at random, the best so far"""
MOVED = 0.9
"""part of its deviation before up to which an experiment must bring a parameter that
counts"""
LATELY = 20
"""samples before bodies meet, over which the joint that turned most is the cause"""


def forecast(posterior: Posterior) -> Posterior:
    """Return a posterior in which no relative standard deviation exceeds PRIOR_SD."""
    return posterior.add(np.eye(len(posterior.root)) / PRIOR_SD)


def information(
    settings: DesignSettings, signals: Sequence[Array], period: float
) -> Array:
    """Return rows N of the information N' N that signals of the joints' angles give,
    shape (p, p).

    `signals` are derivatives by p parameters [rad], (p, T). The errors of a future log
    are those of an error model: the sensor's noise, and a drift.
    """
    noise, drift = np.radians([settings.noise_deg, settings.drift_deg])
    sensor = noise**2
    # the drift is stated after 10 s, and its variance grows with time
    rate = drift**2 / 10.0
    rows = [whitened(signal, period, sensor, rate) for signal in signals]
    p = len(rows[0])
    largest = max(float(np.abs(row).max()) for row in rows)
    # a little information about everything, so that what nothing shows stays finite
    floor = 1e-6 * largest + np.finfo(float).tiny
    weak = floor * np.eye(p)
    return regular(np.vstack([weak, *(row.T for row in rows)]))


class Trial(NamedTuple):
    """A simulated experiment that keeps the limits.

    Attributes:
        experiment: its commands.
        gained: rows of its information (`information`), shape (p, p).
        log: its commands with the simulated angles.
    """

    experiment: Experiment
    gained: Array
    log: Log


class Broken(NamedTuple):
    """Why an experiment cannot be made.

    Attributes:
        what: it does.
        setting: that forbids it.
        share: of its time in which it does so.
    """

    what: str
    setting: str
    share: float


DIVERGED = Broken("a simulation diverges", "design", 1.0)


class ExperimentSimulator:
    """Simulates experiments at an estimate within the limits of the settings."""

    def __init__(self, settings: FitSettings, posterior: Posterior) -> None:
        # an experiment has no measured motion
        if settings.simulation.other_joints == "measured":
            settings = settings.changed({"simulation.other_joints": "locked"})
        arm = settings.arm
        self._settings = settings
        self._bindings = Bindings(settings)
        self._outputs = [j - 1 for j in settings.outputs]
        self._spec = load_model(arm)
        self._pose = arm.pose(settings.start_pose)
        self._box = posterior.box
        # steps so short that curvature matters little
        self._axes = posterior.axes(1e-5).one_sided
        self._margin = settings.design.clearance_m
        self._machine = None
        self._counted = np.empty(0, bool)
        if self._margin is not None:
            self._machine = load_machine(arm, pair=arm.pair is not None)
            # no command can keep bodies apart whose distance no joint changes
            low, high = np.array([joint.limits for joint in arm.joints]).T
            # always the same poses: the design is to depend on its own seed alone
            rng = np.random.default_rng(0)
            poses = rng.uniform(low, high, (POSES, len(low)))
            of_sides = dict.fromkeys(self._machine.sides, poses)
            motion = self._machine.joined(of_sides, self._pose)
            self._counted = self._machine.checker.changing(motion)

    def trial(self, experiment: Experiment) -> Trial | Broken:
        """Return the experiment, levels reversed or reduced until it keeps the limits,
        and its information.

        Or the limit that it still breaks.
        """
        for attempt in range(ATTEMPTS):
            (angle,) = self._simulate(experiment, self._box.at[None])
            if not np.isfinite(angle).all():
                return DIVERGED
            of_joint = violation(angle, self._settings)
            first = of_joint or self._meeting(angle)
            if first is None:
                return self._kept(experiment, angle)
            in_start_pose = first.sample == 0
            if in_start_pose or attempt == ATTEMPTS - 1:
                return self._broken(angle, of_joint)
            experiment = repaired(experiment, first)
        return DIVERGED

    def _meeting(self, angle: Array) -> Violation | None:
        """Return where bodies first come too near in a motion of all joints, (T, J)."""
        machine = self._machine
        if machine is None:
            return None
        motion = machine.joined({machine.sides[0]: angle}, self._pose)
        near = machine.checker.first_below(motion, self._margin or 0.0, self._counted)
        if near is None:
            return None
        # the joint that turned most lately is the cause; those far out count as the
        # others do
        lately = angle[max(0, near - LATELY) : near + 1]
        turned = np.ptp(lately, axis=0)
        return Violation(near, int(np.argmax(turned)), False)

    def _broken(self, angle: Array, first: Violation | None) -> Broken:
        """Return what a motion of all joints, (T, J), breaks: at first a joint's
        limits, or None: bodies meet."""
        if first is None:
            return self._too_near(angle)
        limits = self._settings.design
        joint = self._settings.arm.joints[first.joint]
        shown = joint.shown
        outside, fast = beyond(angle, self._settings)
        if first.fast:
            share = float(fast[:, first.joint].mean())
            speed = f"{shown.of_degrees(limits.speed_deg_s):.4g} {shown.unit}/s"
            what = f"{joint.name} faster than {speed}"
            return Broken(what, "design.speed_deg_s", share)
        share = float(outside[:, first.joint].mean())
        margin = f"{shown.of_degrees(limits.margin_deg):.4g} {shown.unit}"
        what = f"{joint.name} nearer than {margin} to an end of its range"
        return Broken(what, "design.margin_deg", share)

    def _too_near(self, angle: Array) -> Broken:
        """Return which bodies are too near in a motion of all joints, (T, J)."""
        machine = self._machine
        assert machine is not None
        motion = machine.joined({machine.sides[0]: angle}, self._pose)
        pair, share = machine.checker.below(motion, self._margin or 0.0, self._counted)
        what = f"{listed(pair)} nearer than {self._margin:g} m"
        return Broken(what, "design.clearance_m", share)

    def _kept(self, experiment: Experiment, angle: Array) -> Trial | Broken:
        """Return the trial of an experiment whose angles are known, (T, J); it may
        diverge beside them."""

        def outputs(theta: Array) -> Array:
            angles = self._simulate(experiment, theta)[:, :, self._outputs]
            return angles.reshape(len(theta), -1)

        at_estimate = angle[:, self._outputs].ravel()
        slopes = differentiate(outputs, self._box, self._axes, at_estimate)
        if not np.isfinite(slopes).all():
            return DIVERGED
        of_angles = slopes.reshape(len(slopes), -1, len(self._outputs))
        signals = [*np.moveaxis(of_angles, -1, 0)]
        gained = information(
            self._settings.design, signals, self._settings.log.period_s
        )
        log = replace(experiment.log(self._settings), angle=angle)
        return Trial(experiment, gained, log)

    def _simulate(self, experiment: Experiment, theta: Array) -> Array:
        """Return all joints' angles [rad] of candidates, (n, P) -> (n, T, J);
        NaN of what moves if one diverged."""
        log = experiment.log(self._settings)
        is_output = np.isin(np.arange(log.joints), self._outputs)
        others = self._settings.simulation.other_joints
        of_joints = roles(log.driven | is_output, others)
        moving = np.flatnonzero(of_joints.simulated)
        simulation = make_simulation(self._spec, log, moving.tolist(), self._settings)
        candidates = self._bindings.candidates(theta)
        angle = np.tile(log.angle, (len(theta), 1, 1))
        angle[:, :, moving] = simulation.simulate(candidates).angle
        return angle


@record
class Design:
    """A designed experiment beside the random ones it was chosen from.

    Attributes:
        best: the designed one.
        random: those drawn at random that keep the limits.
        before: the posterior without it.
        moved: which of the p parameters any random one improves (`MOVED`), but for
            effects of a group of logs, which belong to another day, (p,). Only these
            are scored, so that the others do not hide what an experiment does.
        names: of the parameters.
    """

    best: Trial
    random: tuple[Trial, ...]
    before: Posterior
    moved: Mask
    names: tuple[str, ...]

    @property
    def log(self) -> Log:
        """The commands to run, every angle in the start pose."""
        log = self.best.log
        angle = np.broadcast_to(self.best.experiment.pose, log.angle.shape)
        return replace(log, angle=angle)

    @property
    def after(self) -> Posterior:
        """The posterior after the experiment."""
        return self.before.add(self.best.gained)

    @property
    def random_deviations(self) -> Array:
        """Relative standard deviation of each parameter after a random experiment, the
        median; (p,)."""
        after = [self.before.add(trial.gained).deviations for trial in self.random]
        return np.median(after, axis=0)


def typical(posterior: Posterior, moved: Mask) -> float:
    """Return the geometric mean of the relative standard deviations of some parameters,
    a mask (p,)."""
    logarithms = np.log(posterior.deviations[moved])
    return float(np.exp(np.mean(logarithms)))


def broken_limits(broken: Sequence[Broken]) -> SettingsError:
    """Return the error that no experiment keeps the limits:
    it names the one that is broken most often."""
    counts = Counter((limit.what, limit.setting) for limit in broken)
    ((what, setting), times) = counts.most_common(1)[0]
    share = np.mean([limit.share for limit in broken if limit.what == what])
    most_often = f"{what} in {times} of them, there for {100 * share:.0f} % of the time"
    return SettingsError(
        f"none of {len(broken)} random experiments keeps the limits in simulation: {most_often}",
        setting,
        "allow more speed, less margin or clearance, a smaller command, or other poses",
    )


def design(
    settings: FitSettings,
    theta: Array,
    logs: Sequence[Log],
    seed: int,
    progress: Progress,
) -> Design:
    """Choose start pose, joints and commands of an experiment at an estimate, shape
    (P,), beside its logs.

    Random experiments are drawn and kept within the limits. The best few are then
    changed at random, and a changed one replaces the worst of them where it is better.
    The same seed gives the same experiment.

    Raises SettingsError: no random experiment keeps the limits.
    """
    parameters = settings.parameter_set()
    posterior = forecast(_logs_posterior(settings, theta, logs))
    rng = np.random.default_rng(seed)
    experiments = RandomExperiments(settings, rng)
    simulator = ExperimentSimulator(settings, posterior)
    random = _random_trials(settings, experiments, simulator, progress)
    names = parameters.named(posterior.box.varied)
    lasting = np.array([settings.parameters[name].per is None for name in names])
    moved = moved_by(random, posterior, lasting)

    def score(trial: Trial) -> float:
        return -typical(posterior.add(trial.gained), moved)

    # the number breaks ties: trials themselves cannot be compared
    scored = [(score(trial), number, trial) for number, trial in enumerate(random)]
    elite = sorted(scored, reverse=True)
    # more of them would spread the changes over experiments that are far behind
    elite = elite[:ELITE]
    effort = settings.design.effort
    for tried in range(_random_effort(effort) + 1, effort + 1):
        # of two drawn the better: those at the front are changed more often
        first = rng.integers(len(elite))
        second = rng.integers(len(elite))
        _, _, parent = elite[min(first, second)]
        child = simulator.trial(experiments.change(parent.experiment))
        worst_score, _, _ = elite[-1]
        if isinstance(child, Trial) and score(child) > worst_score:
            elite[-1] = (score(child), tried, child)
            elite.sort(reverse=True)
        best_score, _, best = elite[0]
        progress(f"improving: typically {-100 * best_score:.3g} %", tried, effort)
    _, _, best = elite[0]
    return Design(best, tuple(random), posterior, moved, names)


def _logs_posterior(
    settings: FitSettings, theta: Array, logs: Sequence[Log]
) -> Posterior:
    """Return what logs and priors say at an estimate, shape (P,)."""
    if logs:
        return uncertainty(Problem(settings, logs), theta).posterior
    parameters = settings.parameter_set()
    box = estimate_box(parameters, theta)
    return white_posterior(box, prior_slopes(Priors(settings.priors, parameters), box))


def _random_effort(effort: int) -> int:
    """Return how many experiments are drawn at random, of all that are tried: one in
    six, but 8 at least where there are as many."""
    return max(min(8, effort), effort // 6)


def _random_trials(
    settings: FitSettings,
    experiments: RandomExperiments,
    simulator: ExperimentSimulator,
    progress: Progress,
) -> list[Trial]:
    """Return the random experiments that keep the limits, one at least."""
    effort = settings.design.effort
    kept = list[Trial]()
    broken = list[Broken]()
    for drawn in range(1, _random_effort(effort) + 1):
        trial = simulator.trial(experiments.random())
        if isinstance(trial, Trial):
            kept.append(trial)
        else:
            broken.append(trial)
        progress("random experiments", drawn, effort)
    if not kept:
        raise broken_limits(broken)
    return kept


def moved_by(random: Sequence[Trial], posterior: Posterior, counted: Mask) -> Mask:
    """Return which counted parameters any random experiment improves, (p,);
    all counted if there is none."""
    deviations = [posterior.add(trial.gained).deviations for trial in random]
    moved = counted & (np.min(deviations, axis=0) < MOVED * posterior.deviations)
    if moved.any():
        return moved
    if counted.any():
        return counted
    return np.ones_like(counted)
