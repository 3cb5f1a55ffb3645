"""What `hydroid suggest` says: as JSON has it, as findings, and the command that frees a term."""

import math
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import yaml

from hydroid.advice.assumptions import assumption_findings, doubts
from hydroid.advice.design import ExperimentSimulator, forecast
from hydroid.advice.experiment import RandomExperiments
from hydroid.advice.growth import MIN_GAIN, Candidate, promising, score_terms
from hydroid.advice.left_out import refitted
from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.estimate import finite
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.posterior.noise import error_level
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file

MOST_TRIED = 6  # terms that are really freed, the most promising first

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
    tests, weight = score_terms(problem, known, progress), known.linear.prior_weight
    best = promising(tests)
    without = refitted(problem, known.theta, weight)
    rows: list[tuple[bool, float, Plain]] = []
    for i, one in enumerate(best):
        error = math.inf
        row = {
            "name": one.term.name,
            "unit": one.term.entries[one.term.name].unit,
            "held": finite(one.term.value),
            "score": one.score,
            "chance": one.chance,
            "gain_percent": 100 * one.gain,
        }
        if i < MOST_TRIED:
            progress(f"freeing {one.term.name}", i, min(MOST_TRIED, len(best)))
            more = one.term.added_to(problem)
            freed = refitted(more, one.term.theta(problem, known.theta, one.start), weight)
            value = more.parameters.mapping(freed.theta)[one.term.name]
            error = freed.left_out
            row |= {"freed": value, "left_out_deg": freed.by_joint}
            if error < (1 - MIN_GAIN) * without.left_out:
                entries = proposed(one, value)
                row |= {"parameters": entries, "command": freeing_command(problem, entries, run)}
        rows.append(("command" not in row, error, row))
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
    levers = (p.joints or () for p in settings.parameters.values() if p.quantity.startswith("lever"))
    stand_ins = {joint for joints in levers for joint in joints}  # for cylinders of unknown size
    for name, row in zip(names, np.eye(len(names)), strict=True):
        own = settings.parameters[name]
        if own.unit in MEASURABLE and stand_ins.isdisjoint(own.joints or ()):
            kind = "weigh" if own.quantity == "mass" else "state"
            yield kind, name, row[None] / STATED_SD[kind]
    level, time = max(
        (error_level(channel, noise), noise.correlation_time * problem.logs[channel.log].period)
        for channel, noise in zip(problem.channels, known.noise, strict=True)
        if channel.quantity == "angle"
    )
    # what the best of a few could measure; hydroid design then looks for one free of collisions
    noise = {"noise_deg": np.degrees(level), "noise_correlation_s": time}
    settings = settings.changed({"design": settings.design.changed(noise | {"clearance_m": None})})
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, now)
    gained = [t.gained for _ in range(6) if (t := simulator.trial(draws.draw())) is not None]
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
    left = {joint: (error or 0.0) / before[joint] for joint, error in freed.items() if before[joint]}
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
            numbers = {"what": action["parameter"], "before": before, "after": after, "sd": sd}
            link = settings.parameters[of].link if kind == "weigh" else None
            yield Finding(kind, "note", (link or of,), numbers)
