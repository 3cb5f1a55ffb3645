"""What `hydroid suggest` says: as JSON has it, as findings, and the command that frees a term."""

import math
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import yaml

from hydroid.advice.assumptions import assumption_findings, doubts
from hydroid.advice.design import ExperimentSimulator, Trial, forecast
from hydroid.advice.experiment import RandomExperiments
from hydroid.advice.growth import Candidate, promising, score_terms
from hydroid.advice.terms import joints_of
from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.estimate import finite
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.left_out import LeftOut, gain, is_better, parts, predict_parts
from hydroid.fitting.refinement import Refinement, refine_from_afar
from hydroid.fitting.step import Step
from hydroid.fitting.summary import angle_errors
from hydroid.posterior.error_model import Likelihood
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file
from hydroid.settings.naming import named
from hydroid.settings.search import RefinementSettings

MOST_TRIED = 6  # terms that are really freed, the most promising first
AHEAD = 10.0
"""time over which a predicted change of an angle is compared [s]"""
COMPARED = RefinementSettings(iterations=60, gain_tolerance=1e-4)
"""of the refinements without a part of the logs"""

STATED_SD = {"weigh": 0.02, "state": 0.05}
"""relative standard deviation of a mass that was weighed, and of a value from a data sheet (ours)"""
MEASURABLE = "kg", "m", "mm", "mm²", "cm³", "bar", "L/min", "A", "V"
"""units of what scales, rulers, gauges and data sheets say"""
FEWEST_TIMES = 1.5  # factor by which an action must improve a parameter to be listed
MOST_ACTIONS = 5  # actions that are listed
Content = Mapping[str, Any]


def advice(
    problem: Problem, known: Uncertainty, run: str, progress: Progress
) -> tuple[Content, tuple[Finding, ...]]:
    """Return the suggestions about an estimate with its uncertainty, and what is to be said, the first first.

    The suggestions are as JSON has them (docs/json.md); `run` is the estimate's folder in commands.
    """
    tests = score_terms(problem, known, progress)
    best = promising(tests)
    starts = np.tile(known.theta, (len(np.unique(parts(problem))), 1))
    without = predict_parts(problem, starts, refitted)
    rows: list[tuple[bool, float, Plain]] = []
    for i, one in enumerate(best):
        row = {
            "name": one.term.name,
            "unit": one.term.entries[one.term.name].unit,
            "held": finite(one.term.value),
            "score": one.score,
            "chance": one.chance,
            "gain": one.gain,
        }
        rise = -math.inf
        if i < MOST_TRIED:
            progress(f"freeing {one.term.name}", i, min(MOST_TRIED, len(best)))
            more = one.term.added_to(problem)
            at = [one.term.theta(problem, theta, one.start) for theta in without.thetas]
            freed = predict_parts(more, np.array(at), refitted)
            value = float(np.mean([more.parameters.mapping(theta)[one.term.name] for theta in freed.thetas]))
            rise, error = gain(freed, without)
            row |= {"freed": value, "left_out_deg": freed.by_joint}
            row |= {"left_out_gain": finite(rise), "left_out_gain_sd": finite(error)}
            if is_better(freed, without):
                entries = proposed(one, value)
                row |= {"parameters": entries, "command": freeing_command(problem, entries, run)}
                row |= {"improvement_deg": improvement(freed, without)}
        rows.append(("command" not in row, -rise, row))
    doubted = doubts(problem.settings, problem.logs)
    content = {
        "left_out_deg": without.by_joint,
        "tested": len(tests),
        "terms": [row for *_, row in sorted(rows, key=lambda one: one[:2])],
        "actions": next_actions(problem, known),
        "assumptions": [{"kind": "sign", "joint": j, "evidence": e} for j, e in doubted.items()],
    }
    said = *assumption_findings(problem.settings, problem.logs, doubted), *missing_findings(content)
    return content, (*said, *action_findings(content, problem.settings))


def refitted(likelihood: Likelihood, theta: Array, without: int) -> Refinement:
    """Refine an estimate for a comparison on parts left out; nothing is shown or stored of it."""
    return refine_from_afar(
        likelihood, theta, COMPARED, lambda *_: False, {}, Step("compared", without=without)
    )


def improvement(after: LeftOut, before: LeftOut) -> dict[str, tuple[float, float]]:
    """Return by how much the rms error on a part left out falls, with a standard error, by joint [deg].

    The error is that of the change of an angle over AHEAD. The standard error is by leaving out one block of
    time after the other (a jackknife).
    """
    problem = after.problem
    names = problem.settings.arm.joint_names
    result = dict[str, tuple[float, float]]()
    for joint in problem.settings.outputs:
        squares = np.array([squares_ahead(one, joint) for one in (before, after)])
        sums = squares.sum(axis=1)
        fall = np.subtract(*np.sqrt(sums / squares.shape[1]))
        others = np.sqrt((sums[:, None] - squares) / max(squares.shape[1] - 1, 1))
        spread = others[0] - others[1]
        sd = np.sqrt((len(spread) - 1) * np.var(spread))
        result[names[joint - 1]] = float(np.degrees(fall)), float(np.degrees(sd))
    return result


def squares_ahead(one: LeftOut, joint: int) -> Array:
    """Squares of the errors of a joint's change over AHEAD, one span after the other in all logs [rad²]."""
    spans = list[Array]()
    for channel in one.problem.channels:
        if channel.quantity == "angle" and channel.joint == joint:
            step = max(round(AHEAD / one.problem.logs[channel.log].period), 1)
            error = one.errors[channel.rows] / channel.weight
            step = min(step, len(error) - 1)
            spans.append(np.diff(error[::step]) ** 2)
    return np.concatenate(spans)


