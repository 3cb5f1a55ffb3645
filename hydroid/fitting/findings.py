"""What a reader must know before using an estimate, the most important first."""

from collections.abc import Iterator, Sequence

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.fit import Fit
from hydroid.posterior.by_log import FEW, ByLog
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.directions import DirectionKind, Identifiability
from hydroid.posterior.flags import Flag, ParameterStatus, Source
from hydroid.problem.problem import Problem

_MOST_DIRECTIONS = 6
_LOST_ABOVE = 1.0
"""half of a 95 % interval, relative to the value, above which a quantity counts as open"""


def fit_findings(fit: Fit) -> tuple[Finding, ...]:
    """Return what is to be said about a fit's way to its estimate."""
    return (
        *_endings(fit),
        *_strains(fit),
        *(Finding("diverged", "warning", (e.name,)) for e in fit.estimates.values() if not e.usable),
        *_open_quantities(fit),
    )


def parameter_findings(
    problem: Problem, known: Uncertainty, logs: ByLog | None, directions: Identifiability | None
) -> tuple[Finding, ...]:
    """Return what is to be said about what the logs determine."""
    names = problem.parameters.names
    return (
        *_bounds(problem, known.status),
        *log_findings(logs),
        *_flags(names, known.status),
        *_doubts(names, known.status),
        *(() if directions is None else _directions(directions)),
    )


def log_findings(logs: ByLog | None) -> Iterator[Finding]:
    """Yield which parameters differ from log to log by more than the noise explains."""
    if logs is not None and logs.differing:
        few = max(logs.freedom[np.isfinite(logs.freedom)], default=0.0) < FEW
        yield Finding("few logs disagree" if few else "logs disagree", "warning", logs.differing)


def _bounds(problem: Problem, statuses: Sequence[ParameterStatus]) -> Iterator[Finding]:
    """Yield which parameters lie at a bound; a bound of 0 cannot be widened."""
    at: dict[tuple[str, str], list[str]] = {}
    for parameter, status in zip(problem.parameters.parameters, statuses, strict=True):
        if status.at_bound and status.flag is not Flag.NO_EFFECT:
            zero = status.at_bound == "lower" and parameter.lower == 0
            at.setdefault(("at zero" if zero else "at bound", status.at_bound), []).append(parameter.name)
    for (kind, side), names in sorted(at.items(), reverse=True):
        yield Finding(kind, "note" if kind == "at zero" else "warning", tuple(names), {"side": side})


def _flags(names: Sequence[str], statuses: Sequence[ParameterStatus]) -> Iterator[Finding]:
    kinds = {
        Flag.NO_EFFECT: "no effect",
        Flag.UNIDENTIFIABLE: "not identifiable",
        Source.PRIOR: "prior only",
        Flag.WEAK: "weakly identifiable",
    }
    which: dict[str, Flag | Source] = {
        name: s.source if s.source is Source.PRIOR and s.flag is not Flag.NO_EFFECT else s.flag
        for name, s in zip(names, statuses, strict=True)
    }
    for flag, kind in kinds.items():
        if chosen := tuple(name for name, its in which.items() if its is flag):
            yield Finding(kind, "note", chosen)


def _doubts(names: Sequence[str], statuses: Sequence[ParameterStatus]) -> Iterator[Finding]:
    pairs = list(zip(names, statuses, strict=True))
    if diverging := tuple(n for n, s in pairs if s.diverges and s.flag is not Flag.FIXED):
        yield Finding("effect unknown", "warning", diverging)
    if doubtful := {n: s.doubt for n, s in pairs if s.doubt is not None}:
        yield Finding("interval rough", "note", tuple(doubtful), {"percent": 100 * max(doubtful.values())})


def _directions(found: Identifiability) -> Iterator[Finding]:
    """Yield the combinations that the logs leave open; a single parameter has its flag."""
    single = DirectionKind.NO_EFFECT, DirectionKind.SINGLE
    several = [one for one in found.unidentifiable if one.kind not in single]
    for one in several[:_MOST_DIRECTIONS]:
        kind = "common scale" if one.kind is DirectionKind.COMMON_SCALE else "combination"
        yield Finding(kind, "note", tuple(one.parameters))
    if more := len(several[_MOST_DIRECTIONS:]):
        yield Finding("more combinations", "note", (), {"count": str(more)})


def _endings(fit: Fit) -> Iterator[Finding]:
    if fit.refinement is None:
        yield Finding("not refined", "warning")
    for name, refinement in fit.refinements.items():
        if not refinement.ending.converged:
            yield Finding("not converged", "warning", (name,), {"ending": refinement.ending.value})


def _strains(fit: Fit) -> Iterator[Finding]:
    for prior, score in fit.strains.items():
        side = "above" if score > 0 else "below"
        yield Finding("strained prior", "warning", (prior,), {"score": abs(score), "side": side})


def _open_quantities(fit: Fit) -> Iterator[Finding]:
    lost = [q.label for q in fit.quantities.scalars.values() if not q.within <= _LOST_ABOVE]
    if lost:
        yield Finding("quantities open", "note", tuple(dict.fromkeys(lost)))
