"""A fit: search, the estimates taken from it, refinement, and the uncertainty of the
last estimate."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.estimates import Estimate, simulated
from hydroid.fitting.ladder import Ladder
from hydroid.fitting.left_out import Gain
from hydroid.fitting.refinement import Refinement
from hydroid.fitting.refiner import Refiner
from hydroid.fitting.search import Searched, search
from hydroid.fitting.watcher import Silent, Watcher
from hydroid.posterior.linear import estimate_box
from hydroid.posterior.quantities import Quantities, quantities
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.pareto import average, non_dominated, segment_best, utopia


@record
class Fit:
    """The estimates of a fit, and what is known of the one to use.

    Attributes:
        problem: with the settings of the estimate to use.
        estimates: by name, that of the search first.
        final: name of the estimate to use.
        front: the non-dominated candidates, (n, P), and their objectives, (n, S + 1).
        history: of the search, shape (G, len(HISTORY)).
        refinements: by the estimate that each gave.
        ends: costs at which the starts of a multi-start ended, by the joint that was
            fitted alone (0: all together).
        uncertainty: of the final estimate.
        quantities: of the final estimate.
        tried: what terms of single joints gained (`Tried.gains`).
        seconds: wall-clock time of "search", "refinement" and "uncertainty" [s]; of a
            resumed fit, since it was resumed.
    """

    problem: Problem
    estimates: dict[str, Estimate]
    final: str
    front: tuple[Array, Array]
    history: Array
    refinements: dict[str, Refinement]
    ends: Mapping[int, Sequence[float]]
    uncertainty: Uncertainty
    quantities: Quantities
    seconds: Mapping[str, float]
    tried: Mapping[str, Gain | None] = field(default_factory=dict[str, Gain | None])

    @property
    def refinement(self) -> Refinement | None:
        """The refinement that gave the estimate to use; None where the search did."""
        return self.refinements.get(self.final)

    @property
    def best(self) -> Estimate:
        """The estimate to use."""
        return self.estimates[self.final]


def fit(
    problem: Problem,
    watch: Watcher | None = None,
    checkpoints: Checkpoints | None = None,
) -> Fit:
    """Search, take the estimates, refine the best of them, and say what the last one is
    worth.

    Args:
        problem: the estimation problem with its settings.
        watch: takes the progress, and says when time is up: the fit then ends with what
            it has.
        checkpoints: what an interrupted fit stored, to continue from; takes the states
            of this one.

    Raises:
        RunError: every simulated candidate diverged.
    """
    watch = watch or Silent()
    # an empty one is still to be written to
    if checkpoints is None:
        checkpoints = {}
    times = [time.perf_counter()]
    settings = problem.settings
    first = problem.varied(settings.of_estimate("best"))
    searched = search(first, watch, checkpoints)
    estimates = simulated(first, _candidates(first, searched))
    final = next(iter(estimates))
    last = first
    refinements = dict[str, Refinement]()
    tried = dict[str, Gain | None]()
    times.append(time.perf_counter())
    if settings.refinement is not None:
        refiner = Refiner(problem, settings.refinement, watch, checkpoints)
        ladder = Ladder(first, estimates, refiner)
        ladder.climb()
        final = ladder.kept.name
        last = ladder.problem
        refinements = ladder.refinements
        tried = ladder.tried.gains
    times.append(time.perf_counter())
    about = _known(last, estimates[final].theta, refinements.get(final))
    determined = quantities(last, about)
    seconds = np.diff([*times, time.perf_counter()]).tolist()
    return Fit(
        last,
        estimates,
        final,
        _front(searched),
        searched.history,
        refinements,
        searched.ends,
        about,
        determined,
        dict(zip(("search", "refinement", "uncertainty"), seconds, strict=True)),
        tried,
    )


def _candidates(problem: Problem, searched: Searched) -> dict[str, Array]:
    """Return the estimates that a search gives, by name, the one that the settings ask
    for first."""
    theta = searched.theta
    memo = searched.memo
    if searched.single:
        return {"best": theta[segment_best(searched.population.objectives)[0]]}
    segments = memo.evaluate(theta)[:, :-1]
    candidates = {
        "average": average(theta, segments),
        "utopia": utopia(theta, segments),
        "best": memo.best,  # over the whole record it may have left the population
    }
    first = problem.settings.search.compromise
    return {first: candidates[first]} | candidates


def _known(problem: Problem, theta: Array, descent: Refinement | None) -> Uncertainty:
    """Return how well the logs determine theta, (P,), of a search or a refinement."""
    if descent is None or not len(descent.jacobian):
        return uncertainty(problem, theta)
    # what least squares ended with
    parameters = problem.parameters
    free = parameters.free
    scale = estimate_box(parameters, theta).scale[free]
    change = scale / parameters.width(theta)[free]
    slopes = descent.jacobian[: problem.measured.size].T * change[:, None]
    return uncertainty(problem, theta, slopes, descent.numbers)


def _front(searched: Searched) -> tuple[Array, Array]:
    """Return the different non-dominated candidates of the last population."""
    theta = searched.theta[
        np.sort(np.unique(searched.theta, axis=0, return_index=True)[1])
    ]
    values = searched.memo.evaluate(theta)
    best = non_dominated(values[:, :-1])
    return theta[best], values[best]
