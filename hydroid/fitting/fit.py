"""A fit: search, the estimates taken from it, refinement, and the uncertainty of the last estimate."""

import logging
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from hydroid.advice.growth import MIN_GAIN, refitted
from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.multistart import each_alone
from hydroid.fitting.refinement import ROUGH, refine
from hydroid.fitting.search import Searched, search
from hydroid.posterior.linear import estimate_box
from hydroid.posterior.quantities import Quantities, quantities
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.problem.problem import Evaluation, Problem
from hydroid.search.descent import Descent
from hydroid.search.pareto import average, non_dominated, segment_best, utopia

_log = logging.getLogger(__name__)

TOO_FAR = 20.0
"""times the rms error of the last estimate from which the dynamic model is not refined: lags that stand for
oil in a quasi-static model are too much beside it, and it errs by several times as much at first"""


@record
class Estimate:
    """One parameter set with its response.

    theta: shape (P,). segments: objectives by segment, shape (S,). overall: norm over the whole record.
    rms: of the output error [rad]. responses: simulated outputs [rad], (T, K) a log. left_out: of an estimate
    with another term, the rms error on parts of the logs left out, without the term and with it [rad].
    """

    name: str
    theta: Array
    segments: Array
    overall: float
    rms: float
    responses: tuple[Array, ...]
    left_out: tuple[float, float] | None = None

    @property
    def usable(self) -> bool:
        """Whether it could be simulated: the mean of several candidates that could need not."""
        return bool(np.isfinite(self.rms))


@record
class Fit:
    """The estimates of a fit, and what is known of the one to use.

    problem: with the settings of the estimate to use, which `final` names. estimates: by name, that of the
    search first. front: the non-dominated candidates, shape (n, P), and their objectives. history: shape
    (G, len(HISTORY)). refinements: by the estimate that each gave. uncertainty, quantities: of the final
    estimate. seconds: wall-clock time of "search", "refinement" and "uncertainty" [s]; of a resumed fit,
    since it was resumed.
    """

    problem: Problem
    estimates: dict[str, Estimate]
    final: str
    front: tuple[Array, Evaluation]
    history: Array
    refinements: dict[str, Descent]
    uncertainty: Uncertainty
    quantities: Quantities
    seconds: Mapping[str, float]

    @property
    def refinement(self) -> Descent | None:
        """The refinement that gave the estimate to use; None where the search did."""
        return self.refinements.get(self.final)

    @property
    def best(self) -> Estimate:
        """The estimate to use."""
        return self.estimates[self.final]


class Watcher(Protocol):
    """Takes the progress of a fit."""

    def generation(self, row: Array) -> None:
        """Take a row of HISTORY."""

    def refining(self, name: str, simulated: int, rms: float) -> None:
        """Take the name of a least squares, its number of simulations, and its rms error [rad] so far."""


class Silent(Watcher):
    """Progress that is not shown."""


