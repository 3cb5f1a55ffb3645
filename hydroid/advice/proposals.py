"""What suggestions propose: findings, the command that frees a term, and all as JSON has it."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydroid.advice.actions import STATED_SD, WEIGHED_SD
from hydroid.advice.missing import TermTest, Verdict
from hydroid.advice.residuals import LONG_S, Binned, Regressor, ResidualCheck
from hydroid.advice.suggest import Suggestions
from hydroid.estimate import finite
from hydroid.findings import Finding
from hydroid.problem.problem import Problem
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.words import plain

UNITS = {Regressor.ANGLE: "deg", Regressor.VELOCITY: "deg/s", Regressor.COMMAND: "%"}
"""in which a regressor is shown"""
_AROUND = 5.0
"""proposed bounds reach from the proposed value divided by this to the value times this"""
_PERCENT = {"weigh": 100 * WEIGHED_SD, "state": 100 * STATED_SD}

_MOST_RESIDUALS = 8
"""residuals that are kept with what they depend on"""

Content = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Advice:
    """Suggestions as JSON has them (docs/json.md), and the residuals with the largest errors."""

    content: Content
    residuals: tuple[ResidualCheck, ...]


def advice(problem: Problem, result: Suggestions, run: str = "RUN") -> Advice:
    """Return suggestions as a run stores them; `run` is its folder in commands."""
    worst = sorted(result.residuals, key=lambda check: -check.rms)[:_MOST_RESIDUALS]
    return Advice(_content(problem, result, run), tuple(worst))


def _content(problem: Problem, result: Suggestions, run: str) -> dict[str, Any]:
    given = " ".join(shlex.quote(log.source) for log in problem.logs)
    missing = [
        {
            "name": test.term.name,
            "verdict": test.verdict.value,
            "unit": test.term.settings.unit,
            "held": finite(test.term.value),
            "freed": finite(test.value),
            "rms_deg": math.degrees(test.rms),
            "score": test.statistic,
            "chance": test.chance,
            "parameter": _proposed(test) if test.verdict is Verdict.FREE else None,
            "command": freeing_command(problem, test, run) if test.verdict is Verdict.FREE else None,
        }
        for test in result.missing.tests
    ]
    residuals = [
        {
            "log": check.log,
            "joint": check.joint,
            "rms_deg": math.degrees(check.rms),
            "correlation_s": check.correlation_s,
            "at_stop_s": _stopped(check),
            "depends_on": [w.value for w, b in check.binned.items() if b.clearest(check.rms) is not None],
        }
        for check in result.residuals
    ]
    actions = [
        {
            "action": action.kind.value,
            "of": action.subject,
            "known_before": action.known[0],
            "known_after": action.known[1],
            "total": action.total,
            "parameter": action.parameter,
            "before_percent": 100 * action.deviations[0],
            "after_percent": 100 * action.deviations[1],
            "quantity": action.quantity or None,
            "quantity_before_percent": 100 * action.quantity_deviations[0] if action.quantity else None,
            "quantity_after_percent": 100 * action.quantity_deviations[1] if action.quantity else None,
        }
        for action in result.actions
    ]
    return {
        "rms_deg": math.degrees(result.missing.rms),
        "thorough": result.thorough,
        "command": f"hydroid suggest {given} --fit {shlex.quote(run)}",
        "missing": missing,
        "residuals": residuals,
        "actions": actions,
    }


def missing_findings(content: Content) -> Iterator[Finding]:
    """Yield what the model lacks: the term to free, with its command."""
    free = [test for test in content["missing"] if test["verdict"] == Verdict.FREE.value]
    numbers = {"rms": content["rms_deg"], "count": str(len(content["missing"]))}
    if not free:
        yield Finding("nothing missing", "note", (), numbers)
    elif not content["thorough"]:
        names = tuple(test["name"] for test in free)
        yield Finding("terms may be missing", "note", names, numbers | {"command": content["command"]})
    else:
        first, *others = free
        freed = {"freed": first["rms_deg"], "command": first["command"]}
        yield Finding("term missing", "warning", (first["name"],), numbers | freed)
        if others:
            yield Finding("more terms missing", "note", tuple(test["name"] for test in others))


def action_findings(content: Content, settings: FitSettings) -> Iterator[Finding]:
    """Yield what each action would bring, the best first; one that changes nothing visible is left out."""
    for action in content["actions"]:
        kind, of = action["action"], str(action["of"])
        falls = [
            (what, f"{before:.2g}", f"{after:.2g}")
            for what, before, after in (
                (action["parameter"], action["before_percent"], action["after_percent"]),
                (action["quantity"], action["quantity_before_percent"], action["quantity_after_percent"]),
            )
            if what and f"{before:.2g}" != f"{after:.2g}"
        ]
        if falls:
            what, before, after = falls[0]
            numbers = {"what": what, "before": before, "after": after, "sd": _PERCENT.get(kind, 0.0)}
            link = settings.parameters[of].link if kind == "weigh" else None
            yield Finding(kind, "note", (link or of,), numbers)


def residual_findings(checks: Sequence[ResidualCheck], places: Sequence[str]) -> Iterator[Finding]:
    """Yield what each residual shows; `places` names joint and log of each."""
    for check, place in zip(checks, places, strict=True):
        for what, binned in check.binned.items():
            if (clear := binned.clearest(check.rms)) is not None:
                yield _dependence(place, what, binned, clear)
        if check.correlation_s > LONG_S:
            yield Finding("residual correlated", "note", (place,), {"seconds": check.correlation_s})
        if check.at_stop.any():
            error = float(np.sqrt(np.mean(check.residual[check.at_stop] ** 2)))
            numbers = {"seconds": _stopped(check), "rms": math.degrees(error)}
            yield Finding("residual at stop", "note", (place,), numbers)


def freeing_command(problem: Problem, test: TermTest, run: str = "RUN") -> str:
    """Return the command that fits the same logs again from a run's estimate, with a term freed."""
    name, _, parameter = setting_line(test).partition(": ")
    given = " ".join(shlex.quote(log.source) for log in problem.logs)
    config, own, out = (shlex.quote(path) for path in (f"{run}/config.yaml", run, f"{run}-{name}"))
    return (
        f"hydroid fit-{problem.settings.stage} {given} --config {config} --start {own} "
        f"--set {shlex.quote(f'parameters.{name}={parameter}')} --out {out}"
    )


