"""The search for the next experiment: start pose,
joints and commands with the most useful information.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and
random changes of the best. The design is local: motions and sensitivities are simulated at the
present estimate. Where that is far from the truth, design again after the next fit.
Only the simulated motion is kept within the limits;
an arm that differs from the model moves differently.
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
from hydroid.words import listed

PRIOR_SD = 1.0
"""relative standard deviation that a forecast assumes of every parameter at most (ours): a fit's
own prior is so weak that a direction which stays unknown would outweigh all that an
experiment can do"""


def forecast(known: Posterior) -> Posterior:
    """Return what is known if every parameter is known to PRIOR_SD at least."""
    return known.add(np.eye(len(known.root)) / PRIOR_SD)


def measured(settings: DesignSettings, signals: Sequence[Array], period: float) -> Array:
    """Return rows N of the information N' N that signals of the joints' angles give, shape (p, p).

    `signals` are derivatives by p parameters [rad], (p, T). The errors of a future log are those of
    an error model: the sensor's noise, and a drift.
    """
    noise, drift = np.radians([settings.noise_deg, settings.drift_deg])
    rows = [whitened(one, period, noise**2, drift**2 / 10.0) for one in signals]
    p = len(rows[0])
    floor = 1e-6 * max(float(np.abs(row).max()) for row in rows) + np.finfo(float).tiny
    return regular(np.vstack([floor * np.eye(p), *(row.T for row in rows)]))


POSES = 50  # that show which distances change
DIVERGES = "a simulation diverges"
MOVED = 0.9
"""part of its deviation before up to which an experiment must bring a parameter that counts"""


class Trial(NamedTuple):
    """A simulated experiment that keeps the limits.

    experiment: its commands. gained: rows of its information (`measured`), shape (p, p). log: its
    commands with the simulated angles.
    """

    experiment: Experiment
    gained: Array
    log: Log


class Broken(NamedTuple):
    """Why an experiment cannot be made: what it does, against which setting,
    in what part of its time."""

    what: str
    setting: str
    share: float


DIVERGED = Broken(DIVERGES, "design", 1.0)


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
        # no command can keep bodies apart whose distance no joint changes
        self._counted = np.empty(0, bool)
        if self._machine is not None:
            low, high = np.array([joint.limits for joint in arm.joints]).T
            drawn = np.random.default_rng(0).uniform(low, high, (POSES, len(low)))
            rest = dict.fromkeys(self._machine.sides, drawn)
            self._counted = self._machine.checker.changing(self._machine.joined(rest, self._pose))
        self._box, self._axes = known.box, known.axes(1e-5).one_sided  # little curvature

    def trial(self, experiment: Experiment) -> Trial | Broken:
        """Return the experiment, levels reversed or reduced until it keeps the limits,
        and its information.

        Or the limit that it still breaks.
        """
        for left in range(59, -1, -1):
            (angle,) = self._simulate(experiment, self._box.at[None])
            if not np.isfinite(angle).all():
                return DIVERGED
            beyond_limits = violation(angle, self._settings)
            first = beyond_limits or self._meeting(angle)
            if first is None:
                return self._kept(experiment, angle)
            if not left or first.sample == 0:  # the start pose itself
                return self._broken(angle, beyond_limits)
            experiment = repaired(experiment, first)
        return DIVERGED

    def _meeting(self, angle: Array) -> Violation | None:
        """Where bodies first come too near in a motion of all joints, (T, J)."""
        if (machine := self._machine) is None:
            return None
        motion = machine.joined({machine.sides[0]: angle}, self._pose)
        near = machine.checker.first_below(motion, self._margin or 0.0, self._counted)
        if near is None:
            return None
        # the joint that turned most lately is the cause; those far out count as the others do
        turned = np.ptp(angle[max(0, near - 20) : near + 1], axis=0)
        return Violation(near, int(np.argmax(turned)), False)

    def _broken(self, angle: Array, first: Violation | None) -> Broken:
        """What a motion of all joints, (T, J), breaks: at first a joint's limits, or None:
        bodies meet."""
        limits = self._settings.design
        if first is not None:
            out, fast = (float(one[:, first.joint].mean()) for one in beyond(angle, self._settings))
            name = self._settings.arm.joint_names[first.joint]
            if first.fast:
                return Broken(f"{name} faster than {limits.speed_deg_s:g} deg/s", "design.speed_deg_s", fast)
            what = f"{name} nearer than {limits.margin_deg:g} deg to an end of its range"
            return Broken(what, "design.margin_deg", out)
        assert self._machine is not None
        motion = self._machine.joined({self._machine.sides[0]: angle}, self._pose)
        pair, share = self._machine.checker.below(motion, self._margin or 0.0, self._counted)
        return Broken(f"{listed(pair)} nearer than {self._margin:g} m", "design.clearance_m", share)

    def _kept(self, experiment: Experiment, angle: Array) -> Trial | Broken:
        """The trial of an experiment whose angles are known, (T, J); it may diverge beside them."""

        def outputs(theta: Array) -> Array:
            return self._simulate(experiment, theta)[:, :, self._outputs].reshape(len(theta), -1)

        slopes = differentiate(outputs, self._box, self._axes, angle[:, self._outputs].ravel())
        if not np.isfinite(slopes).all():
            return DIVERGED
        each = np.moveaxis(slopes.reshape(len(slopes), -1, len(self._outputs)), -1, 0)
        gained = measured(self._settings.design, [*each], self._settings.log.period_s)
        return Trial(experiment, gained, replace(experiment.log(self._settings), angle=angle))

    def _simulate(self, experiment: Experiment, theta: Array) -> Array:
        """All joints' angles [rad] of candidates, (n, P) -> (n, T, J);
        NaN of what moves if one diverged."""
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

    random: those drawn at random that keep the limits. known: what is known without it. moved:
    which of the p parameters any of these improves (`MOVED`), but for effects of a group of logs,
    which belong to another day, (p,); the others must not hide them. names: of the parameters.
    """

    best: Trial
    random: tuple[Trial, ...]
    known: Posterior
    moved: Mask
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
        """Relative standard deviation of each parameter after a random experiment, the median;
        (p,)."""
        return np.median([self.known.add(t.gained).deviations for t in self.random], axis=0)


