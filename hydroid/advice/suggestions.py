"""What `hydroid suggest` says: as JSON has it, as findings, and the command that frees
a term."""

import math
import shlex
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import yaml

from hydroid.advice.assumptions import assumption_findings, doubts
from hydroid.advice.design import ExperimentSimulator, Trial, forecast
from hydroid.advice.experiment import RandomExperiments
from hydroid.advice.growth import Candidate, promising, score_terms
from hydroid.advice.terms import Term, joints_of
from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.estimate import finite
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.left_out import (
    LeftOut,
    blocks,
    compared_fit,
    gain,
    is_better,
    refit,
)
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.fitting.starts import likelier, share_pump
from hydroid.fitting.summary import angle_errors
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file
from hydroid.settings.naming import named
from hydroid.settings.problem import ParameterSettings

MOST_TRIED = 6  # terms that are really freed, the most promising first
STATED_SD = {"weigh": 0.02, "state": 0.05}
"""relative standard deviation of a mass that was weighed,
and of a value from a data sheet (ours)"""
MEASURABLE = "kg", "m", "mm", "mm²", "cm³", "bar", "L/min", "A", "V"
"""units of what scales, rulers, gauges and data sheets say"""
FEWEST_TIMES = 1.5  # factor by which an action must improve a parameter to be listed
MOST_ACTIONS = 5  # actions that are listed
Content = Mapping[str, Any]


def advice(
    problem: Problem, uncertainty: Uncertainty, run: str, progress: Progress
) -> tuple[Content, tuple[Finding, ...]]:
    """Return the suggestions about an estimate with its uncertainty, and what is to be
    said, the first first.

    The suggestions are as JSON has them (docs/json.md); `run` is the estimate's folder
    in commands.
    """
    tests = score_terms(problem, uncertainty, progress)
    candidates = promising(tests)
    # the model as it is: what a freed term is compared with
    without = refit(problem, uncertainty.theta)
    ranked = list[tuple[bool, float, Plain]]()
    most = min(MOST_TRIED, len(candidates))
    for i, candidate in enumerate(candidates):
        row: Plain = {
            "name": candidate.term.name,
            "unit": candidate.term.entries[candidate.term.name].unit,
            "held": finite(candidate.term.value),
            "score": candidate.score,
            "chance": candidate.chance,
            "gain": candidate.gain,
        }
        rise = -math.inf
        if i < MOST_TRIED:
            progress(f"freeing {candidate.term.name}", i, most)
            tried, rise = _tried(candidate, without, run, most)
            row |= tried
        ranked.append(("command" not in row, -rise, row))
    # those to be freed first, and of these the one that lowers the error most
    ranked.sort(key=lambda entry: entry[:2])
    doubted = doubts(problem.settings, problem.logs)
    content: Plain = {
        "left_out_deg": without.by_joint,
        "tested": len(tests),
        "terms": [row for _, _, row in ranked],
        "actions": next_actions(problem, uncertainty),
        "assumptions": [
            {"kind": "sign", "joint": joint, "evidence": evidence}
            for joint, evidence in doubted.items()
        ],
    }
    findings = (
        *assumption_findings(problem.settings, problem.logs, doubted),
        *missing_findings(content),
        *action_findings(content, problem.settings),
    )
    return content, findings


def _tried(
    candidate: Candidate, without: LeftOut, run: str, among: int
) -> tuple[Plain, float]:
    """Free a term and return what that does on parts left out, and its gain there.

    `without` is what the model without it does; where the term is better, the command
    that frees it belongs to the result. `among` is the number of terms that are freed.
    """
    problem = without.problem
    term = candidate.term
    larger = term.added_to(problem)
    begun = term.theta(problem, without.theta, candidate.start)
    freed = refit(larger, _begun_anew(larger, term, begun))
    value = float(larger.parameters.mapping(freed.theta)[term.name])
    rise, sd = gain(freed, without)
    row: Plain = {
        "freed": value,
        "left_out_deg": freed.by_joint,
        "left_out_gain": finite(rise),
        "left_out_gain_sd": finite(sd),
    }
    if is_better(freed, without, among):
        entries = proposed(candidate, value)
        row["parameters"] = entries
        row["command"] = freeing_command(problem, entries, run)
        row["improvement_deg"] = improvement(freed, without)
    return row, rise


