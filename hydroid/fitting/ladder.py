"""The ladder of a fit: refinements one after another, each of a model that has more in
it than the last one.

A rung is kept where it foretells parts of the logs that it has not seen better than the
one below, by more than the uncertainty of that (`left_out.is_clear`). Which rung that
is shows long before least squares has converged, so that ends early on the way
(`Refiner`). What is kept at the end is refined to the tolerance of the settings, after
least squares has also tried it from elsewhere (`Ladder._begin_anew`).
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.fitting.by_command import with_joints_by_command
from hydroid.fitting.estimates import Estimate, simulated
from hydroid.fitting.joint_trials import JointTrials, each_alone, joints_anew
from hydroid.fitting.left_out import LEAST_GAIN, gain, is_clear, predict_blocks
from hydroid.fitting.multistart import lone_joints
from hydroid.fitting.refinement import Refinement, refine, refine_from_afar
from hydroid.fitting.refiner import Place, Refiner
from hydroid.fitting.starts import by_speeds, new_curves, share_pump, with_open_centre
from hydroid.fitting.step import Start, Step, step_of
from hydroid.fitting.tried import Tried
from hydroid.posterior.error_model import likelihood_at, make_likelihood
from hydroid.posterior.whiteness import lasting
from hydroid.problem.problem import Problem
from hydroid.rungs import Rung
from hydroid.settings.fit import FitSettings

SECONDS = 20.0
"""of each log, over which another model is first tried [s]"""


class _Beginning(NamedTuple):
    """Where a model begins: theta, shape (P,); whether that may be far from an
    optimum."""

    theta: Array
    far: bool


class Ladder:
    """The estimates of a fit while it climbs.

    Attributes:
        problem: with the settings of the estimate that is kept.
        kept: that estimate.
        estimates: all, by name.
        refinements: by the estimate that each gave.
        tried: what terms of single joints gained.
    """

    def __init__(
        self, problem: Problem, estimates: dict[str, Estimate], refiner: Refiner
    ) -> None:
        self.problem = problem
        self.estimates = estimates
        self.refinements = dict[str, Refinement]()
        self.tried = Tried()
        self.kept = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
        self._step = step_of(self.kept.name)
        self._begun_anew: Step | None = None
        self._refiner = refiner
        self._settings = refiner.whole.settings
        self._lone = _lone_terms(problem, self._settings)

    def climb(self) -> None:
        """Refine the estimate with each model and term that the settings of the fit
        name."""
        self._climb_first()
        further = self._settings.rungs[1:]
        for rung in further:
            self._climb_model(rung)
        if self._step.model in {rung.name for rung in further}:
            self._try_each_without(self._step.terms)
        if self._refiner.leads_on:
            self._begin_joints_anew()
            self._begin_anew()
            self._try_by_command()
        if self._settings.joint_refinement:
            self._rung(self._step.changed(model="joint"), if_better=False)
        if self._refiner.leads_on:
            self._end()

    @property
    def _place(self) -> Place:
        """The estimate that is kept, as a place to go on from."""
        return Place(self._step, self.problem, self.kept.theta)

    def _climb_first(self) -> None:
        """Refine on the first rung, and then with terms besides.

        Those of single joints come first: with the wrong curve of a valve, a pump that
        is not there explains something. Without the pump that is there, a curve does,
        too: so where others were added, those of joints that were kept are tried
        without, and the rest again. Where that helped, so are the others.
        """
        rung = self._settings.rung
        self._step = Step("refined")
        by_starts = self._settings.search.algorithm == "multistart"
        # joints that were searched alone have no need of the others yet
        if not (by_starts and self._lone):
            self._rung(self._step, if_better=False)
        self._add_lone_terms(self._lone, 0)
        # what else the model needs shows where its errors are no larger than need be
        if self._settings.terms():
            self._begin_anew()
            self._add_lone_terms(self._not_refined(), 1)
        of_joints = self._step.terms
        self._add_terms(rung)
        if self._step.terms == of_joints:
            return
        self._try_each_without(of_joints)
        with_shared = self._step.terms
        self._add_lone_terms(self._lone, 2)
        if self._step.terms != with_shared:
            self._add_terms(rung)

    def _climb_model(self, rung: Rung) -> None:
        """Refine on a further rung, if it is better, and then with each of its terms
        besides; those of one joint are another method's."""
        possible = self._settings.terms(rung)
        terms = tuple(term for term in possible if term in self._step.terms)
        self._rung(Step(rung.name, terms))
        if self._step.model == rung.name:
            self._add_terms(rung)

    def _add_terms(self, rung: Rung) -> None:
        """Try each term that the kept model lacks on a rung, besides those of one joint
        alone."""
        of_joints = Counter(term for terms in self._lone.values() for term in terms)
        for term in self._settings.terms(rung):
            if term not in self._step.terms and of_joints[term] != 1:
                self._rung(self._step.changed(terms=(*self._step.terms, term)))

    def _not_refined(self) -> list[int]:
        """Return the joints, from 1, that lack a term which no joint alone was refined
        with: it promised too little, and may promise more now."""
        gains = self.tried.gains
        return [
            joint
            for joint, terms in self._lone.items()
            if any(gains.get(term) is None for term in self._place.lacking(terms))
        ]

    def _add_lone_terms(self, joints: Collection[int], round_number: int) -> None:
        """Try the terms of some joints, each on that joint alone, and the better ones
        of all joints together; rounds are numbered from 0."""
        refined = self.kept.name in self.refinements
        if refined and self._is_at_end():
            if not self._refiner.late:
                for joint in joints:
                    lacking = self._place.lacking(self._lone[joint])
                    self.tried.alone(None, *lacking)
            return
        trials = JointTrials(
            self._refiner, self._lone, self.tried, joints, round_number
        )
        found = trials.found(self._place)
        step = self._step.changed(terms=found.step.terms)
        if not refined:
            self._rung(step, if_better=False, begun=found.theta)
        elif step != self._step:
            start = Start.JOINTS_FIRST + Start.ROUND * round_number
            self._rung_from(start, step, found.theta)
        elif found.theta is not self.kept.theta:
            # a joint went on alone from where all together had ended
            start = Start.AGAIN + Start.ROUND * round_number
            self._rung_from(start, step, found.theta, if_better=False)

    def _try_each_without(self, terms: Sequence[str]) -> None:
        """Try to drop terms, one after the other."""
        for term in terms:
            if not self._refiner.late:
                self._try_without(term)

    def _try_without(self, term: str) -> None:
        """Drop a term that was kept below, unless this model foretells clearly better
        with it.

        A term may have stood for what only a richer model has.
        """
        rest = tuple(one for one in self._step.terms if one != term)
        step = self._step.changed(terms=rest)
        own = self._refiner.problem_of(step)
        theta = own.parameters.started(self._place.values)
        on_the_way = step.changed(phase="on the way")
        result = self._refiner.on_the_way(own, theta, on_the_way)
        with_it = predict_blocks(self.problem, self.refinements[self.kept.name])
        gained = gain(with_it, predict_blocks(own, result))
        if not self._refiner.late and not is_clear(*gained):
            self.tried.dropped(gained, term)
            self._keep(own, self._measured(own, result, step), step)

    def _begin_joints_anew(self) -> None:
        """Refine the kept estimate once more, with each joint that errs by more than
        noise as it is from elsewhere, where that is much likelier.

        With a pump still to come they would stand for that.
        """
        if share_pump(self.problem, self.kept.theta):
            return
        theta = joints_anew(self._refiner, self._place)
        if theta is not self.kept.theta:
            step = self._step.changed(start=Start.JOINTS_ANEW, phase="on the way")
            end = self._refiner.on_the_way(self.problem, theta, step)
            self._keep_likelier(end)

    def _begin_anew(self) -> None:
        """Refine the kept estimate once more, from where output errors lead if they
        were independent; keep that where it is likelier, by the errors as they are.

        Errors that last tell little, and then the priors hold the parameters. That is
        right where the model errs, but not where errors last because parameters are
        held: an optimum, too, and least squares does not leave it.
        """
        if self._refiner.late or self._begun_anew == self._step:
            return
        self._begun_anew = self._step
        step = self._step.changed(start=Start.ANEW, phase="on the way")
        self._keep_likelier(self._refiner.anew(self.problem, self.kept.theta, step))

    def _try_by_command(self) -> None:
        """Let the speed of joints follow their commands alone, where that foretells
        parts left out better: those that gain alone are refined together."""
        if self._refiner.late:
            return
        found = with_joints_by_command(self._refiner, self._place, self.tried)
        if found.step != self._step:
            # at the noise all joints together tell no more than each alone has
            at_noise = self.problem.leaves_noise(self.kept.theta)
            self._rung(found.step, begun=found.theta, if_better=not at_noise)

    def _end(self) -> None:
        """Refine the estimate that is kept to the tolerance of the settings."""
        last = self._refiner.to_the_end(self.problem, self.kept.theta, self._step)
        self.kept = self._measured(self.problem, last, self._step)

    def _keep_likelier(self, end: Refinement) -> None:
        """Keep another end of the kept model's least squares where it is likelier, by
        the errors as they are."""
        if self._refiner.late:
            return
        problem = self.problem
        likelihood = make_likelihood(problem)
        theta = problem.parameters.from_unit(end.point)
        gained = likelihood.log_posterior(theta)
        gained -= likelihood.log_posterior(self.kept.theta)
        if gained > LEAST_GAIN:
            self.kept = self._measured(problem, end, self._step)

    def _rung_from(
        self, start: int, step: Step, theta: Array, *, if_better: bool = True
    ) -> None:
        """Refine as `_rung` does from a start with a number, which the checkpoints have
        in their names."""
        numbered = step.changed(start=start)
        self._rung(numbered, if_better=if_better, begun=theta)
        if self._step == numbered:
            self._step = step

    def _rung(
        self, step: Step, *, if_better: bool = True, begun: Array | None = None
    ) -> None:
        """Refine with the settings of an estimate, and keep the result, if asked only
        where it is better.

        It begins at `begun`, shape (P,), else at the estimate that is kept.
        """
        if if_better and self._is_at_end():
            return
        own = self._refiner.problem_of(step)
        begin = self._beginning(own, begun, step)
        if begin is None:
            return
        result = self._on_the_way(own, begin, step)
        if self._refiner.late and if_better:
            return
        new = self._measured(own, result, step)
        if if_better:
            last = self.refinements[self.kept.name]
            without = predict_blocks(self.problem, last)
            gained = gain(predict_blocks(own, result), without)
            new = replace(new, gained=gained)
            self.estimates[step.estimate] = new
            if not is_clear(*gained):
                self.tried.dropped(gained, *self._place.lacking(step.terms))
                return
        self._keep(own, new, step)

    def _on_the_way(
        self, problem: Problem, begin: _Beginning, step: Step
    ) -> Refinement:
        """Refine a model from where it begins, and one that has got a shared pump from
        an open centre, too; return the likelier end."""
        how = refine_from_afar if begin.far else refine
        on_the_way = step.changed(phase="on the way")
        end = self._refiner.on_the_way(problem, begin.theta, on_the_way, how)
        open_centre = with_open_centre(problem, self.problem, begin.theta)
        if open_centre is None or self._refiner.late:
            return end
        tried = on_the_way.changed(start=Start.PUMP_ANEW)
        other = self._refiner.on_the_way(problem, open_centre, tried, how)
        return min(end, other, key=lambda one: one.negative_log)

    def _beginning(
        self, problem: Problem, theta: Array | None, step: Step
    ) -> _Beginning | None:
        """Return where the next model begins: at theta, (P,), or near the estimate that
        is kept.

        None: another model, which is slow to simulate, has nothing to explain, or
        begins with larger errors.
        """
        last = self.problem
        far = False
        if theta is None:
            # what a search ended at may be far from an optimum
            far = self.kept.name not in self.refinements
            far |= bool(new_curves(problem, last))
            begun = Place(step, problem, _begun(problem, self._place))
            renewed = _renewed(problem, last, begun.theta)
            theta = each_alone(self._refiner, begun, renewed)
        if problem.settings.rung is not last.settings.rung:
            if self._is_white():
                return None
            far = True
            theta = self._nearer(problem, theta, step)
            rms = problem.rms(problem.output_errors(theta[None]))[0]
            if rms > self.kept.rms:
                return None
        return _Beginning(theta, far)

    def _nearer(self, problem: Problem, theta: Array, step: Step) -> Array:
        """Return where another model begins, (P,): near the last model's estimate, or
        the settings' start.

        What stood for oil and inertia in the last model, a lag or a dead band, may lie
        behind a hill: so the start is tried where the last model leads to larger
        errors. Both are refined a little by output errors, over the first seconds of
        the logs: innovations still have the drift of the last model's errors, and the
        other model is slow.
        """
        parts = [log.first(SECONDS) for log in problem.logs]
        last = self.problem.varied(self.problem.settings, parts)
        (rms,) = last.rms(last.output_errors(self.kept.theta[None]))
        problem = problem.varied(problem.settings, parts)
        parameters = problem.parameters
        ends = list[Refinement]()
        for number, begun in enumerate((theta, parameters.start)):
            at_first = step.changed(phase="at first", start=number)
            end = self._refiner.at_first(problem, begun, at_first)
            ends.append(end)
            errors = problem.output_errors(parameters.from_unit(end.point[None]))
            if problem.rms(errors)[0] <= rms:
                break
        return parameters.from_unit(min(ends, key=lambda end: end.negative_log).point)

    def _is_at_end(self) -> bool:
        """Return whether there is no time left, or nothing but noise to explain."""
        return self._refiner.late or self.problem.leaves_noise(self.kept.theta)

    def _is_white(self) -> bool:
        """Return whether the errors of the estimate that is kept leave innovations that
        are white."""
        numbers = self.refinements[self.kept.name].numbers
        shown = likelihood_at(self.problem, self.kept.theta, numbers).shown
        errors = self.problem.output_errors(self.kept.theta[None])
        return not any(lasting(shown, shown.innovations(errors)[0]).values())

    def _keep(self, problem: Problem, estimate: Estimate, step: Step) -> None:
        self.problem = problem
        self.kept = estimate
        self._step = step

    def _measured(self, problem: Problem, end: Refinement, step: Step) -> Estimate:
        """Measure an end of least squares, and list it; one of the model that is kept
        gained what that has gained."""
        name = step.estimate
        theta = problem.parameters.from_unit(end.point)
        new = simulated(problem, {name: theta})[name]
        if name == self.kept.name:
            new = replace(new, gained=self.kept.gained)
        self.estimates[name] = new
        self.refinements[name] = end
        return new


