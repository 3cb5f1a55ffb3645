"""The ladder of a fit: refinements one after another, each of a model that has more in it than the last one.

A rung is kept where it errs clearly less: another model on the fitted logs, another term on parts of the logs
left out, or by half on the fitted ones. Which rung that is shows long before least squares has converged, so
that ends early on the way (`FIRM`). What is kept at the end is refined to the tolerance of the settings.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from hydroid.advice.growth import MIN_GAIN
from hydroid.advice.left_out import refitted
from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.fitting.refinement import ROUGH, refine
from hydroid.posterior.linear import estimate_box
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.problem.problem import Problem
from hydroid.search.descent import Descent, Ending
from hydroid.settings.search import RefinementSettings

FAR = 2.0
"""times the rms error of the last estimate at which the dynamic model is given up after a rough refinement:
lags that stand for oil in a quasi-static model are too much beside it, and it errs by more at first"""
CLEAR = 0.5
"""part of the rms error up to which a term is kept, whatever errors left out say: these are those of fewer
logs, of which one alone may leave so much open that it predicts nothing, with the term or without"""
FIRM = 1e-3  # gain below which least squares ends where another rung may follow


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


def measured(problem: Problem, candidates: Mapping[str, Array]) -> dict[str, Estimate]:
    """Simulate candidates by name, each of shape (P,), and measure them; those that diverged come last."""
    theta = np.array(list(candidates.values()))
    responses = problem.responses(theta)
    errors = problem.errors(responses)
    norms, rms = problem.norms(errors), problem.rms(errors)
    angles = zip(*(response.angle for response in responses), strict=True)  # of each candidate
    estimates = map(Estimate, candidates, theta, norms[:, :-1], norms[:, -1], rms, angles)
    return {e.name: e for e in sorted(estimates, key=lambda e: not e.usable)}


class Watcher(Protocol):
    """Takes the progress of a fit, and says when its time is up."""

    def generation(self, row: Array) -> bool | None:
        """Take a row of HISTORY; return whether the search is to end."""

    def refining(self, name: str, simulated: int, rms: float) -> bool | None:
        """Take the name of a least squares, its number of simulations, and its rms error [rad] so far; return
        whether it is to end.
        """


class Ladder:
    """The estimates of a fit while it climbs.

    Attributes:
        problem: with the settings of the estimate that is kept.
        kept: that estimate.
        estimates: all, by name.
        refinements: by the estimate that each gave.
    """

    def __init__(
        self, problem: Problem, estimates: dict[str, Estimate], watch: Watcher, checkpoints: Checkpoints
    ) -> None:
        self.problem, self.estimates, self.refinements = problem, estimates, dict[str, Descent]()
        self.kept = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
        self._watch, self._checkpoints, self._late = watch, checkpoints, False
        self._left_out = dict[str, float]()

    def climb(self, whole: Problem) -> None:
        """Refine the estimate with each model and term that the settings of a fit's problem name."""
        settings, refinement = whole.settings, whole.settings.refinement
        assert refinement is not None
        two = settings.stage == "hyd" and settings.simulation.model == "ladder"
        climbs = two or bool(settings.terms())
        for model in ("refined", "dynamic")[: 1 + two]:
            possible = settings.terms(model)
            _, *kept_terms = self.kept.name.split("+")
            terms = [term for term in possible if term in kept_terms]
            self._rung(whole, "+".join([model, *terms]), climbs=climbs, if_nearer=model == "dynamic")
            kept_model, *_ = self.kept.name.split("+")
            for term in possible if kept_model == model else ():
                if term not in terms:
                    self._rung(whole, f"{self.kept.name}+{term}", climbs=climbs, if_nearer=True)
        if climbs:
            kept = self.kept
            last = self._refined(self.problem, kept.theta, refinement, kept.name)
            new = self._measured(self.problem, last, kept.name)
            self.kept = self.estimates[kept.name] = replace(new, left_out=kept.left_out)
        if settings.joint_refinement:
            _, *terms = self.kept.name.split("+")
            self._rung(whole, "+".join(["joint", *terms]), climbs=False, if_nearer=False)

    def known(self, theta: Array) -> Uncertainty:
        """Return how well the logs determine theta, (P,): the estimate that is kept, or one of a search."""
        problem, descent, slopes = self.problem, self.refinements.get(self.kept.name), None
        if descent is not None and len(descent.jacobian):  # what least squares ended with
            parameters, free = problem.parameters, problem.parameters.free
            change = estimate_box(parameters, theta).scale[free] / parameters.width(theta)[free]
            slopes = descent.jacobian[: problem.measured.size].T * change[:, None]
        return uncertainty(problem, theta, slopes)

    def _rung(self, whole: Problem, name: str, *, climbs: bool, if_nearer: bool) -> None:
        """Refine with the settings of an estimate, from the one kept; keep the result where it is better.

        climbs: whether it is enough to see that it is better. if_nearer: else it is kept in any case.
        """
        last, start, settings = self.problem, self.kept, whole.settings.refinement or RefinementSettings()
        own = whole.varied(whole.settings.of_estimate(name))
        theta = own.parameters.started(last.parameters.mapping(start.theta))
        other_model = own.settings.quasi_static != last.settings.quasi_static
        if if_nearer and (self._late or last.leaves_noise(start.theta)):
            return
        more = len(own.settings.terms()) > len(last.settings.terms())  # other parameters may stand for it
        if more or other_model:
            rough = settings.changed({"gain_tolerance": ROUGH})
            first = self._refined(own, theta, rough, f"{name} at first")
            theta = own.parameters.from_unit(first.point)
            if other_model and not own.rms(own.output_errors(theta[None]))[0] < FAR * start.rms:
                return
        step = f"{name} on the way" if climbs else name
        if climbs:
            settings = settings.changed({"gain_tolerance": max(FIRM, settings.gain_tolerance)})
        if more:
            theta = self._each_alone(own, theta, settings, name)
        result = self._refined(own, theta, settings, step)
        if self._late and if_nearer:
            return
        new = self._measured(own, result, name)
        nearer = new.rms < (1 - MIN_GAIN) * start.rms
        if nearer and more:
            without, with_it = self._error_left_out(last, start), self._error_left_out(own, new)
            self.estimates[name] = new = replace(new, left_out=(without, with_it))
            nearer = with_it < (1 - MIN_GAIN) * without or new.rms < CLEAR * start.rms
        if nearer or not if_nearer:
            self.problem, self.kept = own, new

    def _each_alone(self, problem: Problem, theta: Array, settings: RefinementSettings, name: str) -> Array:
        """Return theta, (P,), after every joint that can be was refined alone.

        What joints share is known better by now. A valve whose compensation stood for it starts without, too.
        """
        for joint in lone_joints(problem):
            own, parameters = alone(problem, joint, theta), problem.settings.parameters.values()
            loaded = np.array([p.quantity == "compensation" and p.joints == (joint,) for p in parameters])
            starts = np.unique([theta, np.where(loaded & own.parameters.free, 0.0, theta)], axis=0)
            tried = [
                self._refined(own.from_afar(), start, settings, f"{name} joint {joint} start {i}")
                for i, start in enumerate(starts, 1)
            ]
            best = min(tried, key=lambda one: one.cost)
            theta = np.where(own.parameters.free, own.parameters.from_unit(best.point), theta)
        return theta

    def _refined(self, problem: Problem, theta: Array, settings: RefinementSettings, name: str) -> Descent:
        result = refine(problem, theta, settings, self._watch.refining, self._checkpoints, name)
        self._late |= result.ending is Ending.TIME
        return result

    def _measured(self, problem: Problem, end: Descent, name: str) -> Estimate:
        """Measure an end of least squares, and list it."""
        self.estimates |= measured(problem, {name: problem.parameters.from_unit(end.point)})
        self.refinements[name] = end
        return self.estimates[name]

    def _error_left_out(self, problem: Problem, one: Estimate) -> float:
        if one.name not in self._left_out:
            self._left_out[one.name] = refitted(problem, one.theta).left_out
        return self._left_out[one.name]
