"""The search for the next experiment: start pose, joints and commands with the most useful information.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and random
changes of the best. The design is local: motions and sensitivities are simulated at the present estimate.
Where that is far from the truth, design again after the next fit.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.advice.commands import RandomExperiments
from hydroid.advice.information import (
    ExperimentSimulator,
    Precision,
    Trial,
    log_information,
    prior_information,
)
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.problem.stage import Stage
from hydroid.progress import Progress, no_progress
from hydroid.settings.fit import FitSettings

ELITE = 4
"""number of best experiments that are kept and changed"""


@dataclass(frozen=True, eq=False)
class Design:
    """A designed experiment beside the random ones it was chosen from.

    Attributes:
        best: the experiment.
        random: those drawn at random that keep the limits.
        precision: how precisely the parameters are known without it.
        names: of the free parameters.
        period: of the commands [s].
        tried: number of experiments simulated with all their sensitivities.
    """

    best: Trial
    random: tuple[Trial, ...]
    precision: Precision
    names: tuple[str, ...]
    period: float
    tried: int

    @property
    def log(self) -> Log:
        """The commands to run, every angle in the start pose."""
        angle = np.broadcast_to(self.best.experiment.pose, self.best.log.angle.shape)
        return replace(self.best.log, angle=angle)

    @property
    def predicted(self) -> Log:
        """The commands with the motion that the present estimate predicts."""
        return self.best.log

    @property
    def random_deviations(self) -> Array:
        """Relative standard deviation of each free parameter after a random experiment, the median; (F,)."""
        return np.median([self.precision.deviations(t.information) for t in self.random], axis=0)

    @property
    def random_weakest(self) -> float:
        """Relative standard deviation of the weakest direction after a random experiment, the median."""
        return float(np.median([self.precision.weakest(t.information)[0] for t in self.random]))


def design(
    settings: FitSettings, theta: Array, logs: Sequence[Log], seed: int, progress: Progress = no_progress
) -> Design:
    """Choose start pose, joints and commands of an experiment.

    Random experiments are drawn and kept within the limits. The best few are then changed at random, and a
    changed one replaces the worst of them where it is better. The same seed gives the same experiment unless
    `time_limit_s` ends the search.

    Args:
        settings: the model, the free parameters, the priors, and `design`.
        theta: the present estimate, shape (P,).
        logs: records whose information is there already; may be empty.
        seed: of draws and changes.
        progress: called with the number of experiments so far.

    Raises:
        SettingsError: joints or poses that cannot be used, or no experiment within the limits was found.
    """
    limits, parameters = settings.design, Stage(settings).parameters
    rng = np.random.default_rng(seed)
    experiments, simulator = RandomExperiments(settings, rng), ExperimentSimulator(settings, theta)
    end = time.monotonic() + limits.time_limit_s
    known = prior_information(Priors(settings.priors, parameters), parameters, theta)
    if logs:
        known = known + log_information(Problem(settings, logs), theta)
    random: list[Trial] = []
    drawn = 0
    for drawn in _until(end, limits.candidates):
        trial = simulator.trial(experiments.draw())
        random += [trial] if trial is not None else []
        progress("random experiments", drawn, limits.candidates)
    if not random:
        raise SettingsError(
            f"none of {drawn} random experiments keeps the limits in simulation",
            where="design",
            hint="allow more speed, less margin or clearance, a smaller command, or other poses",
        )
    precision = Precision.of(known, np.mean([t.information for t in random], axis=0))

    def score(trial: Trial) -> float:
        return precision.score(trial.information, limits.criterion)

    elite = sorted(((score(t), i, t) for i, t in enumerate(random)), reverse=True)[:ELITE]
    changed = 0
    for changed in _until(end, limits.improvements):
        parent = elite[min(rng.integers(len(elite)), rng.integers(len(elite)))][2]
        child = simulator.trial(experiments.change(parent.experiment))
        if child is not None and score(child) > elite[-1][0]:
            elite = sorted([*elite[:-1], (score(child), len(random) + changed, child)], reverse=True)
        weakest, _ = precision.weakest(elite[0][2].information)
        progress(f"improving: weakest {100 * weakest:.3g} %", changed, limits.improvements)
    names = tuple(p.name for p in parameters.parameters if p.fixed is None)
    tried = len(random) + changed
    return Design(elite[0][2], tuple(random), precision, names, settings.log.period_s, tried)


def _until(end: float, count: int) -> Iterator[int]:
    """Count from 1 to `count`, at least once, until the clock [s] passes `end`."""
    for k in range(1, count + 1):
        if k > 1 and time.monotonic() > end:
            return
        yield k
