"""What the numbers of a fit mean, in words and in a reader's units."""

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from hydroid.identification.fit import Fit
from hydroid.identification.problem import Problem
from hydroid.parameters import Array, Parameter
from hydroid.report.table import number, plain
from hydroid.settings.objective import ObjectiveSettings

AT_BOUND = 1e-3
"""an estimate is called at a bound within this part of the range"""

_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}
_ESTIMATES = {
    "average": "mean of the best set of each segment, as in the article",
    "utopia": "closest to the best of every segment at once",
    "best": "lowest error over the whole record",
    "polished": "least squares from the best of the others",
    "refined": "least squares over both stages' parameters from there",
}


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


def flags(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """What is to be known about the final estimate of each parameter; empty where nothing is."""
    return tuple(_flag(problem, fit, i) for i in range(len(problem.parameters.names)))


def _flag(problem: Problem, fit: Fit, i: int) -> str:
    parameter, value = problem.parameters.parameters[i], fit.best.theta[i]
    freed = fit.final == "refined" and parameter.lower < parameter.upper
    if parameter.fixed is not None and not freed:
        return "held fixed"
    found: list[str] = []
    if fit.without_effect[i]:
        found.append("no effect on the outputs")
    elif fit.sensitivity.undetermined[i]:
        found.append("not determined alone")
    if math.isnan(fit.effects[i]):
        found.append("effect unknown, the changed arm diverges")
    found += [f"at {side} bound" for side, at in _at_bounds(parameter, value) if at]
    return ", ".join(found)


def runs_flag(parameter: Parameter, values: Array, without_effect: Collection[str]) -> str:
    """What is to be known about a parameter over several runs, values of shape (N,); or nothing."""
    if not parameter.lower < parameter.upper or (parameter.fixed is not None and not np.ptp(values)):
        return "held fixed"
    if parameter.name in without_effect:
        return "no effect on the outputs"
    counts = ((side, int(np.sum(at))) for side, at in _at_bounds(parameter, values))
    return ", ".join(f"at {side} bound in {n} of {len(values)} runs" for side, n in counts if n)


def _at_bounds(parameter: Parameter, value: Array | float) -> tuple[tuple[str, NDArray[np.bool_]], ...]:
    """Whether values lie at each bound."""
    margin = AT_BOUND * (parameter.upper - parameter.lower)
    return (
        ("lower", np.asarray(value - parameter.lower <= margin)),
        ("upper", np.asarray(parameter.upper - value <= margin)),
    )


def told(problem: Problem, fit: Fit) -> str:
    """How much these logs tell, in a sentence or two."""
    free = sum(flag != "held fixed" for flag in flags(problem, fit))
    return (
        f"These logs determine {fit.sensitivity.combinations} independent combinations of the {free} free "
        "parameters. One that is not determined alone may change by a third or more while others make up for "
        "it: a small output error does not prove it."
    )


def cautions(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """What a reader of the answer should beware of, one sentence or two each."""
    flagged = list(zip(problem.parameters.parameters, flags(problem, fit), strict=True))
    said = [told(problem, fit)]
    idle = [p.name for p, flag in flagged if "no effect" in flag]
    if idle:
        said.append(
            f"{listed(idle)}: no effect on the outputs. Any value within the bounds fits as well; "
            "hold it fixed, or measure a joint that feels it."
        )
    for side in ("lower", "upper"):
        bounded = [
            f"{p.name} ({plain(p.lower if side == 'lower' else p.upper)} {p.unit})"
            for p, flag in flagged
            if f"at {side} bound" in flag and "no effect" not in flag
        ]
        if bounded:
            said.append(
                f"{listed(bounded)}: at the {side} bound. The data pull beyond it: "
                "the bound is too narrow, or the model lacks something."
            )
    return (*said, *_search_cautions(problem, fit), "The model's geometry is as configured in arm.yaml.")


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _search_cautions(problem: Problem, fit: Fit) -> list[str]:
    said: list[str] = []
    if len(fit.history) and (infeasible := int(fit.history[-1, 3])):
        said.append(
            f"{infeasible} of {int(fit.history[-1, 2])} simulated parameter sets diverged; "
            "they were ranked behind all others."
        )
    if fit.polish is not None:
        if not fit.polish.ending.converged:
            said.append(f"The polish ended early: {fit.polish.ending.value}.")
        if fit.best.overall > fit.searched.overall:
            minimised = _NORMS[problem.settings.objective.norm]
            said.append(
                f"The polish lowered the rms error; the {minimised}, which the search minimised, rose."
            )
    else:
        said.append("The estimate is the search's own, without a polish.")
    return said


def summary(fit: Fit) -> str:
    """How well the final estimate does, in a sentence."""
    name = f"{fit.final} estimate" if fit.final in ("polished", "refined") else "search's estimate"
    return f"The {name} leaves an rms error of {number(math.degrees(fit.best.rms))} deg on the fitted logs."
