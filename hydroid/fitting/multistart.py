"""Multi-start least squares: from the stated start and random ones, each over a growing
part of the record.

From far off, the response over a whole record says nothing to a local method: it runs
to the joints' stops, where no parameter has an effect. Over the first seconds it cannot
get that far. A start is therefore fitted to the first quarter of a second, to the first
seconds, and then to all of it (a *progressive horizon*). Each fit keeps the longer
response near the record. With 27 parameters and starts a factor of 10 off, 30 of 30
starts reached the noise this way. One in eight of those fitted to the whole record at
once ended at the stops.

Several hydraulic joints are fitted joint by joint: each start is fitted to every joint
alone, while the other joints follow their logged motion. A joint has few parameters,
which are soon found, and each joint may take another start's. What the joints share
(masses, the pump) stays at the start's values. Fitting all parameters together is left
to the refinement that follows the search.
"""

from collections import defaultdict
from operator import itemgetter

import numpy as np
from numpy.random import Generator

from hydroid.arrays import Array
from hydroid.fitting.baselines import NAMES, fit_baselines
from hydroid.fitting.checkpoints import Checkpoints, Memo
from hydroid.fitting.first_answer import first_answer
from hydroid.fitting.refinement import Refining, refine
from hydroid.fitting.starts import by_numbers, by_speeds
from hydroid.fitting.step import Step
from hydroid.posterior.error_model import Likelihood, make_likelihood
from hydroid.problem.problem import Problem
from hydroid.progress import LOGGER, NOTE
from hydroid.search.chromosomes import Genes
from hydroid.search.genetic import Population

DRAWS = 64  # candidates drawn for a start that can be simulated
MOVES = 0.01
"""part of an angle's travel over the whole record, below which a shorter part of it
shows no motion"""
COST = itemgetter(0)  # of a negative log-likelihood and the theta that it is of


