"""What a reader must know before using an estimate, the most important first."""

from collections.abc import Iterator

import numpy as np

from hydroid.findings import Finding, Level
from hydroid.fitting.fit import Fit
from hydroid.parameters import Parameter
from hydroid.posterior.by_log import FEW, ByLog
from hydroid.posterior.flags import Flag, ParameterStatus, Source
from hydroid.posterior.uncertainty import Identifiability, Uncertainty
from hydroid.problem.problem import Problem

_MOST_DIRECTIONS = 6
_LEVELS: dict[str, Level] = {
    "at bound": "warning",
    "effect unknown": "warning",
    "at zero": "note",
    "no effect": "note",
    "not identifiable": "note",
    "prior only": "note",
    "weakly identifiable": "note",
}
"""of what is found about single parameters"""


def fit_findings(fit: Fit) -> tuple[Finding, ...]:
    """Return what is to be said about a fit's way to its estimate."""
    findings = list[Finding]()
    if fit.refinement is None:
        findings.append(Finding("not refined", "warning"))
    elif not fit.refinement.converged:
        ending = {"ending": fit.refinement.ending.value}
        findings.append(Finding("not converged", "warning", (fit.final,), ending))
    for prior, score in fit.strains.items():
        numbers = {"score": abs(score), "side": "above" if score > 0 else "below"}
        findings.append(Finding("strained prior", "warning", (prior,), numbers))
    findings += [Finding("diverged", "warning", (e.name,)) for e in fit.estimates.values() if not e.usable]
    # half of a 95 % interval as large as the value, or without end
    lost = dict.fromkeys(q.label for q in fit.quantities.scalars.values() if not q.within <= 1.0)
    return (*findings, *([Finding("quantities open", "note", tuple(lost))] if lost else []))


def log_findings(logs: ByLog | None) -> tuple[Finding, ...]:
    """Return which parameters differ from log to log by more than the noise explains."""
    if logs is None or not logs.differing:
        return ()
    few = max(logs.freedom[np.isfinite(logs.freedom)], default=0.0) < FEW
    return (Finding("few logs disagree" if few else "logs disagree", "warning", logs.differing),)


def parameter_findings(
    problem: Problem, known: Uncertainty, logs: ByLog | None, directions: Identifiability | None
) -> tuple[Finding, ...]:
    """Return what is to be said about what the logs determine; a bound of 0 cannot be widened."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for parameter, status in zip(problem.parameters.parameters, known.status, strict=True):
        for kind in _kinds(parameter, status):
            kinds.setdefault(kind, []).append(parameter.name)
    findings = [
        Finding(kind, level, tuple(names), {"side": side} if side else {})
        for kind, level in _LEVELS.items()
        for (own, side), names in kinds.items()
        if own == kind
    ]
    findings += log_findings(logs)
    several = [tuple(one) for one in directions.combinations if len(one) > 1] if directions else []
    findings += [Finding("combination", "note", names) for names in several[:_MOST_DIRECTIONS]]
    if more := len(several[_MOST_DIRECTIONS:]):
        findings.append(Finding("more combinations", "note", (), {"count": str(more)}))
    return tuple(sorted(findings, key=lambda finding: finding.level == "note"))


def _kinds(parameter: Parameter, status: ParameterStatus) -> Iterator[tuple[str, str]]:
    """Yield the kinds of findings about one parameter, with the side of a bound."""
    idle = status.flag is Flag.NO_EFFECT
    if status.at_bound and not idle:
        zero = status.at_bound == "lower" and parameter.lower == 0
        yield "at zero" if zero else "at bound", status.at_bound
    yield (Source.PRIOR if status.source is Source.PRIOR and not idle else status.flag).value, ""
    if status.diverges and status.flag is not Flag.FIXED:
        yield "effect unknown", ""