def setting_line(test: TermTest) -> str:
    """Return the parameter that frees a term, as a line of YAML without braces around it.

    Stage 2 asks for a start of every mechanical parameter that no run of stage 1 gives.
    """
    p, (low, high) = test.term.settings, proposed_bounds(test)
    start = "".join(f", {key}: {plain(value)}" for key, value in _start(test).items())
    where = f"link: {p.link}" if p.link else f"joints: [{', '.join(map(str, p.joints or ()))}]"
    where = "" if p.link is None and p.joints is None else f"{where}, "
    return (
        f"{test.term.name}: {{quantity: {p.quantity}, {where}bounds: [{plain(low)}, {plain(high)}]{start}}}"
    )


def proposed_bounds(test: TermTest) -> tuple[float, float]:
    """Return bounds around the value that the test found, with the present value inside."""
    low, high = test.term.span
    held = test.value if math.isinf(test.term.value) else test.term.value
    least = 0.0 if low == 0 else min(test.value / _AROUND, held)
    ends = max(least, low), min(max(_AROUND * test.value, held), high)
    return float(f"{ends[0]:.2g}"), float(f"{ends[1]:.2g}")


def _proposed(test: TermTest) -> dict[str, Any]:
    """The entry of `parameters` that frees a term."""
    settings = test.term.settings.model_dump(mode="json", exclude_defaults=True)
    return settings | {"bounds": proposed_bounds(test)} | _start(test)


def _start(test: TermTest) -> dict[str, float]:
    """The start value of a mechanical parameter, within the proposed bounds."""
    if test.term.settings.quantity not in MECHANICAL:
        return {}
    low, high = proposed_bounds(test)
    return {"start": min(max(test.term.value, low), high)}


def _dependence(place: str, what: Regressor, binned: Binned, b: int) -> Finding:
    factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
    mean = math.degrees(float(binned.mean[b]))
    ends = (f"{factor * end:.3g}".replace("-", "−") for end in binned.edges[b : b + 2])
    numbers = {"error": abs(mean), "side": "larger" if mean > 0 else "smaller", "unit": UNITS[what]}
    return Finding(
        "residual depends",
        "note",
        (place, what.value),
        numbers | dict(zip(("low", "high"), ends, strict=True)),
    )


def _stopped(check: ResidualCheck) -> float:
    """Time that the joint stands at its stop [s]."""
    return float(check.at_stop.sum() * np.median(np.diff(check.time)))