class Multistart:
    """Least squares from one random start after the other: a search whose chromosomes
    are theta.

    Its objective is the negative log-likelihood, priors included. A start depends on
    the seed and its number alone.

    Args:
        problem: what is minimised.
        memo: counts the simulations.
        progress: of each least squares.
        checkpoints: of the refinements.
    """

    single = True

    def __init__(
        self, problem: Problem, memo: Memo, progress: Refining, checkpoints: Checkpoints
    ) -> None:
        self.settings = problem.settings.search.multistart
        self._problem, self._memo, self._progress, self._checkpoints = (
            problem,
            memo,
            progress,
            checkpoints,
        )
        self._best: dict[int, tuple[float, Array]] = {}
        """the best fit of each joint alone, over the starts so far: its negative
        log-likelihood, and theta"""
        self._cost = np.inf
        self.ends = defaultdict[int, list[float]](list)
        """negative log-likelihoods at which starts ended, by the joint fitted alone, 0:
        all together"""

    @property
    def generations(self) -> int:
        """Starts after the first one."""
        return self.settings.generations

    def theta(self, chromosomes: Genes) -> Array:
        """Return the candidates that chromosomes stand for, which they are, shape (n,
        P)."""
        return chromosomes

    def ask(self, population: Population | None, rng: Generator) -> Genes:
        """Return the point that the next start reaches, shape (1, P)."""
        number = 0 if population is None else len(population.chromosomes)
        theta = self.start(number)
        if lone_joints(self._problem):
            theta = self._joint_by_joint(number, theta)
            self._memo.elsewhere += 1
            self._cost = make_likelihood(self._problem).negative_log_at(theta)
        else:
            self._cost, theta = self._grown(
                self._problem, theta, Step("start", start=number + 1)
            )
            self.ends[0].append(self._cost)
        return theta[None]

    def tell(self, population: Population | None, offspring: Population) -> Population:
        """Return the points reached so far, with their negative log-likelihoods."""
        reached = Population(offspring.chromosomes, np.array([[self._cost]]))
        return reached if population is None else population.join(reached)

    def start(self, number: int) -> Array:
        """Draw start `number`, shape (P,): the first of DRAWS that can be simulated at
        all.

        The first one is the start that the parameters state, if they do.
        """
        rng = np.random.default_rng([self._problem.settings.search.seed, number])
        unit = rng.random((DRAWS, int(self._problem.parameters.free.sum())))
        if number == 0 and self._problem.start is not None:
            unit[0] = self._problem.start
        drawn = self._problem.theta(unit)
        shortest = self._parts(self._problem)[0]
        # as a rule it is the first one
        for theta in drawn:
            if np.isfinite(shortest.output_errors(theta[None])).all():
                return theta
        return drawn[0]

    def _joint_by_joint(self, number: int, theta: Array) -> Array:
        """Fit start `number`, (P,), to every joint alone; the last start takes the best
        one of each joint."""
        for joint in lone_joints(self._problem):
            problem = alone(self._problem, joint, theta)
            step = Step("start", start=number + 1, joint=joint)
            ends = problem.settings.arm.stops(joint)
            simple = fit_baselines(problem.logs, joint, ends)
            start = by_numbers(problem, joint, theta, simple[NAMES[-1]])
            tried = [self._grown(problem, start, step.changed(numbers=True))]
            if not problem.leaves_noise(tried[0][1]):
                tried.append(
                    self._grown(problem, by_speeds(problem, joint, theta), step)
                )
            self.ends[joint] += map(COST, tried)
            # the other one seldom ends elsewhere
            _, near = min(tried, key=COST)
            result = self._fitted(make_likelihood(problem), near, step)
            if number == 0:
                said = first_answer(problem, joint, result[1], simple)
                LOGGER.log(NOTE, "%s", said)
            best = self._best[joint] = min(
                self._best.get(joint, result), result, key=COST
            )
            _, reached = best if number == self.settings.generations else result
            theta = np.where(problem.parameters.free, reached, theta)
        return theta

    def _grown(self, problem: Problem, theta: Array, step: Step) -> tuple[float, Array]:
        """Fit theta, (P,), to growing parts of the records, at last all of them, by
        output errors.

        Returned are its negative log-likelihood, and it.
        """
        cost = np.inf
        for number, part in enumerate(self._parts(problem), 1):
            likelihood = make_likelihood(part).of_output_errors
            cost, theta = self._fitted(likelihood, theta, step.changed(horizon=number))
        return cost, theta

    def _fitted(
        self, likelihood: Likelihood, theta: Array, step: Step
    ) -> tuple[float, Array]:
        """Fit theta, (P,); return its negative log-likelihood, and it."""
        before = self._memo.simulated
        result = refine(
            likelihood,
            theta,
            self.settings,
            lambda what, n, rms: self._progress(what, before + n, rms),
            self._checkpoints,
            step,
        )
        self._memo.elsewhere += result.evaluations
        return result.negative_log, likelihood.problem.parameters.from_unit(
            result.point
        )

    def _parts(self, problem: Problem) -> list[Problem]:
        """Return the problem's first seconds, more and more of them, and at last all of
        it.

        A part in which nothing moves yet, as at the start from a stop, would only lead
        a start astray.
        """
        longest = max(log.duration for log in problem.logs)
        settings = problem.settings.changed({"objective.segments": 1})
        travels, parts = (
            [MOVES * np.ptp(c.measured) for c in problem.channels],
            list[Problem](),
        )
        for seconds in (one for one in self.settings.horizons if one < longest):
            part = problem.varied(
                settings, [log.first(seconds) for log in problem.logs]
            )
            if any(
                np.ptp(c.measured) > far
                for c, far in zip(part.channels, travels, strict=True)
            ):
                parts.append(part)
        return [*parts, problem]


def lone_joints(problem: Problem) -> tuple[int, ...]:
    """Return the joints that can be fitted alone, numbered from 1: hydraulic ones with
    their own parameters.

    There are none if there are fewer than two, or if a log does not measure how a
    driven joint moves.
    """
    measured = all(log.has_angle[log.driven].all() for log in problem.logs)
    settings = problem.settings
    joints = tuple(
        j for j in settings.outputs if problem.driven[j - 1] and settings.acting_on(j)
    )
    return joints if settings.stage == "hyd" and measured and len(joints) > 1 else ()


def alone(problem: Problem, joint: int, theta: Array) -> Problem:
    """Return the problem of one joint's own parameters; all other joints follow their
    logged motion.

    All other parameters are held at theta, shape (P,). Logs that do not drive the joint
    are left out.
    """
    settings = problem.settings.alone(joint, problem.parameters.mapping(theta))
    return problem.varied(
        settings, [log.driving(joint) for log in problem.logs if log.driven[joint - 1]]
    )
