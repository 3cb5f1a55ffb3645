"""What the numbers of a fit mean, in words and in a reader's units."""

import math
from collections.abc import Collection

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, Parameter
from hydroid.problem.problem import Problem
from hydroid.report.phrases import listed, status_phrase
from hydroid.report.table import number, plain
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.covariance import at_bounds
from hydroid.uncertainty.flags import WEAK_ABOVE, Flag

_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}
_ESTIMATES = {
    "average": "mean of the best set of each segment, as in the article",
    "utopia": "closest to the best of every segment at once",
    "best": "lowest error over the whole record",
    "refined": "least squares from the best of the others",
    "joint": "least squares over both stages' parameters from there",
}


_OPEN = "Hold fixed or state (`known`) what is {} otherwise, compare more joints, or add logs in other poses."


def estimate_label(fit: Fit, name: str) -> str:
    """Name of an estimate; the search's own is marked as such."""
    return f"search ({name})" if name == fit.searched.name else name


def estimate_words(fit: Fit) -> str:
    """What the names of a fit's estimates mean."""
    return (
        "; ".join(f"{estimate_label(fit, name)}: {_ESTIMATES.get(name, name)}" for name in fit.estimates)
        + "."
    )


def norm_label(settings: ObjectiveSettings) -> str:
    """What the objectives are, with their unit."""
    label = _NORMS[settings.norm]
    return f"relative {label} [-]" if settings.relative else f"{label} [deg]"


def in_reader_units(settings: ObjectiveSettings, objectives: Array) -> Array:
    """Objectives in deg, or as they are where relative."""
    return objectives if settings.relative else np.degrees(objectives)


def flags(fit: Fit) -> tuple[str, ...]:
    """What is to be known about the final estimate of each parameter; empty where nothing is."""
    return tuple(status_phrase(status) for status in fit.uncertainty.status)


def runs_flag(parameter: Parameter, values: Array, without_effect: Collection[str]) -> str:
    """What is to be known about a parameter over several runs, values of shape (N,); or nothing."""
    if not parameter.lower < parameter.upper or (parameter.fixed is not None and not np.ptp(values)):
        return Flag.FIXED.value
    if parameter.name in without_effect:
        return Flag.NO_EFFECT.value
    counts = ((side, int(np.sum(at))) for side, at in at_bounds(parameter, values))
    return ", ".join(f"at {side} bound in {n} of {len(values)} runs" for side, n in counts if n)


def told(fit: Fit) -> str:
    """How much these logs tell, in a sentence or two."""
    names, rank = fit.identifiability.names, fit.identifiability.rank
    return (
        f"These logs determine {rank} independent combination{'' if rank == 1 else 's'} of the {len(names)} "
        f"free parameters to {100 * WEAK_ABOVE:.0f} % or better. ±: 95 % interval for noise as these logs show "
        "it, as far as the model holds. A parameter that is not identifiable has none: a small output error "
        "does not prove it."
    )


def cautions(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """What a reader of the answer should beware of, one sentence or two each."""
    statuses = list(zip(problem.parameters.parameters, fit.uncertainty.status, strict=True))
    said = [told(fit)]
    idle = [p.name for p, status in statuses if status.flag is Flag.NO_EFFECT]
    if idle:
        said.append(
            f"{listed(idle)}: no effect on the outputs. Any value within the bounds fits as well; "
            "hold it fixed, or measure a joint that feels it."
        )
    for flag, advice in ((Flag.UNIDENTIFIABLE, "known"), (Flag.WEAK, "known better")):
        if open_ := [p.name for p, status in statuses if status.flag is flag]:
            said.append(f"{listed(open_)}: {flag.value}. {_OPEN.format(advice)}")
    for side in ("lower", "upper"):
        bounded = [
            f"{p.name} ({plain(p.lower if side == 'lower' else p.upper)} {p.unit})"
            for p, status in statuses
            if status.at_bound == side and status.flag is not Flag.NO_EFFECT
        ]
        if bounded:
            said.append(
                f"{listed(bounded)}: at the {side} bound. The data pull beyond it: "
                "the bound is too narrow, or the model lacks something."
            )
    return (*said, *_search_cautions(problem, fit), "The model's geometry is as configured in arm.yaml.")


def _search_cautions(problem: Problem, fit: Fit) -> list[str]:
    said: list[str] = []
    if len(fit.history) and (infeasible := int(fit.history[-1, 3])):
        said.append(
            f"{infeasible} of {int(fit.history[-1, 2])} simulated parameter sets diverged; "
            "they were ranked behind all others."
        )
    said += [
        f"The estimate {name} diverged when it was simulated, and was not used."
        for name, estimate in fit.estimates.items()
        if not math.isfinite(estimate.rms)
    ]
    if fit.refinement is not None:
        if not fit.refinement.ending.converged:
            said.append(f"The refinement ended early: {fit.refinement.ending.value}.")
        if fit.best.overall > fit.searched.overall:
            minimised = _NORMS[problem.settings.objective.norm]
            said.append(
                f"The refinement lowered the rms error; the {minimised}, which the search minimised, rose."
            )
    else:
        said.append("The estimate is the search's own, without a refinement.")
    return said


def summary(fit: Fit) -> str:
    """How well the final estimate does, in a sentence."""
    name = f"{fit.final} estimate" if fit.final in ("refined", "joint") else "search's estimate"
    return f"The {name} leaves an rms error of {number(math.degrees(fit.best.rms))} deg on the fitted logs."
