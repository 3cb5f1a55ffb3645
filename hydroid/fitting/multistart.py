"""Multi-start least squares: from random starts, each over a growing part of the record.

From far off, the response over a whole record says nothing to a local method: it runs to the joints' stops,
and there nothing that could be changed has an effect. Over the first seconds it cannot get that far. A start
is therefore fitted to the first quarter of a second, to the first seconds, and then to all of it (a
*progressive horizon*); what it has found on the way keeps the longer response near the record.

Measured on 27 parameters from 60 s of all joints, starts within a factor of 10 of the truth: the whole record
at once took 656 to 1,032 simulations of it and left 1 start of 8 at the stops; 5 s first, the equivalent of
242 to 369, with the same start lost; 0.25, 1 and 5 s first brought 30 of 30 to the noise at 5 s, for the
equivalent of 25. The parameters' logarithms as coordinates were worse: three starts had not converged after
the equivalent of 1,350.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydroid.fitting.journal import Journal
from hydroid.fitting.refinement import refine
from hydroid.fitting.search import HISTORY, SearchState
from hydroid.parameters import Array
from hydroid.problem.problem import Memo, Problem
from hydroid.search.algorithm import Population
from hydroid.settings.search import RefinementSettings, SearchSettings

WIDE = 10.0
"""bounds of a larger ratio than this are searched by the logarithm: a start is as likely in each decade"""
DRAWS = 16
"""of the hydraulics' parameters, more than half may have no force-stroke curve"""


@dataclass(frozen=True, eq=False)
class Descent:
    """What one start found.

    Attributes:
        point: of the unit box of the free parameters, shape (p,).
        rms: residual there [rad], what is known included; inf where the start diverged.
        simulated: simulations of the whole record and of its parts.
    """

    point: Array
    rms: float
    simulated: int


class Multistart:
    """Least squares from one random start after the other.

    The state is that of a search by populations: its candidates are the points found so far, one a start, its
    objective is their rms residual, statements of what is known included. A start depends on the seed and its
    number alone, so that a resumed run repeats no more than the one that was interrupted.

    Args:
        problem: what is minimised.
        settings: of the search; the seed and how each start goes on.
        memo: takes the points found.
        told: is told the simulations of the start under way.
        journal: what an interrupted start has simulated.
    """

    single = True

    def __init__(
        self,
        problem: Problem,
        settings: SearchSettings,
        memo: Memo,
        told: Callable[[int], None],
        journal: Journal | None = None,
    ) -> None:
        self._problem, self._memo, self._told, self._journal = problem, memo, told, journal
        self._seed, self._settings = settings.seed, settings.multistart
        longest = max(log.duration for log in problem.logs)
        self._parts = [problem.first(h) for h in self._settings.horizons if h < longest]

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
        """Return the points found, shape (n, P)."""
        return self._problem.parameters.from_unit(population.chromosomes)

    def start(self, number: int) -> Array:
        """Draw start `number`, shape (P,): the first of DRAWS that can be simulated at all."""
        rng = np.random.default_rng([self._seed, number])
        drawn = np.array([random_start(self._problem, rng) for _ in range(DRAWS)])
        shortest = self._parts[0] if self._parts else self._problem
        return drawn[np.argmax(np.isfinite(shortest.residuals(drawn)).all(axis=1))]

    def descend(self, theta: Array) -> Descent:
        """Go down from theta, shape (P,), over the first parts of the record and then over all of it."""
        how = RefinementSettings(
            iterations=self._settings.iterations, step_tolerance=self._settings.step_tolerance
        )
        counter = _Counter(self._told)
        for part in self._parts:
            begun = refine(part, theta, how, counter.count, self._journal)
            counter.next()
            theta = self._problem.parameters.from_unit(begun.point[None])[0]
        found = refine(self._problem, theta, how, counter.count, self._journal)
        rows = self._problem.measured.size + len(self._problem.priors)
        return Descent(found.point, float(np.sqrt(2 * found.cost_after / rows)), counter.total)

    def _next(self, state: SearchState | None) -> SearchState:
        """The state after one more start."""
        done = 0 if state is None else len(state.history)
        found = self.descend(self.start(done))
        population = Population(found.point[None], np.array([[found.rms]]))
        history = np.empty((0, len(HISTORY)))
        if state is not None:
            population, history = state.population.join(population), state.history
        overall = self._memo.evaluate(self.theta(population)).overall
        finite = overall[np.isfinite(overall)]
        simulated = found.simulated + (history[-1, 1] if done else 0)
        infeasible = int(np.sum(~population.feasible))
        median = np.median(finite) if finite.size else np.inf
        row = [done + 1, simulated, simulated, infeasible, overall.min(), median]
        return SearchState(population, {}, np.vstack([history, row]))


def random_start(problem: Problem, rng: np.random.Generator) -> Array:
    """Draw a parameter set within the bounds, shape (P,), where what is known holds.

    Uniform, or uniform in the logarithm where the bounds are WIDE.
    """
    parameters = problem.parameters
    unit = rng.random(int(parameters.free.sum()))
    low, high = parameters.lower[parameters.free], parameters.upper[parameters.free]
    wide = (low > 0) & (high > WIDE * low)
    ratio = np.where(wide, high, 2.0) / np.where(wide, low, 1.0)
    unit = np.where(wide, (ratio**unit - 1) / (ratio - 1), unit)
    return problem.theta(unit[None])[0]


class _Counter:
    """Adds up the simulations of refinements that each count from 0."""

    def __init__(self, told: Callable[[int], None]) -> None:
        self._told, self._before, self.total = told, 0, 0

    def count(self, simulated: int) -> None:
        self.total = self._before + simulated
        self._told(self.total)

    def next(self) -> None:
        self._before = self.total
