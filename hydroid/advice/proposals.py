"""What suggestions propose: all of them as JSON has them, findings, and the command that frees a term."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from hydroid.advice.actions import STATED_SD, next_actions
from hydroid.advice.missing import TermTest, Verdict, missing_terms
from hydroid.advice.residuals import Regressor, ResidualCheck, residual_checks
from hydroid.estimate import finite
from hydroid.findings import Finding
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.quantities import Quantities, quantities
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings

UNITS = {Regressor.ANGLE: "deg", Regressor.VELOCITY: "deg/s", Regressor.COMMAND: "%"}
"""in which a regressor is shown"""

Content = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Advice:
    """Suggestions as JSON has them (docs/json.md), and the eight residuals with the largest errors."""

    content: Content
    residuals: tuple[ResidualCheck, ...]


def advice(
    problem: Problem,
    uncertainty: Uncertainty,
    determined: Quantities | None = None,
    *,
    run: str = "RUN",
    thorough: bool = True,
    progress: Progress = no_progress,
) -> Advice:
    """Return the suggestions about an estimate, as a run stores them.

    Args:
        problem: that was fitted.
        uncertainty: of its estimate.
        determined: the quantities there, if they are known already.
        run: its folder in commands.
        thorough: simulate all, as `hydroid suggest` does, or only what a fit's report can afford.
        progress: takes what is being done.
    """
    determined = quantities(problem, uncertainty) if determined is None else determined
    found = missing_terms(problem, uncertainty, thorough=thorough, progress=progress)
    several, labels = len(problem.active_joints) > 1, dict[str, str]()
    for name, one in determined.scalars.items():
        labels[name] = f"{one.label} of joint {one.joint}" if several else one.label
    slopes = {labels[name]: each for name, each in determined.slopes.items()}
    checks = residual_checks(problem, uncertainty)
    given = " ".join(shlex.quote(log.source) for log in problem.logs)
    content = {
        "rms_deg": math.degrees(found.rms),
        "thorough": thorough,
        "command": f"hydroid suggest {given} --fit {shlex.quote(run)}",
        "missing": [_missing(problem, test, run) for test in found.tests],
        "residuals": [
            {
                "log": check.log,
                "joint": check.joint,
                "rms_deg": math.degrees(check.rms),
                "correlation_s": check.correlation_s,
                "at_stop_s": check.stopped_s,
                "depends_on": [w.value for w, b in check.binned.items() if b.clearest(check.rms) is not None],
            }
            for check in checks
        ],
        "actions": next_actions(problem, uncertainty, slopes, simulate=thorough, progress=progress),
    }
    return Advice(content, tuple(sorted(checks, key=lambda check: -check.rms)[:8]))


def _missing(problem: Problem, test: TermTest, run: str) -> dict[str, Any]:
    free = test.verdict is Verdict.FREE
    return {
        "name": test.term.name,
        "verdict": test.verdict.value,
        "unit": test.term.settings.unit,
        "held": finite(test.term.value),
        "freed": finite(test.value),
        "rms_deg": math.degrees(test.rms),
        "score": test.statistic,
        "chance": test.chance,
        "parameter": proposed(test) if free else None,
        "command": freeing_command(problem, test, run) if free else None,
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
            numbers = {"what": what, "before": before, "after": after, "sd": 100 * STATED_SD.get(kind, 0.0)}
            link = settings.parameters[of].link if kind == "weigh" else None
            yield Finding(kind, "note", (link or of,), numbers)


def residual_findings(checks: Sequence[ResidualCheck], places: Sequence[str]) -> Iterator[Finding]:
    """Yield what each residual shows; `places` names joint and log of each."""
    for check, place in zip(checks, places, strict=True):
        for what, binned in check.binned.items():
            if (clear := binned.clearest(check.rms)) is not None:
                factor = 1.0 if what is Regressor.COMMAND else math.degrees(1.0)
                mean = math.degrees(float(binned.mean[clear]))
                low, high = (f"{factor * e:.3g}".replace("-", "−") for e in binned.edges[clear : clear + 2])
                numbers = {"error": abs(mean), "side": "larger" if mean > 0 else "smaller"}
                numbers |= {"unit": UNITS[what], "low": low, "high": high}
                yield Finding("residual depends", "note", (place, what.value), numbers)
        if check.correlation_s > 0.1:  # no sensor of an angle is that slow
            yield Finding("residual correlated", "note", (place,), {"seconds": check.correlation_s})
        if check.at_stop.any():
            error = float(np.sqrt(np.mean(check.residual[check.at_stop] ** 2)))
            numbers = {"seconds": check.stopped_s, "rms": math.degrees(error)}
            yield Finding("residual at stop", "note", (place,), numbers)


def freeing_command(problem: Problem, test: TermTest, run: str) -> str:
    """Return the command that fits the same logs again from a run's estimate, with a term freed."""
    name, _, parameter = setting_line(test).partition(": ")
    given = " ".join(shlex.quote(log.source) for log in problem.logs)
    config, own, out = (shlex.quote(path) for path in (f"{run}/config.yaml", run, f"{run}-{name}"))
    return (
        f"hydroid fit-{problem.settings.stage} {given} --config {config} --start {own} "
        f"--set {shlex.quote(f'parameters.{name}={parameter}')} --out {out}"
    )


def setting_line(test: TermTest) -> str:
    """Return the parameter that frees a term, as a line of YAML without braces around it."""
    entry = yaml.safe_dump(proposed(test), default_flow_style=True, sort_keys=False, width=math.inf)
    return f"{test.term.name}: {entry.strip()}"


def proposed(test: TermTest) -> dict[str, Any]:
    """Return the entry of `parameters` that frees a term.

    Its bounds are a fifth and five times the value that the test found, with the present value inside.
    Stage 2 asks for a start of every mechanical parameter that no run of stage 1 gives.
    """
    (low, high), now = test.term.span, test.term.value
    held = test.value if math.isinf(now) else now
    least = 0.0 if low == 0 else min(test.value / 5.0, held)
    ends = max(least, low), min(max(5.0 * test.value, held), high)
    bounds = [float(f"{end:.2g}") for end in ends]
    entry = test.term.settings.model_dump(mode="json", exclude_defaults=True) | {"bounds": bounds}
    mechanical = test.term.settings.quantity in MECHANICAL
    return entry | ({"start": min(max(now, bounds[0]), bounds[1])} if mechanical else {})