def _begun_anew(problem: Problem, term: Term, theta: Array) -> Array:
    """Return theta, (P,), with the joint of a term as it is alone from where the
    settings begin, where that is much likelier.

    What the other parameters have learnt without the term may stand in for it, and
    least squares would leave the term near nothing.
    """
    joints = problem.settings.parameters[term.name].joints or ()
    alone_too = {*joints} & {*lone_joints(problem)}
    if len(joints) != 1 or not alone_too or share_pump(problem, theta):
        return theta
    own = alone(problem, joints[0], theta)
    start = np.where(own.parameters.free, problem.parameters.start, theta)
    place = problem.parameters.names.index(term.name)
    start[place] = theta[place]
    end = compared_fit(own, start)
    return likelier(problem, theta, own.parameters.from_unit(end.point))


def improvement(after: LeftOut, before: LeftOut) -> dict[str, tuple[float, float]]:
    """Return by how much the rms error on a part left out falls, with a standard error,
    by joint [deg].

    The error is that of the change of an angle over the part. The standard error is by
    leaving out one part after the other once more (a jackknife).
    """
    settings = after.problem.settings
    improvements = dict[str, tuple[float, float]]()
    for joint in settings.outputs:
        of_both = [squared_changes(left_out, joint) for left_out in (before, after)]
        squares = np.array(of_both)
        spans = squares.shape[1]
        sums = squares.sum(axis=1)
        rms_before, rms_after = np.sqrt(sums / spans)
        # a jackknife: each part is left out of the sums in turn
        remaining = sums[:, None] - squares
        without_one = np.sqrt(remaining / max(spans - 1, 1))
        falls = without_one[0] - without_one[1]
        sd = np.sqrt((len(falls) - 1) * np.var(falls))
        fall = float(np.degrees(rms_before - rms_after))
        name = settings.arm.name_of(joint)
        improvements[name] = (fall, float(np.degrees(sd)))
    return improvements


def squared_changes(left_out: LeftOut, joint: int) -> Array:
    """Return the squared error of a joint's change over each part left out [rad²]."""
    problem = left_out.problem
    number = blocks(problem)
    squares = list[Array]()
    for channel in problem.channels:
        if channel.quantity != "angle" or channel.joint != joint:
            continue
        error = left_out.errors[channel.rows] / channel.weight
        ends = np.flatnonzero(np.diff(number[channel.rows]))
        firsts = np.append(0, ends + 1)
        lasts = np.append(ends, error.size - 1)
        squares.append((error[lasts] - error[firsts]) ** 2)
    return np.concatenate(squares)


def next_actions(problem: Problem, uncertainty: Uncertainty) -> list[Plain]:
    """Return the actions that would help most, the best first, as JSON has them
    (docs/json.md)."""
    now = forecast(uncertainty.posterior)
    wide = now.deviations
    names = np.array(problem.parameters.names)[now.box.varied]
    useful = list[tuple[float, Plain]]()
    for kind, subject, rows in _forecasts(problem, uncertainty, now):
        narrow = now.add(rows).deviations
        # the one that improves most, but for the one that is stated
        factors = np.where(names == subject, 0.0, wide / narrow)
        best = np.argmax(factors)
        if wide[best] <= FEWEST_TIMES * narrow[best]:
            continue
        action = {
            "action": kind,
            "of": subject,
            "parameter": str(names[best]),
            "before_percent": 100 * wide[best],
            "after_percent": 100 * narrow[best],
        }
        # by which all deviations shrink on geometric average
        shrinking = float(np.mean(np.log(wide / narrow)))
        useful.append((shrinking, action))
    useful.sort(key=lambda pair: -pair[0])
    return [action for _, action in useful[:MOST_ACTIONS]]


def _forecasts(
    problem: Problem, uncertainty: Uncertainty, now: Posterior
) -> Iterator[tuple[str, str, Array]]:
    """Yield actions, their subjects, and rows of the information that each adds, shape
    (k, p).

    A weighed link, a value of a data sheet, and the best of six random experiments for
    the designed one, with the noise of the fit's worst angle.
    """
    settings = problem.settings
    names = problem.parameters.named(now.box.varied)
    for name, row in zip(names, np.eye(len(names)), strict=True):
        if _can_be_stated(settings, settings.parameters[name]):
            kind = "weigh" if settings.parameters[name].quantity == "mass" else "state"
            yield kind, name, row[None] / STATED_SD[kind]
    settings = _with_noise_of(settings, uncertainty)
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        # no pose that an experiment may start from: hydroid design says so
        return
    simulator = ExperimentSimulator(settings, now)
    trials = [simulator.trial(draws.random()) for _ in range(6)]
    gained = [trial.gained for trial in trials if isinstance(trial, Trial)]
    if gained:
        best = max(gained, key=partial(_log_root, now))
        yield "experiment", f"{settings.design.duration_s:g}", best


def _log_root(now: Posterior, rows: Array) -> float:
    """Return half the logarithm of the determinant of the information with more
    rows."""
    root = now.add(rows).root
    return float(np.sum(np.log(np.diag(root))))


