"""The next experiment: the one of many that tells most about what is known least.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and a small
evolution. It is local: it believes the present estimate, at which motions and sensitivities are simulated.
Far from the truth, design again after the next fit.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hydroid.errors import SettingsError
from hydroid.experiment.commands import Draw, pose_limits
from hydroid.experiment.information import Judge, log_information, statement_information
from hydroid.experiment.trial import Bench, Trial
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.problem.stage import Stage
from hydroid.settings.fit import FitSettings

ELITE = 4
"""experiments that the evolution keeps"""

Tell = Callable[[str, int, int], None]
"""takes what is being done, how much of it is done, and how much there is"""


@dataclass(frozen=True, eq=False)
class Design:
    """A designed experiment beside the random ones it was chosen from.

    best: the experiment. random: those drawn at random that keep the limits. refused: draws that could not
    be made to. judge: what was known before, and the criterion. names: of the free parameters. tried:
    experiments simulated with all their sensitivities. period: of the commands [s].
    """

    best: Trial
    random: tuple[Trial, ...]
    refused: int
    judge: Judge
    names: tuple[str, ...]
    period: float
    tried: int

    @property
    def log(self) -> Log:
        """The commands to run, every angle in the start pose."""
        return self.best.experiment.log(len(self.best.angle), self.period)

    @property
    def predicted(self) -> Log:
        """The commands with the motion that the present estimate predicts."""
        return replace(self.log, angle=self.best.angle)

    @property
    def random_deviations(self) -> Array:
        """Relative standard deviation of each free parameter after a random experiment, the median; (F,)."""
        return np.median([self.judge.deviations(t.information) for t in self.random], axis=0)

    @property
    def random_weakest(self) -> float:
        """Relative standard deviation of the weakest direction after a random experiment, the median."""
        return float(np.median([self.judge.weakest(t.information)[0] for t in self.random]))


def design(settings: FitSettings, theta: Array, logs: list[Log], seed: int, tell: Tell) -> Design:
    """Choose start pose, joints and commands of an experiment.

    Random experiments are drawn and kept within the limits; the best few are then changed at random, and a
    changed one takes the place of the worst where it is better. The same seed gives the same experiment
    unless `time_limit_s` ends the search.

    Args:
        arm: the arm.
        settings: the model, the free parameters, what is known, and `design`.
        theta: the present estimate, shape (P,).
        logs: records whose information is there already; may be empty.
        seed: of draws and changes.
        tell: is told how far the search is.

    Raises:
        SettingsError: joints or poses that cannot be, or no experiment within the limits was found.
    """
    how = settings.design
    joints = driven_joints(settings)
    rng = np.random.default_rng(seed)
    low, high = pose_limits(settings.arm, np.radians(how.margin_deg))
    draw = Draw(how, joints, start_poses(settings), low, high, settings.log.period_s, rng)
    bench = Bench(settings, theta, draw.period, draw.samples)
    ends = time.monotonic() + how.time_limit_s
    parameters = Stage(settings).parameters
    known = statement_information(Priors(settings.priors, parameters), parameters, theta)
    if logs:
        known = known + log_information(Problem(settings, logs), theta)
    random: list[Trial] = []
    drawn = 0
    for drawn in _until(ends, how.candidates):
        trial = bench.trial(draw.new())
        random += [trial] if trial is not None else []
        tell("random experiments", drawn, how.candidates)
    if not random:
        raise SettingsError(
            f"none of {drawn} random experiments keeps the limits in simulation",
            where="design",
            hint="allow more speed, less margin, a smaller command, or other poses",
        )
    judge = Judge.of(known, np.mean([t.information for t in random], axis=0))
    elite, improved = _evolve(bench, draw, judge, random, how.criterion, ends, how.improvements, tell)
    names = tuple(p.name for p in parameters.parameters if p.fixed is None)
    tried = len(random) + improved
    return Design(elite, tuple(random), drawn - len(random), judge, names, draw.period, tried)


def _evolve(
    bench: Bench,
    draw: Draw,
    judge: Judge,
    random: list[Trial],
    criterion: str,
    ends: float,
    total: int,
    tell: Tell,
) -> tuple[Trial, int]:
    """Change the best experiments; return the best and how many were simulated."""

    def score(trial: Trial) -> float:
        return judge.score(trial.information, criterion)

    elite = sorted(((score(t), i, t) for i, t in enumerate(random)), reverse=True)[:ELITE]
    done = 0
    for done in _until(ends, total):
        parent = elite[min(draw.integer(len(elite)), draw.integer(len(elite)))][2]
        child = bench.trial(draw.changed(parent.experiment))
        if child is not None and (worth := score(child)) > elite[-1][0]:
            elite = sorted([*elite[:-1], (worth, len(random) + done, child)], reverse=True)
        tell(f"improving: weakest {100 * judge.weakest(elite[0][2].information)[0]:.3g} %", done, total)
    return elite[0][2], done


def _until(ends: float, count: int) -> Iterator[int]:
    """Count from 1 to `count`, at least once, until the clock [s] passes `ends`."""
    for k in range(1, count + 1):
        if k > 1 and time.monotonic() > ends:
            return
        yield k


def driven_joints(settings: FitSettings) -> list[int]:
    """Joints that may be driven, 0-based.

    Raises:
        SettingsError: one that the arm lacks, or that no gain of stage 1 serves.
    """
    joints = sorted(settings.design.joints or settings.outputs)
    if joints[-1] > len(settings.arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(settings.arm.joints)}", where="design.joints")
    driven = np.isin(np.arange(len(settings.arm.joints)) + 1, joints)
    Stage(settings).refuse_idle(driven, [j - 1 for j in settings.outputs])
    return [j - 1 for j in joints]


def start_poses(settings: FitSettings) -> Array:
    """Start poses [rad], shape (N, J): the named ones in which what moves is within its limits.

    Raises:
        SettingsError: a name that does not exist, or none is left.
    """
    how = settings.design
    names = tuple(settings.arm.poses) if how.poses is None or how.poses == "any" else how.poses
    poses = np.array([settings.arm.pose(name) for name in names])
    moving = [j - 1 for j in {*(how.joints or ()), *settings.outputs}]
    margin = np.radians(how.margin_deg)
    inside = (poses >= settings.arm.lower + margin) & (poses <= settings.arm.upper - margin)
    poses = poses[inside[:, moving].all(axis=1)]
    if not len(poses) and how.poses != "any":
        raise SettingsError(
            f"no pose of {', '.join(names)} is {how.margin_deg:g} deg inside the ranges of what moves",
            where="design.poses",
            hint="add one to the arm's file, reduce design.margin_deg, or set design.poses=any",
        )
    return poses