def typical(known: Posterior, moved: Mask) -> float:
    """Return the geometric mean of the relative standard deviations of some parameters,
    a mask (p,)."""
    return float(np.exp(np.mean(np.log(known.deviations[moved]))))


def broken_limits(broken: Sequence[Broken]) -> SettingsError:
    """Return the error that no experiment keeps the limits:
    it names the one that is broken most often."""
    often = Counter(one[:2] for one in broken)
    ((what, setting), times) = often.most_common(1)[0]
    shares = [one.share for one in broken if one.what == what]
    return SettingsError(
        f"none of {len(broken)} random experiments keeps the limits in simulation: {what} in {times} of "
        f"them, there for {100 * np.mean(shares):.0f} % of the time",
        setting,
        "allow more speed, less margin or clearance, a smaller command, or other poses",
    )


def design(settings: FitSettings, theta: Array, logs: Sequence[Log], seed: int, progress: Progress) -> Design:
    """Choose start pose, joints and commands of an experiment at an estimate, shape (P,),
    beside its logs.

    Random experiments are drawn and kept within the limits. The best few are then changed at
    random, and a changed one replaces the worst of them where it is better.
    The same seed gives the same experiment.
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
    random, broken = list[Trial](), list[Broken]()
    first = max(min(8, effort), effort // 6)  # one in six is drawn at random
    for drawn in range(1, first + 1):
        trial = simulator.trial(experiments.draw())
        if isinstance(trial, Trial):
            random.append(trial)
        else:
            broken.append(trial)
        progress("random experiments", drawn, effort)
    if not random:
        raise broken_limits(broken)
    names = parameters.named(known.box.varied)
    moved = moved_by(random, known, np.array([settings.parameters[name].per is None for name in names]))

    def score(trial: Trial) -> float:
        return -typical(known.add(trial.gained), moved)

    elite = sorted(((score(t), i, t) for i, t in enumerate(random)), reverse=True)[:4]
    for tried in range(first + 1, effort + 1):
        parent = elite[min(rng.integers(len(elite)), rng.integers(len(elite)))][2]
        child = simulator.trial(experiments.change(parent.experiment))
        if isinstance(child, Trial) and score(child) > elite[-1][0]:
            elite = sorted([*elite[:-1], (score(child), tried, child)], reverse=True)
        progress(f"improving: typically {-100 * elite[0][0]:.3g} %", tried, effort)
    return Design(elite[0][2], tuple(random), known, moved, names)


def moved_by(random: Sequence[Trial], known: Posterior, counted: Mask) -> Mask:
    """Return which counted parameters any random experiment improves, (p,);
    all counted if there is none."""
    least = np.min([known.add(trial.gained).deviations for trial in random], axis=0)
    moved = counted & (least < MOVED * known.deviations)
    return moved if moved.any() else counted | ~counted.any()