def _can_be_stated(settings: FitSettings, parameter: ParameterSettings) -> bool:
    """Return whether scales, a gauge or a data sheet can tell a parameter."""
    if parameter.unit not in MEASURABLE or parameter.per is not None:
        return False
    # what stands in for a cylinder of unknown size has no sizes that anybody can
    # measure
    joints = settings.arm.joints
    return not any(
        joints[joint - 1].may_stand_in for joint in joints_of(settings, parameter)
    )


def _with_noise_of(settings: FitSettings, uncertainty: Uncertainty) -> FitSettings:
    """Return the settings of an experiment with the noise and drift of a fit's worst
    angle.

    Collisions are not checked: this is what the best of a few could measure, and
    `hydroid design` then looks for one free of collisions.
    """
    errors = uncertainty.errors
    noise = [
        errors.numbers[i, 0]
        for i, signal in enumerate(errors.signals)
        if signal.quantity == "angle"
    ]
    drift = [error.after_10_s_deg for error in angle_errors(uncertainty).values()]
    changes = {
        "noise_deg": np.degrees(np.sqrt(max(noise))),
        "drift_deg": max(drift),
        "clearance_m": None,
    }
    return settings.changed({"design": settings.design.changed(changes)})


def proposed(candidate: Candidate, value: float) -> dict[str, Plain]:
    """Return the entries of `parameters` that free a term, by name.

    Its bounds are a fifth and five times the value that was found, with the present
    value inside. It starts at what was found: least squares seldom gets there from
    nothing.
    """
    term = candidate.term
    low, high = term.span
    held = value if math.isinf(term.value) else term.value
    # a value may be below 0
    around = (value / 5.0, 5.0 * value, held)
    least = min(around) if low else low
    most = max(around)
    # two digits are enough for a reader
    least = float(f"{max(least, low):.2g}")
    most = float(f"{min(most, high):.2g}")
    entries = {
        name: parameter.model_dump(mode="json", exclude_defaults=True)
        for name, parameter in term.entries.items()
    }
    entries[term.name]["bounds"] = [least, most]
    entries[term.name]["start"] = float(f"{np.clip(value, least, most):.3g}")
    return entries


def freeing_command(problem: Problem, entries: Mapping[str, Any], run: str) -> str:
    """Return the command that fits the same logs again from a run's estimate, with a
    term freed."""
    words = [f"hydroid fit-{problem.settings.stage}"]
    # the parts of a log with gaps are one file
    files = dict.fromkeys(str(log_file(log.source)) for log in problem.logs)
    words += [shlex.quote(file) for file in files]
    words += [
        "--config",
        shlex.quote(f"{run}/config.yaml"),
        "--start",
        shlex.quote(run),
    ]
    for name, entry in entries.items():
        line = yaml.safe_dump(
            entry, default_flow_style=True, sort_keys=False, width=math.inf
        )
        words += ["--set", shlex.quote(f"parameters.{name}={line.strip()}")]
    *_, new = entries
    words += ["--out", shlex.quote(f"{run}-{new}")]
    return " ".join(words)


def missing_findings(content: Content) -> Iterator[Finding]:
    """Yield what the model lacks: the term to free, with its command."""
    free = [row for row in content["terms"] if "command" in row]
    if not free:
        yield Finding("nothing missing", "note", (), {"count": str(content["tested"])})
        return
    best = free[0]
    before = content["left_out_deg"]
    # the part of the error that remains, by joint
    left = dict[str, float]()
    for joint, error in best["left_out_deg"].items():
        if before[joint]:
            # None: it diverged
            left[joint] = math.inf if error is None else error / before[joint]
    joint = min(left, key=left.__getitem__)
    numbers = {"part": 100 * (1 - left[joint]), "command": best["command"]}
    yield Finding("term missing", "warning", (best["name"], joint), numbers)
    others = tuple(row["name"] for row in free[1:])
    if others:
        yield Finding("more terms missing", "note", others)


def action_findings(content: Content, settings: FitSettings) -> Iterator[Finding]:
    """Yield what each action would bring, the best first;
    one that changes nothing visible is left out."""
    for action in content["actions"]:
        kind = action["action"]
        subject = str(action["of"])
        before = f"{action['before_percent']:.2g}"
        after = f"{action['after_percent']:.2g}"
        if before == after:
            continue
        numbers = {
            "what": named(settings, action["parameter"]),
            "before": before,
            "after": after,
            "sd": 100 * STATED_SD.get(kind, 0.0),
        }
        link = None
        if kind == "weigh":
            link = settings.parameters[subject].link
        yield Finding(kind, "note", (link or named(settings, subject),), numbers)
