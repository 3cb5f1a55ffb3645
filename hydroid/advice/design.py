"""The search for the next experiment: start pose, joints and commands with the most useful information.

Optimal experiment design (V. V. Fedorov, 1972; E. Walter and L. Pronzato, 1997) by random draws and random
changes of the best. The design is local: motions and sensitivities are simulated at the present estimate.
Where that is far from the truth, design again after the next fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydroid.advice.experiment import RandomExperiments
from hydroid.advice.information import PRIOR_SD, ExperimentSimulator, Trial, forecast
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.linear import estimate_box, prior_slopes, white_posterior
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.bindings import Bindings
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress
from hydroid.settings.fit import FitSettings


@dataclass(frozen=True, eq=False)
class Design:
    """A designed experiment beside the random ones it was chosen from.

    Attributes:
        best: the experiment.
        random: those drawn at random that keep the limits.
        known: what is known without it.
        directions: orthonormal basis of the directions that such experiments improve on PRIOR_SD, (p, d). The
            others stay at it, and must not hide them.
        names: of the p parameters.
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

    @property
    def random_weakest(self) -> float:
        """Relative standard deviation of the weakest direction after a random experiment, the median."""
        return float(np.median([self.weakest(self.known.add(t.gained))[0] for t in self.random]))

    def weakest(self, known: Posterior) -> tuple[float, Array]:
        """Relative standard deviation and unit vector (p,) of the least known of `directions`."""
        return weakest(known, self.directions)


def design(
    settings: FitSettings, theta: Array, logs: Sequence[Log], seed: int, progress: Progress = no_progress
) -> Design:
    """Choose start pose, joints and commands of an experiment.

    Random experiments are drawn and kept within the limits. The best few are then changed at random, and a
    changed one replaces the worst of them where it is better. The same seed gives the same experiment.

    Args:
        settings: the model, the free parameters, the priors, and `design`.
        theta: the present estimate, shape (P,).
        logs: records whose information is there already; may be empty.
        seed: of draws and changes.
        progress: called with the number of experiments so far.

    Raises:
        SettingsError: joints or poses that cannot be used, or no experiment within the limits was found.
    """
    effort, parameters = settings.design.effort, Bindings(settings).parameters
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
            where="design",
            hint="allow more speed, less margin or clearance, a smaller command, or other poses",
        )
    directions = _improved(fitted, np.mean([t.gained.T @ t.gained for t in random], axis=0))

    def score(trial: Trial) -> float:
        return -weakest(known.add(trial.gained), directions)[0]

    elite = sorted(((score(t), i, t) for i, t in enumerate(random)), reverse=True)[:4]
    for tried in range(first + 1, effort + 1):
        parent = elite[min(rng.integers(len(elite)), rng.integers(len(elite)))][2]
        child = simulator.trial(experiments.change(parent.experiment))
        if child is not None and score(child) > elite[-1][0]:
            elite = sorted([*elite[:-1], (score(child), tried, child)], reverse=True)
        least, _ = weakest(known.add(elite[0][2].gained), directions)
        progress(f"improving: weakest {100 * least:.3g} %", tried, effort)
    names = tuple(np.array(parameters.names)[known.box.varied].tolist())
    return Design(elite[0][2], tuple(random), known, directions, names)


def weakest(known: Posterior, directions: Array) -> tuple[float, Array]:
    """Relative standard deviation and unit vector, (p,), of the least known of some directions, (p, d)."""
    values, vectors = np.linalg.eigh(directions.T @ known.covariance @ directions)
    return float(np.sqrt(values[-1])), directions @ vectors[:, -1]


def _improved(fitted: Posterior, typical: Array) -> Array:
    """Directions that experiments with a mean information, (p, p), improve on PRIOR_SD; at least one."""
    values, vectors = np.linalg.eigh(fitted.root.T @ fitted.root + typical)
    improved = values > 1 / PRIOR_SD**2
    improved[-1] = True
    return vectors[:, improved]