def fit(problem: Problem, watch: Watcher | None = None, checkpoints: Checkpoints | None = None) -> Fit:
    """Search, take the estimates, refine the best of them, and say what the last one is worth.

    Args:
        problem: the estimation problem with its settings.
        watch: takes the progress.
        checkpoints: what an interrupted fit stored, to continue from; takes the states of this one.

    Raises:
        RunError: every simulated candidate diverged.
    """
    watch, checkpoints = watch or Silent(), {} if checkpoints is None else checkpoints
    times, settings = [time.perf_counter()], problem.settings
    last = problem.varied(settings.of_estimate("best"))
    searched = search(last, watch.generation, watch.refining, checkpoints)
    estimates = _estimates(last, _candidates(last, searched))
    final = next(iter(estimates))
    start = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
    times.append(time.perf_counter())
    refinements, left_out = dict[str, Descent](), dict[str, float]()

    def error_left_out(own: Problem, one: Estimate) -> float:
        if one.name not in left_out:
            left_out[one.name] = refitted(own, one.theta).left_out
        return left_out[one.name]

    def climb(name: str, *, if_nearer: bool) -> None:
        """Refine with the settings of an estimate, from the last one; keep the result as the final one."""
        nonlocal final, last, start
        assert settings.refinement is not None
        own = problem.varied(settings.of_estimate(name))
        theta = own.parameters.started(last.parameters.mapping(start.theta))
        other_model = own.settings.quasi_static != last.settings.quasi_static
        if if_nearer and (
            last.leaves_noise(start.theta)
            or (other_model and not own.rms(own.output_errors(theta[None]))[0] < TOO_FAR * start.rms)
        ):
            return
        if len(own.settings.terms) > len(last.settings.terms):  # other parameters may stand for it
            rough = settings.refinement.changed({"gain_tolerance": ROUGH})
            first = refine(own, theta, rough, watch.refining, checkpoints, f"{name} at first")
            theta = own.parameters.from_unit(first.point)
            theta = each_alone(own, theta, settings.refinement, watch.refining, checkpoints, name)
        result = refine(own, theta, settings.refinement, watch.refining, checkpoints, name)
        estimates.update(_estimates(own, {name: own.parameters.from_unit(result.point)}))
        refinements[name], new = result, estimates[name]
        nearer = new.rms < (1 - MIN_GAIN) * start.rms
        if nearer and own.settings.terms != last.settings.terms:
            without, with_it = error_left_out(last, start), error_left_out(own, new)
            estimates[name] = new = replace(new, left_out=(without, with_it))
            nearer = with_it < (1 - MIN_GAIN) * without
        if nearer or not if_nearer:
            final, last, start = name, own, new

    if settings.refinement is not None:
        ladder = settings.stage == "hyd" and settings.simulation.model == "ladder"
        for model in ("refined", "dynamic")[: 1 + ladder]:
            climb("+".join([model, *final.split("+")[1:]]), if_nearer=model == "dynamic")
            for term in settings.terms if final == model else ():
                climb(f"{final}+{term}", if_nearer=True)
        if settings.joint_refinement:
            climb(final.replace("refined", "joint"), if_nearer=False)
        if not refinements[final].converged:
            words = "The least-squares refinement did not converge: %s. '%s' need not be an optimum."
            _log.warning(words, refinements[final].ending.value, final)
    times.append(time.perf_counter())
    about = uncertainty(last, estimates[final].theta, _slopes(last, refinements.get(final)))
    determined, front, history = quantities(last, about), _front(searched), searched.history
    seconds = np.diff([*times, time.perf_counter()]).tolist()
    took: dict[str, float] = dict(zip(("search", "refinement", "uncertainty"), seconds, strict=True))
    return Fit(last, estimates, final, front, history, refinements, about, determined, took)


def _slopes(problem: Problem, descent: Descent | None) -> Array | None:
    """Derivatives that least squares ended with, per relative change of the free parameters, (p, R)."""
    if descent is None or not len(descent.jacobian):
        return None
    parameters, free = problem.parameters, problem.parameters.free
    theta = parameters.from_unit(descent.point)
    change = estimate_box(parameters, theta).scale[free] / parameters.width(theta)[free]
    return descent.jacobian[: problem.measured.size].T * change[:, None]


def _candidates(problem: Problem, searched: Searched) -> dict[str, Array]:
    """The estimates that a search gives, by name, the one that the settings ask for first."""
    theta, memo = searched.theta, searched.memo
    if searched.single:
        return {"best": theta[segment_best(searched.population.objectives)[0]]}
    segments = memo.evaluate(theta).segments
    candidates = {
        "average": average(theta, segments),
        "utopia": utopia(theta, segments),
        "best": memo.best,  # over the whole record it may have left the population
    }
    first = problem.settings.search.compromise
    return {first: candidates[first]} | candidates


def _estimates(problem: Problem, candidates: dict[str, Array]) -> dict[str, Estimate]:
    """Simulate candidates by name, each of shape (P,), and measure them; those that diverged come last."""
    theta = np.array(list(candidates.values()))
    responses = problem.responses(theta)
    errors = problem.errors(responses)
    norms, rms = problem.norms(errors), problem.rms(errors)
    estimates: list[Estimate] = []
    for i, name in enumerate(candidates):
        angles = tuple(response.angle[i] for response in responses)
        estimates.append(Estimate(name, theta[i], norms[i, :-1], norms[i, -1], rms[i], angles))
        if not estimates[-1].usable:
            _log.warning("the estimate %s diverged when it was simulated; it is not used", name)
    return {e.name: e for e in sorted(estimates, key=lambda e: not e.usable)}


def _front(searched: Searched) -> tuple[Array, Evaluation]:
    """The different non-dominated candidates of the last population."""
    _, first = np.unique(searched.theta, axis=0, return_index=True)
    theta = searched.theta[np.sort(first)]
    theta = theta[non_dominated(searched.memo.evaluate(theta).segments)]
    return theta, searched.memo.evaluate(theta)
