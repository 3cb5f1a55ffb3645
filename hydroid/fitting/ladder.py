"""The ladder of a fit: refinements one after another, each of a model that has more in
it than the last one.

A rung is kept where it foretells parts of the logs that it has not seen better than the
one below, by more than the uncertainty of that (`left_out.is_clear`). Which rung that
is shows long before least squares has converged, so that ends early on the way
(`FIRM`). What is kept at the end is refined to the tolerance of the settings,
after least squares has also tried it from elsewhere (`Ladder._begin_anew`).
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.left_out import (
    LEAST_GAIN,
    LeftOut,
    gain,
    is_clear,
    predict_blocks,
)
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.fitting.refinement import Refinement, promised, refine, refine_from_afar
from hydroid.fitting.starts import (
    LESS,
    by_speeds,
    has_curve,
    likelier,
    share_pump,
    valve_alone,
    with_open_centre,
    with_other_valve,
)
from hydroid.fitting.step import Step, step_of
from hydroid.posterior.error_model import Likelihood, likelihood_at, make_likelihood
from hydroid.posterior.linear import estimate_box
from hydroid.posterior.uncertainty import Uncertainty, uncertainty
from hydroid.posterior.whiteness import lasting
from hydroid.problem.problem import Problem
from hydroid.rungs import BY_COMMAND, Rung
from hydroid.search.descent import Ending
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

FIRST = 10
"""iterations after which another beginning must err less than the last one"""
SECONDS = 20.0
"""of each log, over which another model is first tried [s]"""
BENDS = 0.3
"""the same for what a valve's curve promises: it bends to any errors a little"""
ANEW = 3
"""number of the start from which the kept estimate is refined again"""
JOINTS_ANEW = 4
"""number of the start with joints that began alone elsewhere"""
JOINTS_FIRST = 7
"""number of the start with terms that joints alone have asked for"""
PUMP_ANEW = 5
"""number of the start with a pump on open centres"""
AS_IT_IS = 6
"""number of the start of a joint alone as it is, beside one by its command alone"""
FIRM = 1e-3  # gain below which least squares ends where another rung may follow


@record
class Estimate:
    """One parameter set with its response.

    Attributes:
        name: of the estimate.
        theta: its parameters, shape (P,).
        segments: objectives by segment, shape (S,).
        overall: norm over the whole record.
        rms: of the output error [rad].
        responses: simulated outputs of each log [rad], shape (T, K).
        gained: of an estimate with another term or model, by how much it foretells
            parts of the logs left out better than the one below, and the standard error
            of that (`left_out.gain`).
    """

    name: str
    theta: Array
    segments: Array
    overall: float
    rms: float
    responses: tuple[Array, ...]
    gained: tuple[float, float] | None = None

    @property
    def usable(self) -> bool:
        """Whether it could be simulated: the mean of several candidates that could need
        not."""
        return bool(np.isfinite(self.rms))


def simulated(problem: Problem, candidates: Mapping[str, Array]) -> dict[str, Estimate]:
    """Simulate candidates by name, each of shape (P,), and measure them; those that
    diverged come last."""
    theta = np.array(list(candidates.values()))
    responses = problem.responses(theta)
    errors = problem.errors(responses)
    norms, rms = problem.norms(errors), problem.rms(errors)
    # of each candidate
    angles = zip(*(response.angle for response in responses), strict=True)
    estimates = map(
        Estimate, candidates, theta, norms[:, :-1], norms[:, -1], rms, angles
    )
    return {e.name: e for e in sorted(estimates, key=lambda e: not e.usable)}


class Watcher(Protocol):
    """Takes the progress of a fit, and says when its time is up."""

    def generation(self, row: Array) -> bool | None:
        """Take a row of HISTORY; return whether the search is to end."""

    def refining(self, step: Step, simulated: int, rms: float) -> bool | None:
        """Take a step, its number of simulations, and its rms error [rad]; return
        whether it is to end."""


class _Beginning(NamedTuple):
    """Where a model begins: theta, shape (P,); whether that may be far from an
    optimum."""

    theta: Array
    far: bool


class _Alone(NamedTuple):
    """Where a joint alone leads: the terms of the model, and its theta, shape (P,)."""

    terms: tuple[str, ...]
    theta: Array


