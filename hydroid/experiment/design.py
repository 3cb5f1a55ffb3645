"""Design of the next experiment: of many, the one with most information about what is known least.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and a small
evolution. The design is local: motions and sensitivities are simulated at the present estimate. Where that is
far from the truth, design again after the next fit.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.errors import SettingsError
from hydroid.experiment.commands import Draw
from hydroid.experiment.information import Judge, log_information, prior_information
from hydroid.experiment.trial import Bench, Trial
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.problem.stage import Stage
from hydroid.progress import Progress, no_progress
from hydroid.settings.fit import FitSettings

ELITE = 4
"""experiments that the evolution keeps"""


@dataclass(frozen=True, eq=False)
class Design:
    """A designed experiment beside the random ones it was chosen from.

    Attributes:
        best: the experiment.
        random: those drawn at random that keep the limits.
        refused: number of draws that could not be made to.
        judge: the information that was there before, and the criterion.
        names: of the free parameters.
        period: of the commands [s].
        tried: number of experiments simulated with all their sensitivities.
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


def design(
    settings: FitSettings, theta: Array, logs: Sequence[Log], seed: int, progress: Progress = no_progress
) -> Design:
    """Choose start pose, joints and commands of an experiment.

    Random experiments are drawn and kept within the limits; the best few are then changed at random, and a
    changed one takes the place of the worst where it is better. The same seed gives the same experiment
    unless `time_limit_s` ends the search.

    Args:
        settings: the model, the free parameters, the priors, and `design`.
        theta: the present estimate, shape (P,).
        logs: records whose information is there already; may be empty.
        seed: of draws and changes.
        progress: called with the number of experiments so far.

    Raises:
        SettingsError: joints or poses that cannot be, or no experiment within the limits was found.
    """
    limits = settings.design
    draw = Draw(settings, np.random.default_rng(seed))
    bench = Bench(settings, theta, draw.period, draw.samples)
    end = time.monotonic() + limits.time_limit_s
    parameters = Stage(settings).parameters
    known = prior_information(Priors(settings.priors, parameters), parameters, theta)
    if logs:
        known = known + log_information(Problem(settings, logs), theta)
    random: list[Trial] = []
    drawn = 0
    for drawn in _until(end, limits.candidates):
        trial = bench.trial(draw.new())
        random += [trial] if trial is not None else []
        progress("random experiments", drawn, limits.candidates)
    if not random:
        raise SettingsError(
            f"none of {drawn} random experiments keeps the limits in simulation",
            where="design",
            hint="allow more speed, less margin, a smaller command, or other poses",
        )
    judge = Judge.of(known, np.mean([t.information for t in random], axis=0))
    elite = sorted(
        ((judge.score(t.information, limits.criterion), i, t) for i, t in enumerate(random)), reverse=True
    )[:ELITE]
    changed = 0
    for changed in _until(end, limits.improvements):
        parent = elite[min(draw.integer(len(elite)), draw.integer(len(elite)))][2]
        child = bench.trial(draw.changed(parent.experiment))
        if child is not None:
            score = judge.score(child.information, limits.criterion)
            if score > elite[-1][0]:
                elite = sorted([*elite[:-1], (score, len(random) + changed, child)], reverse=True)
        weakest, _ = judge.weakest(elite[0][2].information)
        progress(f"improving: weakest {100 * weakest:.3g} %", changed, limits.improvements)
    names = tuple(p.name for p in parameters.parameters if p.fixed is None)
    tried = len(random) + changed
    return Design(elite[0][2], tuple(random), drawn - len(random), judge, names, draw.period, tried)


def _until(end: float, count: int) -> Iterator[int]:
    """Count from 1 to `count`, at least once, until the clock [s] passes `end`."""
    for k in range(1, count + 1):
        if k > 1 and time.monotonic() > end:
            return
        yield k