def _lone_terms(
    problem: Problem, settings: FitSettings
) -> Mapping[int, tuple[str, ...]]:
    """Return the terms that can be fitted on each joint alone, by joint, numbered from
    1; a term of each joint, as the oil, is among those of all."""
    terms = {joint: settings.terms_of(joint) for joint in lone_joints(problem)}
    return {joint: own for joint, own in terms.items() if own}


def _begun(problem: Problem, last: Place) -> Array:
    """Return where another model begins, (P,), from the last one's place.

    A valve that has a curve now begins at the speeds that the logs show: from a power
    law, least squares seldom finds a valve that opens all at once.
    """
    begun = problem.parameters.started(last.values)
    for joint in new_curves(problem, last.problem):
        begun = by_speeds(problem, joint, begun)
    return begun


def _renewed(problem: Problem, last: Problem, theta: Array) -> list[int]:
    """Return the joints, from 1, that begin alone: all that is new in the model is of
    single joints, and of these.

    None where joints share a pump.
    """
    new = {*problem.settings.parameters} - {*last.settings.parameters}
    own = {j: new & problem.settings.acting_on(j) for j in lone_joints(problem)}
    if share_pump(problem, theta):
        return []
    if new != set[str]().union(*own.values()):
        return []
    return [joint for joint, names in own.items() if names]