class Ladder:
    """The estimates of a fit while it climbs.

    Attributes:
        problem: with the settings of the estimate that is kept.
        kept: that estimate.
        estimates: all, by name.
        refinements: by the estimate that each gave.
        tried: by how much each term of one joint foretells parts of the logs left out
            better on that joint alone, and the standard error of that (`left_out.gain`);
            None: it was not refined, as it promises too little or noise alone is left.
            A term that was dropped of all joints together has what it gained there.
    """

    def __init__(
        self,
        problem: Problem,
        estimates: dict[str, Estimate],
        watch: Watcher,
        checkpoints: Checkpoints,
    ) -> None:
        self.problem = problem
        self.estimates = estimates
        self.refinements = dict[str, Refinement]()
        self.tried = dict[str, tuple[float, float] | None]()
        self.kept = min(estimates.values(), key=lambda e: e.rms if e.usable else np.inf)
        self._watch = watch
        self._checkpoints = checkpoints
        self._dropped = set[str]()
        self._late = False
        self._begun_anew: Step | None = None
        self._step = step_of(self.kept.name)

    def climb(self, whole: Problem) -> None:
        """Refine the estimate with each model and term that the settings of a fit's
        problem name."""
        settings = whole.settings
        refinement = settings.refinement
        assert refinement is not None
        further = settings.rungs[1:]
        on_the_way = refinement
        by_starts = settings.search.algorithm == "multistart"
        choices = settings.by_command_terms
        anew = bool(further or settings.terms() or choices or by_starts)
        if anew:
            tolerance = max(FIRM, refinement.gain_tolerance)
            on_the_way = refinement.changed({"gain_tolerance": tolerance})
        lone = self._lone_terms(settings)
        self._climb_first(whole, lone, on_the_way, alone_first=by_starts and bool(lone))
        for rung in further:
            self._climb_model(whole, rung, lone, on_the_way)
        if self._step.model in {rung.name for rung in further}:
            self._try_each_without(whole, self._step.terms, on_the_way)
        if anew:
            self._begin_joints_anew(on_the_way)
            self._begin_anew(on_the_way)
            self._try_by_command(whole, choices, on_the_way)
            self._end(refinement)
        if settings.joint_refinement:
            joint = self._step.changed(model="joint")
            self._rung(whole, joint, refinement, if_better=False)

    def _climb_first(
        self,
        whole: Problem,
        lone: Mapping[int, Sequence[str]],
        settings: RefinementSettings,
        *,
        alone_first: bool,
    ) -> None:
        """Refine on the first rung, and then with terms besides.

        Those of single joints come first: with the wrong curve of a valve, a pump that
        is not there explains something. Without the pump that is there, a curve does,
        too: so where others were added, those of joints that were kept are tried
        without, and the rest again. Where that helped, so are the others.
        """
        rung = whole.settings.rung
        self._step = Step("refined")
        # joints that were searched alone have no need of the others yet
        if not alone_first:
            self._rung(whole, self._step, settings, if_better=False)
        self._add_lone_terms(whole, lone, settings)
        # what else the model needs shows where its errors are no larger than need be
        if whole.settings.terms():
            self._begin_anew(settings)
        of_joints = self._step.terms
        self._add_terms(whole, rung, lone, settings)
        if self._step.terms == of_joints:
            return
        self._try_each_without(whole, of_joints, settings)
        with_shared = self._step.terms
        self._add_lone_terms(whole, lone, settings)
        if self._step.terms != with_shared:
            self._add_terms(whole, rung, lone, settings)

    def _climb_model(
        self,
        whole: Problem,
        rung: Rung,
        lone: Mapping[int, Sequence[str]],
        settings: RefinementSettings,
    ) -> None:
        """Refine on a further rung, if it is better, and then with each of its terms
        besides; those of one joint, of `lone`, are another method's."""
        possible = whole.settings.terms(rung)
        terms = tuple(term for term in possible if term in self._step.terms)
        self._rung(whole, Step(rung.name, terms), settings, if_better=True)
        if self._step.model == rung.name:
            self._add_terms(whole, rung, lone, settings)

    def _add_terms(
        self,
        whole: Problem,
        rung: Rung,
        lone: Mapping[int, Sequence[str]],
        settings: RefinementSettings,
    ) -> None:
        """Try each term that the kept model lacks on a rung, besides those of one joint
        of `lone`."""
        of_joints = Counter(term for terms in lone.values() for term in terms)
        for term in whole.settings.terms(rung):
            if term not in self._step.terms and of_joints[term] != 1:
                with_term = self._step.changed(terms=(*self._step.terms, term))
                self._rung(whole, with_term, settings, if_better=True)

    def _end(self, settings: RefinementSettings) -> None:
        """Refine the estimate that is kept to the tolerance of the settings."""
        likelihood = make_likelihood(self.problem)
        last = self._refined(likelihood, self.kept.theta, settings, self._step)
        self.kept = self._measured(self.problem, last, self._step)

    def _begin_anew(self, settings: RefinementSettings) -> None:
        """Refine the kept estimate once more, from where output errors lead if they
        were independent; keep that where it is likelier, by the errors as they are.

        Errors that last tell little, and then the priors hold the parameters. That is
        right where the model errs, but not where errors last because parameters are
        held: an optimum, too, and least squares does not leave it.
        """
        if self._late or self._begun_anew == self._step:
            return
        self._begun_anew = self._step
        step = self._step.changed(start=ANEW, phase="on the way")
        end = self._refined_anew(self.problem, self.kept.theta, settings, step)
        self._keep_likelier(end)

    def _begin_joints_anew(self, settings: RefinementSettings) -> None:
        """Refine the kept estimate once more, with each joint that errs by more than
        noise as it is from elsewhere, where that is much likelier.

        What slows a joint under load may be its valve or its lever, and how late it is
        a delay or a lag: least squares settles for one and does not leave it, whatever
        the model gets later. So a joint begins where the settings do, a valve with a
        curve at the speeds that the logs show, and once more with the other kind of
        valve. With a pump still to come they would stand for that.
        """
        problem = self.problem
        theta = self.kept.theta
        if share_pump(problem, theta):
            return
        for joint in lone_joints(problem):
            own = alone(problem, joint, theta)
            if own.leaves_noise(theta):
                continue
            begun = np.where(own.parameters.free, problem.parameters.start, theta)
            starts = (
                by_speeds(problem, joint, begun),
                with_other_valve(problem, joint, theta),
            )
            for number, start in enumerate(starts, ANEW):
                if self._late:
                    return
                step = self._step.changed(start=number, joint=joint)
                end = self._refined_anew(own, start, settings, step)
                reached = own.parameters.from_unit(end.point)
                theta = likelier(problem, theta, reached)
        if theta is not self.kept.theta:
            step = self._step.changed(start=JOINTS_ANEW, phase="on the way")
            end = self._refined(make_likelihood(problem), theta, settings, step)
            self._keep_likelier(end)

    def _try_by_command(
        self, whole: Problem, terms: Mapping[str, int], settings: RefinementSettings
    ) -> None:
        """Let the speed of joints follow their commands alone, by a term of each joint,
        numbered from 1, where that foretells parts left out better than load and pump.

        Each is tried alone, and those that gain are refined together. A joint that
        errs by no more than noise stays as it is.
        """
        problem = self.problem
        theta = self.kept.theta
        step = self._step
        if self._late or not problem.settings.rung.has(BY_COMMAND):
            return
        possible = problem.settings.outputs
        if len(possible) > 1:
            possible = lone_joints(problem)
        erring = dict[str, int]()
        for term, joint in terms.items():
            self._note_alone(term, None)
            if joint in possible:
                own = _of_joint(problem, joint, theta)
                if not own.leaves_noise(theta):
                    erring[term] = joint
        for term, joint in erring.items():
            tried = step.changed(terms=(*step.terms, term), joint=joint)
            found = self._by_command(
                whole, problem, theta, tried, settings, len(erring)
            )
            if self._late:
                return
            if found is not None:
                step = step.changed(terms=found.terms)
                problem = whole.varied(whole.settings.of_estimate(step.estimate))
                theta = found.theta
        if step != self._step:
            self._rung(whole, step, settings, if_better=True, begun=theta)

    def _by_command(
        self,
        whole: Problem,
        last: Problem,
        theta: Array,
        step: Step,
        settings: RefinementSettings,
        among: int,
    ) -> "_Alone | None":
        """Refine a joint alone as it is at theta of the last problem, (P,), and by its
        command, by the last term of a step; None where that is not clearly better, of
        `among` joints, or there was no time."""
        own = whole.varied(whole.settings.of_estimate(step.estimate))
        starts = valve_alone(own, step.joint, last, theta)
        before = _of_joint(last, step.joint, theta)
        after = _of_joint(own, step.joint, starts[0])
        as_it_is = self._refined(
            make_likelihood(before),
            theta,
            settings,
            step.changed(terms=step.terms[:-1], start=AS_IT_IS),
        )
        ends = [
            self._far_end(after, start, settings, step.changed(start=number))
            for number, start in enumerate(starts, 1)
        ]
        far = min(ends, key=lambda one: one.negative_log)
        # it has fewer parameters, but where it errs much more it predicts worse
        reached = before.parameters.from_unit(as_it_is.point)
        independent = make_likelihood(before).of_independent_errors
        enough = independent.negative_log_at(reached) + LESS * before.measured.size
        if self._late or far.negative_log > enough:
            return None
        near = after.parameters.from_unit(far.point)
        end = self._refined(make_likelihood(after), near, settings, step)
        if self._late:
            return None
        gained = gain(
            self._left_out_of(after, end), self._left_out_of(before, as_it_is)
        )
        self._note_alone(step.terms[-1], gained)
        if not is_clear(*gained, among):
            return None
        return _Alone(step.terms, after.parameters.from_unit(end.point))

    def _keep_likelier(self, end: Refinement) -> None:
        """Keep another end of the kept model's least squares where it is likelier, by
        the errors as they are."""
        if self._late:
            return
        problem = self.problem
        likelihood = make_likelihood(problem)
        theta = problem.parameters.from_unit(end.point)
        gained = likelihood.log_posterior(theta)
        gained -= likelihood.log_posterior(self.kept.theta)
        if gained > LEAST_GAIN:
            self.kept = self._measured(problem, end, self._step)

    def known(self, theta: Array) -> Uncertainty:
        """Return how well the logs determine theta, (P,): the estimate that is kept, or
        one of a search."""
        problem = self.problem
        descent = self.refinements.get(self.kept.name)
        if descent is None or not len(descent.jacobian):
            return uncertainty(problem, theta)
        # what least squares ended with
        parameters = problem.parameters
        free = parameters.free
        scale = estimate_box(parameters, theta).scale[free]
        change = scale / parameters.width(theta)[free]
        slopes = descent.jacobian[: problem.measured.size].T * change[:, None]
        return uncertainty(problem, theta, slopes, descent.numbers)

    def _rung(
        self,
        whole: Problem,
        step: Step,
        settings: RefinementSettings,
        *,
        if_better: bool,
        begun: Array | None = None,
    ) -> None:
        """Refine with the settings of an estimate, from the one kept; keep the result
        where it is better.

        Args:
            whole: the problem of the whole fit.
            step: the model and its terms.
            settings: of least squares.
            if_better: whether it is kept only then.
            begun: where it begins, shape (P,), if not at the kept one.
        """
        last = self.problem
        start = self.kept
        if if_better and self._is_at_end():
            return
        own = whole.varied(whole.settings.of_estimate(step.estimate))
        begin = self._beginning(own, begun, settings, step)
        if begin is None:
            return
        result = self._on_the_way(own, begin, settings, step)
        if self._late and if_better:
            return
        new = self._measured(own, result, step)
        if if_better:
            without = self._left_out_of(last, self.refinements[start.name])
            gained = gain(self._left_out_of(own, result), without)
            new = replace(new, gained=gained)
            self.estimates[step.estimate] = new
            if not is_clear(*gained):
                for term in step.terms:
                    if term not in self._step.terms:
                        self._note_dropped(term, gained)
                return
        self._keep(own, new, step)

    def _on_the_way(
        self,
        problem: Problem,
        begin: "_Beginning",
        settings: RefinementSettings,
        step: Step,
    ) -> Refinement:
        """Refine a model from where it begins, and one that has got a shared pump from
        an open centre, too; return the likelier end."""
        how = refine_from_afar if begin.far else refine
        likelihood = make_likelihood(problem)
        on_the_way = step.changed(phase="on the way")
        end = self._refined(likelihood, begin.theta, settings, on_the_way, how)
        open_centre = with_open_centre(problem, self.problem, begin.theta)
        if open_centre is None or self._late:
            return end
        tried = on_the_way.changed(start=PUMP_ANEW)
        other = self._refined(likelihood, open_centre, settings, tried, how)
        return min(end, other, key=lambda one: one.negative_log)

    def _beginning(
        self,
        problem: Problem,
        theta: Array | None,
        settings: RefinementSettings,
        step: Step,
    ) -> "_Beginning | None":
        """Return where the next model begins: at theta, (P,), or near the estimate that
        is kept.

        None: another model, which is slow to simulate, has nothing to explain, or
        begins with larger errors.
        """
        last = self.problem
        start = self.kept
        far = False
        if theta is None:
            # what a search ended at may be far from an optimum
            far = start.name not in self.refinements
            far |= bool(_new_curves(problem, last))
            theta = _begun(problem, last, start.theta)
            renewed = _renewed(problem, last, theta)
            theta = self._each_alone(problem, renewed, theta, settings, step)
        if problem.settings.rung is not last.settings.rung:
            if self._is_white():
                return None
            far = True
            theta = self._nearer(problem, theta, settings, step)
            if problem.rms(problem.output_errors(theta[None]))[0] > start.rms:
                return None
        return _Beginning(theta, far)

    def _each_alone(
        self,
        problem: Problem,
        joints: Sequence[int],
        theta: Array,
        settings: RefinementSettings,
        step: Step,
    ) -> Array:
        """Return what some joints, each alone, lead to from theta, (P,).

        A joint whose errors are large weighs little beside the others, and together
        with them least squares ends before it has moved.
        """
        for joint in joints:
            own = alone(problem, joint, theta)
            lone_step = step.changed(joint=joint, phase="at first")
            end = self._refined(make_likelihood(own), theta, settings, lone_step)
            reached = own.parameters.from_unit(end.point)
            theta = np.where(problem.parameters.free, reached, theta)
        return theta

    def _nearer(
        self,
        problem: Problem,
        theta: Array,
        settings: RefinementSettings,
        step: Step,
    ) -> Array:
        """Return where another model begins, (P,): near the last model's estimate, or
        the settings' start.

        What stood for oil and inertia in the last model, a lag or a dead band, may lie
        behind a hill: so the start is tried where the last model leads to larger
        errors. Both are refined a little by output errors, over the first seconds of
        the logs: innovations still have the drift of the last model's errors, and the
        other model is slow.
        """
        few = settings.changed({"iterations": FIRST})
        parts = [log.first(SECONDS) for log in problem.logs]
        last = self.problem.varied(self.problem.settings, parts)
        (rms,) = last.rms(last.output_errors(self.kept.theta[None]))
        problem = problem.varied(problem.settings, parts)
        likelihood = make_likelihood(problem)
        parameters = problem.parameters
        ends = list[Refinement]()
        for number, begun in enumerate((theta, parameters.start)):
            at_first = step.changed(phase="at first", start=number)
            end = self._refined(likelihood.of_output_errors, begun, few, at_first)
            ends.append(end)
            errors = problem.output_errors(parameters.from_unit(end.point[None]))
            if problem.rms(errors)[0] <= rms:
                break
        return parameters.from_unit(min(ends, key=lambda end: end.negative_log).point)

    def _lone_terms(self, settings: FitSettings) -> dict[int, tuple[str, ...]]:
        """Return the terms that can be fitted on each joint alone, by joint, numbered
        from 1; a term of each joint, as the oil, is among those of all."""
        joints = lone_joints(self.problem)
        terms = {joint: settings.terms_of(joint) for joint in joints}
        return {joint: own for joint, own in terms.items() if own}

    def _add_lone_terms(
        self,
        whole: Problem,
        lone: Mapping[int, Sequence[str]],
        settings: RefinementSettings,
    ) -> None:
        """Try the terms of each joint on that joint alone, which takes seconds; then
        the better ones of all joints together.

        The other joints follow their logs meanwhile. A term of each joint that one of
        them needs is added to all.
        """
        refined = self.kept.name in self.refinements
        if refined and self._is_at_end():
            if not self._late:
                for terms in lone.values():
                    self._note_each(self._lacking(terms, self._step), None)
            return
        found, fitted_with = self._joint_by_joint(whole, lone, settings)
        theta = found.theta
        step = self._step.changed(terms=found.terms)
        # the checkpoints of what is begun alone are not those of a later trial
        begun_alone = step.changed(start=JOINTS_FIRST)
        if step != self._step and not self._late:
            new = {*step.terms} - {*self._step.terms}
            behind = [
                joint
                for joint, terms in lone.items()
                if new.intersection(terms) - fitted_with.get(joint, set())
            ]
            problem = whole.varied(whole.settings.of_estimate(step.estimate))
            theta = self._each_alone(problem, behind, theta, settings, begun_alone)
        if not refined:
            self._rung(whole, step, settings, if_better=False, begun=theta)
        elif step != self._step:
            self._rung(whole, begun_alone, settings, if_better=True, begun=theta)
            if self._step == begun_alone:
                self._step = step
        elif theta is not self.kept.theta:
            # a joint went on alone from where all together had ended
            again = step.changed(start=2)
            self._rung(whole, again, settings, if_better=False, begun=theta)
            self._step = step

    def _joint_by_joint(
        self,
        whole: Problem,
        lone: Mapping[int, Sequence[str]],
        settings: RefinementSettings,
    ) -> tuple["_Alone", dict[int, set[str]]]:
        """Try the terms of each joint on that joint alone.

        Returned is where that leads, and with which terms each joint has been fitted.
        """
        problem = self.problem
        theta = self.kept.theta
        step = self._step
        fitted_with = dict[int, set[str]]()
        for joint, terms in lone.items():
            lacking = self._lacking(terms, step)
            promising = self._promising(whole, problem, theta, step, joint, lacking)
            if self._late:
                break
            self._note_each([one for one in lacking if one not in promising], None)
            if not promising:
                continue
            tried = step.changed(terms=(*step.terms, *promising), joint=joint)
            found = self._alone(whole, problem, theta, tried, settings, len(lone))
            if self._late:
                break
            fitted_with[joint] = {*found.terms}
            if found.terms == step.terms:
                theta = likelier(problem, theta, found.theta)
                continue
            step = step.changed(terms=found.terms)
            problem = whole.varied(whole.settings.of_estimate(step.estimate))
            theta = found.theta
        return _Alone(step.terms, theta), fitted_with

    def _lacking(self, terms: Sequence[str], step: Step) -> list[str]:
        """Return the terms that a step does not have."""
        return [term for term in terms if term not in step.terms]

    def _promising(
        self,
        whole: Problem,
        last: Problem,
        theta: Array,
        step: Step,
        joint: int,
        lacking: Sequence[str],
    ) -> Sequence[str]:
        """Return which of the terms that a joint lacks may gain anything for it alone,
        from the theta of the last problem, (P,).

        That takes a Jacobian or two, and most joints of most machines lack no term.
        """
        if not lacking or self._late or alone(last, joint, theta).leaves_noise(theta):
            return ()
        values = last.parameters.mapping(theta)
        others = [term for term in lacking if not whole.settings.bends(term)]
        least_of_all = LESS if len(others) == len(lacking) else BENDS
        for terms, least in ((lacking, least_of_all), (others, LESS)):
            with_them = step.changed(terms=(*step.terms, *terms))
            problem = whole.varied(whole.settings.of_estimate(with_them.estimate))
            started = problem.parameters.started(values)
            new = np.array([name not in values for name in problem.settings.parameters])
            likelihood = make_likelihood(alone(problem, joint, started))
            if promised(likelihood.of_independent_errors, started, new) > least:
                return terms
            if len(others) in (0, len(lacking)):
                break
        return ()

    def _alone(
        self,
        whole: Problem,
        last: Problem,
        theta: Array,
        step: Step,
        settings: RefinementSettings,
        among: int,
    ) -> "_Alone":
        """Refine a joint alone from the theta of the last problem, (P,), and with the
        terms of a step that this lacks: all of them, and else each.

        What one term explains may show only beside another: what a wrong curve of a
        valve does is hidden while the joint does not ring. Those that it does as well
        without are dropped again. The joint is one `among` several, of which some seem
        better by chance. All begin where independent output errors lead: else what
        helped the one would count for the terms. Where these hardly fall with a term,
        it is not refined any further.
        """
        has = last.settings.terms()
        kept = tuple(term for term in step.terms if term in has)
        new = [term for term in step.terms if term not in has]
        before = alone(last, step.joint, theta)
        without_them = step.changed(terms=kept)
        begun = self._far_end(before, theta, settings, without_them)
        begun_at = before.parameters.from_unit(begun.point)
        end = self._refined(make_likelihood(before), begun_at, settings, without_them)
        enough = begun.negative_log - LESS * before.measured.size
        left_out = self._left_out_of(before, end)
        choices = [new]
        if len(new) > 1:
            choices += [[term] for term in new]
        for terms in choices:
            tried = step.changed(terms=(*kept, *terms))
            problem = whole.varied(whole.settings.of_estimate(tried.estimate))
            own, ends = self._ends_with(
                last, problem, begun_at, tried, settings, enough
            )
            if self._late:
                break
            self._note_each(terms, None)
            if not ends:
                continue
            end_with = min(ends, key=lambda one: one.negative_log)
            left_out_with = self._left_out_of(own, end_with)
            gained = gain(left_out_with, left_out)
            self._note_each(terms, gained)
            if is_clear(*gained, among):
                found = _Alone(tried.terms, own.parameters.from_unit(end_with.point))
                if len(terms) == 1:
                    return found
                compared = left_out, left_out_with
                return self._fewer(whole, own, found, compared, tried, settings, among)
        return _Alone(kept, before.parameters.from_unit(end.point))

    def _fewer(
        self,
        whole: Problem,
        problem: Problem,
        found: "_Alone",
        compared: tuple[LeftOut, LeftOut],
        step: Step,
        settings: RefinementSettings,
        among: int,
    ) -> "_Alone":
        """Drop terms of a joint alone that its model predicts as well without, as long
        as the rest is still clearly better than none of them.

        `compared` are the predictions of parts left out without any of them, and with
        all.
        """
        none, left_out = compared
        had = none.problem.settings.terms()
        for term in [one for one in found.terms if one not in had]:
            if self._late:
                break
            fewer = step.changed(terms=tuple(one for one in found.terms if one != term))
            less = whole.varied(whole.settings.of_estimate(fewer.estimate))
            started = less.parameters.started(problem.parameters.mapping(found.theta))
            own = alone(less, step.joint, started)
            end = self._refined_anew(own, started, settings, fewer)
            without = self._left_out_of(own, end)
            gained = gain(left_out, without)
            self._note_alone(term, gained)
            if not is_clear(*gained) and is_clear(*gain(without, none), among):
                found = _Alone(fewer.terms, own.parameters.from_unit(end.point))
                problem = own
                left_out = without
        return found

    def _ends_with(
        self,
        last: Problem,
        problem: Problem,
        theta: Array,
        step: Step,
        settings: RefinementSettings,
        enough: float,
    ) -> tuple[Problem, list[Refinement]]:
        """Return the problem of a joint alone with further terms, and its refinements
        from where independent output errors lead, if these are less than `enough`.

        One begins at theta of the last problem, (P,). A valve's curve also begins at
        the speeds that the logs show, and all else of the joint where the settings
        begin: without the curve, load and lags have stood for it. Which of them leads
        nearer differs from valve to valve, and shows only at the end.
        """
        nothing = problem.parameters.started(last.parameters.mapping(theta))
        own = alone(problem, step.joint, nothing)
        starts = {step: nothing}
        if _new_curves(problem, last):
            anew = np.where(own.parameters.free, problem.parameters.start, nothing)
            by_logs = by_speeds(problem, step.joint, anew)
            starts[step.changed(start=2)] = by_logs
        ends = list[Refinement]()
        for tried, start in starts.items():
            far = self._far_end(own, start, settings, tried)
            if far.negative_log < enough:
                near = own.parameters.from_unit(far.point)
                end = self._refined(make_likelihood(own), near, settings, tried)
                ends.append(end)
        return own, ends

    def _try_each_without(
        self, whole: Problem, terms: Sequence[str], settings: RefinementSettings
    ) -> None:
        """Try to drop terms, one after the other."""
        for term in terms:
            self._try_without(whole, term, settings)

    def _try_without(
        self, whole: Problem, term: str, settings: RefinementSettings
    ) -> None:
        """Drop a term that was kept below, unless this model foretells clearly better
        with it.

        A term may have stood for what only a richer model has.
        """
        if self._late:
            return
        step = self._step.changed(
            terms=tuple(one for one in self._step.terms if one != term)
        )
        own = whole.varied(whole.settings.of_estimate(step.estimate))
        values = self.problem.parameters.mapping(self.kept.theta)
        theta = own.parameters.started(values)
        result = self._refined(
            make_likelihood(own), theta, settings, step.changed(phase="on the way")
        )
        with_it = self._left_out_of(self.problem, self.refinements[self.kept.name])
        without = self._left_out_of(own, result)
        gained = gain(with_it, without)
        if not self._late and not is_clear(*gained):
            self._note_dropped(term, gained)
            self._keep(own, self._measured(own, result, step), step)

    def _note_alone(self, term: str, gained: tuple[float, float] | None) -> None:
        """Note what a term gained on its joint alone, unless all joints together have
        decided on it."""
        is_news = gained is not None or self.tried.get(term) is None
        if term not in self._dropped and is_news:
            self.tried[term] = gained

    def _note_each(
        self, terms: Sequence[str], gained: tuple[float, float] | None
    ) -> None:
        """Note of each term what all together gained on their joint alone."""
        for term in terms:
            self._note_alone(term, gained)

    def _note_dropped(self, term: str, gained: tuple[float, float]) -> None:
        """Note what a term gained of all joints together, which do not keep it."""
        self._dropped.add(term)
        self.tried[term] = gained

    def _is_at_end(self) -> bool:
        """Return whether there is no time left, or nothing but noise to explain."""
        return self._late or self.problem.leaves_noise(self.kept.theta)

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

    def _left_out_of(self, problem: Problem, end: Refinement) -> LeftOut:
        return predict_blocks(make_likelihood(problem), end)

    def _refined(
        self,
        likelihood: Likelihood,
        theta: Array,
        settings: RefinementSettings,
        step: Step,
        how: Callable[..., Refinement] = refine,
    ) -> Refinement:
        result = how(
            likelihood, theta, settings, self._watch.refining, self._checkpoints, step
        )
        self._late |= result.ending is Ending.TIME
        return result

    def _refined_anew(
        self,
        problem: Problem,
        theta: Array,
        settings: RefinementSettings,
        step: Step,
    ) -> Refinement:
        """Refine from where output errors lead from theta, (P,), if they were
        independent."""
        far = self._far_end(problem, theta, settings, step)
        begun = problem.parameters.from_unit(far.point)
        return self._refined(make_likelihood(problem), begun, settings, step)

    def _far_end(
        self,
        problem: Problem,
        theta: Array,
        settings: RefinementSettings,
        step: Step,
    ) -> Refinement:
        """Return where output errors lead from theta, (P,), if they were
        independent."""
        likelihood = make_likelihood(problem).of_independent_errors
        afar = step.changed(phase="from afar")
        return self._refined(likelihood, theta, settings, afar)

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


def _of_joint(problem: Problem, joint: int, theta: Array) -> Problem:
    """Return the problem of a joint alone at theta, (P,): as it is, if it is the only
    one that is compared."""
    if problem.settings.outputs == (joint,):
        return problem
    return alone(problem, joint, theta)


def _begun(problem: Problem, last: Problem, theta: Array) -> Array:
    """Return where another model begins, from theta, (P,), of the last one.

    A valve that has a curve now begins at the speeds that the logs show: from a power
    law, least squares seldom finds a valve that opens all at once.
    """
    begun = problem.parameters.started(last.parameters.mapping(theta))
    for joint in _new_curves(problem, last):
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


def _new_curves(problem: Problem, last: Problem) -> list[int]:
    """Return the joints, from 1, whose valves have a curve here and had none in the
    last model.

    None of a model whose joints have inertia: without that and the oil, the speeds are
    no better start.
    """
    if not problem.settings.rung.at_once:
        return []
    return [
        j
        for j in problem.settings.outputs
        if has_curve(problem, j) and not has_curve(last, j)
    ]
