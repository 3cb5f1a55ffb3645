"""Terms and starts of single joints, tried on each joint alone while the others follow
their logs: that takes seconds."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array
from hydroid.fitting.left_out import Gain, LeftOut, gain, is_clear, predict_blocks
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.fitting.refinement import Refinement, promised
from hydroid.fitting.refiner import Place, Refiner
from hydroid.fitting.starts import (
    LESS,
    by_speeds,
    likelier,
    new_curves,
    with_other_valve,
)
from hydroid.fitting.step import Start
from hydroid.fitting.tried import Tried
from hydroid.posterior.error_model import make_likelihood


def each_alone(refiner: Refiner, begun: Place, joints: Sequence[int]) -> Array:
    """Return what some joints, each alone, lead to from a place, (P,).

    A joint whose errors are large weighs little beside the others, and together with
    them least squares ends before it has moved.
    """
    theta = begun.theta
    for joint in joints:
        own = alone(begun.problem, joint, theta)
        step = begun.step.changed(joint=joint, phase="at first")
        end = refiner.on_the_way(own, theta, step)
        reached = own.parameters.from_unit(end.point)
        theta = np.where(begun.problem.parameters.free, reached, theta)
    return theta


def joints_anew(refiner: Refiner, kept: Place) -> Array:
    """Return a place's theta, (P,), with each joint that errs by more than noise from
    elsewhere, where that is much likelier.

    What slows a joint under load may be its valve or its lever, and how late it is a
    delay or a lag: least squares settles for one and does not leave it, whatever the
    model gets later. So a joint begins where the settings do, a valve with a curve at
    the speeds that the logs show, and once more with the other kind of valve.
    """
    problem = kept.problem
    theta = kept.theta
    for joint in lone_joints(problem):
        own = alone(problem, joint, theta)
        if own.leaves_noise(theta):
            continue
        begun = np.where(own.parameters.free, problem.parameters.start, theta)
        starts = (
            by_speeds(problem, joint, begun),
            with_other_valve(problem, joint, theta),
        )
        for number, start in enumerate(starts, Start.ANEW):
            if refiner.late:
                return kept.theta
            step = kept.step.changed(start=number, joint=joint)
            end = refiner.anew(own, start, step)
            reached = own.parameters.from_unit(end.point)
            theta = likelier(problem, theta, reached)
    return theta


class JointTrials:
    """Tries terms on each joint alone.

    Args:
        refiner: of the fit.
        terms: that can be fitted on each joint alone, by joint, numbered from 1; a term
            of each joint, as the oil, is among those of all.
        tried: takes what the terms gained.
        joints: that are tried.
        round_number: from 0: rounds of one fit may try the same terms, and must not
            share checkpoints.
    """

    def __init__(
        self,
        refiner: Refiner,
        terms: Mapping[int, Sequence[str]],
        tried: Tried,
        joints: Collection[int],
        round_number: int,
    ) -> None:
        self._refiner = refiner
        self._terms = terms
        self._tried = tried
        self._joints = joints
        self._start = Start.ROUND * round_number

    def found(self, kept: Place) -> Place:
        """Return the place with the terms that joints alone ask for, and where these
        lead.

        A term of each joint that one of them needs is given to all; those that have
        been fitted without it are fitted once more.
        """
        found, fitted_with = self._joint_by_joint(kept)
        new = {*found.step.terms} - {*kept.step.terms}
        if not new or self._refiner.late:
            return found
        behind = [
            joint
            for joint, terms in self._terms.items()
            if new.intersection(terms) - fitted_with.get(joint, set())
        ]
        # the checkpoints of what is begun alone are not those of a later trial
        start = Start.JOINTS_FIRST + self._start
        apart = replace(found, step=found.step.changed(start=start))
        return replace(found, theta=each_alone(self._refiner, apart, behind))

    def _joint_by_joint(self, kept: Place) -> tuple[Place, dict[int, set[str]]]:
        """Return where the terms of one joint after the other lead, and with which
        terms each joint has been fitted."""
        fitted_with = dict[int, set[str]]()
        now = kept
        for joint in self._joints:
            lacking = now.lacking(self._terms[joint])
            found = None
            if self._may_gain(now, joint, lacking):
                found = self._alone(now, joint, lacking)
            if self._refiner.late:
                break
            self._tried.alone(None, *lacking)
            if found is None:
                continue
            fitted_with[joint] = {*found.step.terms}
            if found.step.terms == now.step.terms:
                theta = likelier(now.problem, now.theta, found.theta)
                now = replace(now, theta=theta)
            else:
                step = now.step.changed(terms=found.step.terms)
                now = Place(step, self._refiner.problem_of(step), found.theta)
        return now, fitted_with

    def _may_gain(self, now: Place, joint: int, lacking: Sequence[str]) -> bool:
        """Return whether terms that a joint lacks may gain anything for it alone.

        Most joints of most machines lack no term, and a Jacobian tells.
        """
        if not lacking or self._refiner.late:
            return False
        if alone(now.problem, joint, now.theta).leaves_noise(now.theta):
            return False
        step = now.step.changed(terms=(*now.step.terms, *lacking))
        problem = self._refiner.problem_of(step)
        started = problem.parameters.started(now.values)
        new = np.array([name not in now.values for name in problem.settings.parameters])
        likelihood = make_likelihood(alone(problem, joint, started))
        return promised(likelihood.of_independent_errors, started, new) > LESS

    def _alone(self, now: Place, joint: int, new: Sequence[str]) -> Place | None:
        """Refine a joint alone, and with new terms, all together.

        What one term explains may show only beside another: what a wrong curve of a
        valve does is hidden while the joint does not ring. Those that it does as well
        without are dropped again. All begin where independent output errors lead: else
        what helped the one would count for the terms. Where these hardly fall with the
        terms, nothing is refined any further: None.
        """
        refiner = self._refiner
        step = now.step.changed(joint=joint, start=self._start)
        before = alone(now.problem, joint, now.theta)
        far = refiner.far_end(before, now.theta, step)
        begun = replace(now, step=step, theta=before.parameters.from_unit(far.point))
        enough = far.negative_log - LESS * before.measured.size
        own, ends = self._ends_with(begun, new, enough)
        if not ends or refiner.late:
            return None
        end = refiner.on_the_way(before, begun.theta, step)
        if refiner.late:
            return None
        as_it_is = Place(step, before, before.parameters.from_unit(end.point))
        without = predict_blocks(before, end)
        end = min(ends, key=lambda one: one.negative_log)
        left_out = predict_blocks(own.problem, end)
        gained = gain(left_out, without)
        self._tried.alone(gained, *new)
        if not self._is_clear(gained):
            return as_it_is
        found = replace(own, theta=own.problem.parameters.from_unit(end.point))
        if len(new) == 1:
            return found
        return self._fewer(found, new, without, left_out)

    def _fewer(
        self, found: Place, terms: Sequence[str], none: LeftOut, every: LeftOut
    ) -> Place:
        """Drop terms that the model of a joint alone predicts as well without, as long
        as the rest is still clearly better than none of them.

        `none` and `every` are its predictions of parts left out without any of them,
        and with all.
        """
        left_out = every
        for term in terms:
            rest = tuple(one for one in found.step.terms if one != term)
            step = found.step.changed(terms=rest)
            problem = self._refiner.problem_of(step)
            started = problem.parameters.started(found.values)
            own = alone(problem, step.joint, started)
            end = self._refiner.anew(own, started, step)
            if self._refiner.late:
                break
            without = predict_blocks(own, end)
            gained = gain(left_out, without)
            self._tried.alone(gained, term)
            if not is_clear(*gained) and self._is_clear(gain(without, none)):
                found = Place(step, own, own.parameters.from_unit(end.point))
                left_out = without
        return found

    def _ends_with(
        self, begun: Place, terms: Sequence[str], enough: float
    ) -> tuple[Place, list[Refinement]]:
        """Return where a joint alone begins with further terms, and its refinements
        from where independent output errors lead, if these are less than `enough`.

        A valve's curve also begins at the speeds that the logs show, and all else of
        the joint where the settings begin: without the curve, load and lags have stood
        for it. Which of them leads nearer differs from valve to valve, and shows only
        at the end.
        """
        step = begun.step.changed(terms=(*begun.step.terms, *terms))
        problem = self._refiner.problem_of(step)
        nothing = problem.parameters.started(begun.values)
        own = alone(problem, step.joint, nothing)
        starts = {step: nothing}
        if new_curves(problem, begun.problem):
            anew = np.where(own.parameters.free, problem.parameters.start, nothing)
            by_logs = step.changed(start=step.start + 2)
            starts[by_logs] = by_speeds(problem, step.joint, anew)
        ends = list[Refinement]()
        for tried, start in starts.items():
            far = self._refiner.far_end(own, start, tried)
            if far.negative_log < enough:
                near = own.parameters.from_unit(far.point)
                ends.append(self._refiner.on_the_way(own, near, tried))
        return Place(step, own, nothing), ends

    def _is_clear(self, gained: Gain) -> bool:
        """Return whether a gain is clear: of several joints, some seem better by
        chance."""
        return is_clear(*gained, among=len(self._terms))
