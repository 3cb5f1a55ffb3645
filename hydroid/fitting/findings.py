"""What a reader must know before using a fit's estimate, the most important first."""

from collections.abc import Iterator

import numpy as np

from hydroid.findings import Finding
from hydroid.fitting.fit import Fit
from hydroid.posterior.by_log import FEW, ByLog, by_log
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import Flag
from hydroid.problem.problem import Problem

_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}


def fit_findings(problem: Problem, fit: Fit) -> tuple[Finding, ...]:
    """Return the warnings about a fit; `problem` is that of its last refinement."""
    return (
        *_endings(fit),
        *bound_findings(problem, fit.uncertainty),
        *_strains(fit),
        *(Finding("diverged", "warning", (e.name,)) for e in fit.estimates.values() if not e.usable),
        *_objective(problem, fit),
        *log_findings(by_log(problem, fit.uncertainty)),
    )


def bound_findings(problem: Problem, known: Uncertainty) -> Iterator[Finding]:
    """Yield which parameters lie at a bound; a bound of 0 cannot be widened."""
    at: dict[tuple[str, str], list[str]] = {}
    for parameter, status in zip(problem.parameters.parameters, known.status, strict=True):
        if status.at_bound and status.flag is not Flag.NO_EFFECT:
            zero = status.at_bound == "lower" and parameter.lower == 0
            at.setdefault(("at zero" if zero else "at bound", status.at_bound), []).append(parameter.name)
    for (kind, side), names in sorted(at.items(), reverse=True):
        yield Finding(kind, "note" if kind == "at zero" else "warning", tuple(names), {"side": side})


def log_findings(logs: ByLog | None) -> Iterator[Finding]:
    """Yield which parameters differ from log to log by more than the noise explains."""
    if logs is not None and logs.differing:
        few = max(logs.freedom[np.isfinite(logs.freedom)], default=0.0) < FEW
        yield Finding("few logs disagree" if few else "logs disagree", "warning", logs.differing)


def _endings(fit: Fit) -> Iterator[Finding]:
    if fit.refinement is None:
        yield Finding("not refined", "warning")
    for name, refinement in fit.refinements.items():
        if not refinement.ending.converged:
            yield Finding("not converged", "warning", (name,), {"ending": refinement.ending.value})


def _strains(fit: Fit) -> Iterator[Finding]:
    for strain in fit.strains:
        side = "above" if strain.score > 0 else "below"
        yield Finding(
            "strained prior", "warning", (strain.prior,), {"score": abs(strain.score), "side": side}
        )


def _objective(problem: Problem, fit: Fit) -> Iterator[Finding]:
    if fit.refinement is not None and fit.best.overall > fit.searched.overall:
        yield Finding("norm raised", "note", (), {"norm": _NORMS[problem.settings.objective.norm]})
