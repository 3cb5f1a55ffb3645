"""What a reader must know before using an estimate, the most important first."""

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.fit import Fit
from hydroid.posterior.by_log import FEW, ByLog
from hydroid.posterior.directions import Identifiability
from hydroid.posterior.flags import Flag, Source
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem

_MOST_DIRECTIONS = 6


def fit_findings(fit: Fit) -> tuple[Finding, ...]:
    """Return what is to be said about a fit's way to its estimate."""
    findings = [] if fit.refinements else [Finding("not refined", "warning")]
    findings += [
        Finding("not converged", "warning", (name,), {"ending": refinement.ending.value})
        for name, refinement in fit.refinements.items()
        if not refinement.converged
    ]
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
    at: dict[tuple[str, str], list[str]] = {}
    kinds: dict[str, list[str]] = {
        kind: [] for kind in ("no effect", "not identifiable", "prior only", "weakly identifiable")
    }
    diverging: list[str] = []
    for parameter, status in zip(problem.parameters.parameters, known.status, strict=True):
        name, idle = parameter.name, status.flag is Flag.NO_EFFECT
        if status.at_bound and not idle:
            zero = status.at_bound == "lower" and parameter.lower == 0
            at.setdefault(("at zero" if zero else "at bound", status.at_bound), []).append(name)
        by_prior = status.source is Source.PRIOR and not idle
        kinds.get(Source.PRIOR.value if by_prior else status.flag.value, []).append(name)
        if status.diverges and status.flag is not Flag.FIXED:
            diverging.append(name)
    findings = [
        Finding(kind, "note" if kind == "at zero" else "warning", tuple(names), {"side": side})
        for (kind, side), names in sorted(at.items(), reverse=True)
    ]
    findings += log_findings(logs)
    findings += [Finding(kind, "note", tuple(names)) for kind, names in kinds.items() if names]
    if diverging:
        findings.append(Finding("effect unknown", "warning", tuple(diverging)))
    return (*findings, *(() if directions is None else _combinations(directions)))


def _combinations(directions: Identifiability) -> list[Finding]:
    """What the logs leave open of several parameters together; a single one has its flag."""
    several = [tuple(one) for one in directions.combinations if len(one) > 1]
    findings = [Finding("combination", "note", names) for names in several[:_MOST_DIRECTIONS]]
    if more := len(several[_MOST_DIRECTIONS:]):
        findings.append(Finding("more combinations", "note", (), {"count": str(more)}))
    return findings
