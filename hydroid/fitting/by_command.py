"""Joints whose speed follows their commands alone: which of them a fit lets do so."""

from collections.abc import Mapping
from dataclasses import replace

from hydroid.arrays import rms
from hydroid.fitting.baselines import fit_baselines
from hydroid.fitting.left_out import Gain, gain, is_clear, predict_blocks
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.fitting.refiner import Place, Refiner
from hydroid.fitting.starts import LESS, share_pump, valve_alone
from hydroid.fitting.step import Start
from hydroid.fitting.tried import Tried
from hydroid.posterior.error_model import make_likelihood
from hydroid.problem.problem import Problem
from hydroid.rungs import BY_COMMAND

NO_LOAD = 0.9
"""compensation from which the logs show no load"""
FAR_LESS = 1 / 3
"""part of a simple model's error: a joint that errs by less has more to lose than load
and pump"""


def with_joints_by_command(refiner: Refiner, kept: Place, tried: Tried) -> Place:
    """Return a place with the terms by which the speed of joints follows their commands
    alone, where that foretells parts left out better than load and pump.

    Each joint that errs by more than noise, and not by far less than simple models, is
    tried alone; `tried` takes what that gained. So is one whose load the logs do not
    show: it takes the term unless that foretells worse, for what is left of its load
    would show in other poses.
    """
    if not kept.problem.settings.rung.has(BY_COMMAND):
        return kept
    asked = _asked(refiner, kept, tried)
    now = kept
    for term, (joint, shows_load) in asked.items():
        found = _by_command(refiner, now, term, joint)
        if refiner.late:
            return kept
        if found is None:
            continue
        (rise, error), place = found
        tried.alone((rise, error), term)
        takes_it = not is_clear(-rise, error)
        if shows_load:
            takes_it = is_clear(rise, error, among=len(asked))
        if takes_it:
            step = now.step.changed(terms=place.step.terms)
            now = replace(place, step=step, problem=refiner.problem_of(step))
    return now


def _asked(
    refiner: Refiner, kept: Place, tried: Tried
) -> Mapping[str, tuple[int, bool]]:
    """Return the terms that are tried, each with its joint, and whether the logs show
    the load of that."""
    possible = kept.problem.settings.outputs
    if len(possible) > 1:
        possible = lone_joints(kept.problem)
    asked = dict[str, tuple[int, bool]]()
    for term, joint in refiner.whole.settings.by_command_terms.items():
        tried.alone(None, term)
        if joint not in possible:
            continue
        shows_load = _shows_load(kept, joint)
        if not shows_load or _may_be_simpler(kept, joint):
            asked[term] = joint, shows_load
    return asked


def _shows_load(kept: Place, joint: int) -> bool:
    """Return whether the logs show the load of a joint, or that of a shared pump.

    They do not where a fit has found that its valve makes good nearly all of the load,
    which the settings do not expect.
    """
    problem = kept.problem
    found, begun = (
        problem.bindings.candidates(theta[None]).joints["compensation"][0, joint - 1]
        for theta in (kept.theta, problem.parameters.start)
    )
    return share_pump(problem, kept.theta) or not found > NO_LOAD > begun


def _may_be_simpler(kept: Place, joint: int) -> bool:
    """Return whether a joint errs by more than noise, and not by far less than models
    that know no load."""
    own = _of_joint(kept, joint)
    if own.leaves_noise(kept.theta):
        return False
    (error,) = own.rms(own.output_errors(kept.theta[None]))
    ends = own.settings.arm.stops(joint)
    simple = fit_baselines(own.logs, joint, ends).values()
    return error > FAR_LESS * min(rms(model.errors(own.logs)) for model in simple)


def _by_command(
    refiner: Refiner, now: Place, term: str, joint: int
) -> tuple[Gain, Place] | None:
    """Refine a joint alone as it is, and by its command; return what that gains, and
    where it leads.

    None: it errs so much more that it cannot predict better, or time is up.
    """
    step = now.step.changed(terms=(*now.step.terms, term), joint=joint)
    problem = refiner.problem_of(step)
    starts = valve_alone(problem, joint, now.problem, now.theta)
    before = _of_joint(now, joint)
    after = _of_joint(Place(step, problem, starts[0]), joint)
    as_it_is = refiner.on_the_way(
        before, now.theta, now.step.changed(joint=joint, start=Start.AS_IT_IS)
    )
    ends = [
        refiner.far_end(after, start, step.changed(start=number))
        for number, start in enumerate(starts, 1)
    ]
    far = min(ends, key=lambda one: one.negative_log)
    # it has fewer parameters, but where it errs much more it predicts worse
    reached = before.parameters.from_unit(as_it_is.point)
    independent = make_likelihood(before).of_independent_errors
    enough = independent.negative_log_at(reached) + LESS * before.measured.size
    if refiner.late or far.negative_log > enough:
        return None
    end = refiner.on_the_way(after, after.parameters.from_unit(far.point), step)
    if refiner.late:
        return None
    gained = gain(predict_blocks(after, end), predict_blocks(before, as_it_is))
    return gained, Place(step, after, after.parameters.from_unit(end.point))


def _of_joint(place: Place, joint: int) -> Problem:
    """Return the problem of a joint alone at a place: as it is, if it is the only one
    that is compared."""
    if place.problem.settings.outputs == (joint,):
        return place.problem
    return alone(place.problem, joint, place.theta)
