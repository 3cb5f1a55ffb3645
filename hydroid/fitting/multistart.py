"""Multi-start least squares: from the stated start and random ones, each over a growing part of the record.

From far off, the response over a whole record says nothing to a local method: it runs to the joints' stops,
where no parameter has an effect. Over the first seconds it cannot get that far. A start is therefore fitted
to the first quarter of a second, to the first seconds, and then to all of it (a *progressive horizon*). Each
fit keeps the longer response near the record. With 27 parameters and starts a factor of 10 off, 30 of 30
starts reached the noise this way. One in eight of those fitted to the whole record at once ended at the
stops.

Several hydraulic joints are fitted joint by joint: each start is fitted to every joint alone, while the other
joints follow their logged motion. A joint has few parameters, which are soon found, and each joint may take
another start's. What the joints share (masses, the pump) stays at the start's values. Fitting all parameters
together is left to the refinement that follows the search.
"""

from collections.abc import Callable

import numpy as np

from hydroid.fitting.memo import Memo
from hydroid.fitting.refinement import Checkpoints, Refinement, refine
from hydroid.fitting.search import HISTORY, SearchState
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.search.algorithm import Population
from hydroid.settings.search import RefinementSettings, SearchSettings

DRAWS = 16
"""candidates drawn for a start; more than half of the hydraulic ones may have no force-stroke curve"""
MOVES = 0.01
"""part of an angle's travel over the whole record, below which a shorter part of it shows no motion"""


class Multistart:
    """Least squares from one random start after the other.

    The state is that of a search by populations. Its candidates are the points that the starts reached; its
    objective is their rms residual, priors included. A start depends on the seed and its number alone.

    Args:
        problem: what is minimised.
        settings: of the search: the seed, and how each start is fitted.
        memo: takes the points reached.
        progress: takes the number of simulations of the start under way, and its rms error [rad].
        checkpoints: of the refinements.
    """

    single = True

    def __init__(
        self,
        problem: Problem,
        settings: SearchSettings,
        memo: Memo,
        progress: Callable[[int, float], None],
        checkpoints: Checkpoints | None = None,
    ) -> None:
        self._problem, self._memo, self._progress = problem, memo, progress
        self._checkpoints: Checkpoints = {} if checkpoints is None else checkpoints
        self._seed, self._settings = settings.seed, settings.multistart
        self._joints = problem.lone_joints

    def run(
        self,
        state: SearchState | None,
        save: Callable[[SearchState, Memo], None],
        watch: Callable[[Array], None],
    ) -> SearchState:
        """Run from `state`, or from the first start, to the last.

        Args:
            state: a state to continue from.
            save: called with the state after every start.
            watch: called with a row of HISTORY after every start.
        """
        while state is None or len(state.history) < self._settings.starts:
            state = self._next(state)
            save(state, self._memo)
            watch(state.history[-1])
        return state

    def theta(self, population: Population) -> Array:
        """Return the points reached, shape (n, P)."""
        return self._problem.parameters.from_unit(population.chromosomes)

    def start(self, number: int) -> Array:
        """Draw start `number`, shape (P,): the first of DRAWS that can be simulated at all.

        The first one is the start that the parameters state, if they do.
        """
        rng = np.random.default_rng([self._seed, number])
        unit = rng.random((DRAWS, int(self._problem.parameters.free.sum())))
        if number == 0 and self._problem.start is not None:
            unit[0] = self._problem.start
        drawn = self._problem.theta(unit)
        shortest = self._parts(self._problem)[0]
        return drawn[np.argmax(np.isfinite(shortest.residuals(drawn)).all(axis=1))]

    def _next(self, state: SearchState | None) -> SearchState:
        """The state after one more start."""
        done = 0 if state is None else len(state.history)
        theta, simulated = self.start(done), 0 if state is None else int(state.history[-1, 1])
        if self._joints:
            theta, simulated = self._each_joint(done, theta, simulated)
            rows = self._problem.residuals(theta[None])
            point, rms, simulated = (
                self._problem.parameters.to_unit(theta[None])[0],
                _rms(rows),
                simulated + 1,
            )
        else:
            result, simulated = self._over_parts(self._problem, theta, f"start {done + 1}", simulated)
            size = self._problem.measured.size + len(self._problem.priors)
            point, rms = result.point, np.sqrt(2 * result.cost / size)
        population = Population(point[None], np.array([[rms]]))
        history = np.empty((0, len(HISTORY)))
        if state is not None:
            population, history = state.population.join(population), state.history
        overall = self._memo.evaluate(self.theta(population)).overall
        finite = overall[np.isfinite(overall)]
        infeasible = int(np.sum(~population.feasible))
        median = np.median(finite) if finite.size else np.inf
        row = [done + 1, simulated, simulated, infeasible, overall.min(), median]
        return SearchState(population, {}, np.vstack([history, row]))

    def _each_joint(self, number: int, theta: Array, simulated: int) -> tuple[Array, int]:
        """Fit start `number`, (P,), to every joint alone; the last start takes the best one of each joint.

        Returns the point reached, shape (P,), and the number of simulations so far.
        """
        for joint in self._joints:
            problem = self._problem.alone(joint, theta)
            result, simulated = self._over_parts(
                problem, theta, f"start {number + 1} joint {joint}", simulated
            )
            own = problem.parameters.free
            if number + 1 == self._settings.starts:
                for other in range(number):  # refinements that ended are read, not repeated
                    name = f"start {other + 1} joint {joint}"
                    rival, _ = self._over_parts(problem, theta, name, simulated)
                    result = min(result, rival, key=lambda r: r.cost)
            theta = theta.copy()
            theta[own] = problem.parameters.from_unit(result.point[None])[0, own]
        return theta, simulated

    def _over_parts(
        self, problem: Problem, theta: Array, name: str, simulated: int
    ) -> tuple[Refinement, int]:
        """Fit theta, shape (P,), to growing parts of the records; also returns the simulations so far."""
        settings = RefinementSettings(
            iterations=self._settings.iterations, gain_tolerance=self._settings.gain_tolerance
        )
        results = list[Refinement]()
        for number, part in enumerate(self._parts(problem), 1):
            result = refine(
                part,
                theta,
                settings,
                lambda n, rms, before=simulated: self._progress(before + n, rms),
                self._checkpoints,
                f"{name} part {number}",
            )
            theta = part.parameters.from_unit(result.point[None])[0]
            simulated += result.evaluations
            results.append(result)
        return results[-1], simulated

    def _parts(self, problem: Problem) -> list[Problem]:
        """The problem's first seconds, more and more of them, and at last all of it.

        A part in which nothing moves yet, as at the start from a stop, would only lead a start astray.
        """
        longest = max(log.duration for log in problem.logs)
        parts = [problem.first(h) for h in self._settings.horizons if h < longest]
        return [*(part for part in parts if _moves(part, problem)), problem]


def _moves(part: Problem, whole: Problem) -> bool:
    """Whether any signal moves in the first part of the records."""
    both = zip(part.channels, whole.channels, strict=True)
    return any(np.ptp(first.measured) > MOVES * np.ptp(all_.measured) for first, all_ in both)


def _rms(rows: Array) -> float:
    """Root of the mean square of residuals; inf if they are not finite."""
    return float(np.sqrt(np.mean(rows**2))) if np.isfinite(rows).all() else np.inf