def next_actions(problem: Problem, known: Uncertainty) -> list[Plain]:
    """Return the actions that would help most, the best first, as JSON has them (docs/json.md)."""
    now = forecast(known.posterior)
    wide, names = now.deviations, np.array(problem.parameters.names)[now.box.varied]
    useful: list[tuple[float, Plain]] = []
    for kind, subject, rows in _forecasts(problem, known, now):
        narrow = now.add(rows).deviations
        # the one that improves most, but for the one that is stated
        best = np.argmax(np.where(names == subject, 0.0, wide / narrow))
        if wide[best] > FEWEST_TIMES * narrow[best]:
            action = {"action": kind, "of": subject, "parameter": str(names[best])}
            action |= {"before_percent": 100 * wide[best], "after_percent": 100 * narrow[best]}
            # by which all deviations shrink on geometric average
            useful.append((-float(np.mean(np.log(wide / narrow))), action))
    return [action for _, action in sorted(useful, key=lambda one: one[0])[:MOST_ACTIONS]]


def _forecasts(problem: Problem, known: Uncertainty, now: Posterior) -> Iterator[tuple[str, str, Array]]:
    """Yield actions, their subjects, and rows of the information that each adds, shape (k, p).

    A weighed link, a value of a data sheet, and the best of six random experiments for the designed one, with
    the noise of the fit's worst angle.
    """
    settings, names = problem.settings, problem.parameters.named(now.box.varied)
    for name, row in zip(names, np.eye(len(names)), strict=True):
        own = settings.parameters[name]
        # what stands in for a cylinder of unknown size has no sizes that anybody can measure
        invented = any(settings.arm.joints[joint - 1].may_stand_in for joint in joints_of(settings, own))
        if own.unit in MEASURABLE and own.per is None and not invented:
            kind = "weigh" if own.quantity == "mass" else "state"
            yield kind, name, row[None] / STATED_SD[kind]
    errors = known.errors
    sensor = [errors.numbers[i, 0] for i, one in enumerate(errors.signals) if one.quantity == "angle"]
    drift = [one.after_10_s_deg for one in angle_errors(known).values()]
    # what the best of a few could measure; hydroid design then looks for one free of collisions
    noise = {"noise_deg": np.degrees(np.sqrt(max(sensor))), "drift_deg": max(drift), "clearance_m": None}
    settings = settings.changed({"design": settings.design.changed(noise)})
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, now)
    gained = [t.gained for _ in range(6) if isinstance(t := simulator.trial(draws.draw()), Trial)]
    if gained:
        best = max(gained, key=lambda rows: np.sum(np.log(np.diag(now.add(rows).root))))
        yield "experiment", f"{settings.design.duration_s:g}", best


def proposed(one: Candidate, value: float) -> dict[str, Plain]:
    """Return the entries of `parameters` that free a term, by name.

    Its bounds are a fifth and five times the value that was found, with the present value inside. Stage 2
    asks for a start of every mechanical parameter that no run of stage 1 gives.
    """
    (low, high), term = one.term.span, one.term
    held = value if math.isinf(term.value) else term.value
    least = max(min(value / 5.0, held) if low else low, low)
    bounds = [float(f"{end:.2g}") for end in (least, min(max(5.0 * value, held), high))]
    entries = {n: p.model_dump(mode="json", exclude_defaults=True) for n, p in term.entries.items()}
    entries[term.name]["bounds"] = bounds
    if term.entries[term.name].quantity in MECHANICAL:
        entries[term.name]["start"] = min(max(held, bounds[0]), bounds[1])
    return entries


def freeing_command(problem: Problem, entries: Mapping[str, Any], run: str) -> str:
    """Return the command that fits the same logs again from a run's estimate, with a term freed."""
    changes = ""
    for name, entry in entries.items():
        line = yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=math.inf).strip()
        changes += f"--set {shlex.quote(f'parameters.{name}={line}')} "
    given = shlex.join(dict.fromkeys(str(log_file(log.source)) for log in problem.logs))
    config, own, out = (shlex.quote(path) for path in (f"{run}/config.yaml", run, f"{run}-{[*entries][-1]}"))
    return (
        f"hydroid fit-{problem.settings.stage} {given} --config {config} --start {own} {changes}--out {out}"
    )


def missing_findings(content: Content) -> Iterator[Finding]:
    """Yield what the model lacks: the term to free, with its command."""
    free = [row for row in content["terms"] if "command" in row]
    if not free:
        yield Finding("nothing missing", "note", (), {"count": str(content["tested"])})
        return
    freed, before = free[0]["left_out_deg"], content["left_out_deg"]
    left = {
        joint: math.inf if error is None else error / before[joint]  # None: it diverged
        for joint, error in freed.items()
        if before[joint]
    }
    joint = min(left, key=lambda one: left[one])
    numbers = {"part": 100 * (1 - left[joint]), "command": free[0]["command"]}
    yield Finding("term missing", "warning", (free[0]["name"], joint), numbers)
    if others := tuple(row["name"] for row in free[1:]):
        yield Finding("more terms missing", "note", others)


def action_findings(content: Content, settings: FitSettings) -> Iterator[Finding]:
    """Yield what each action would bring, the best first; one that changes nothing visible is left out."""
    for action in content["actions"]:
        kind, of = action["action"], str(action["of"])
        before, after = (f"{action[f'{when}_percent']:.2g}" for when in ("before", "after"))
        if before != after:
            sd = 100 * STATED_SD.get(kind, 0.0)
            what = named(settings, action["parameter"])
            numbers = {"what": what, "before": before, "after": after, "sd": sd}
            link = settings.parameters[of].link if kind == "weigh" else None
            yield Finding(kind, "note", (link or named(settings, of),), numbers)
