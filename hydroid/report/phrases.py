"""Every sentence about a fit that depends on its numbers: labels, flags, directions, warnings."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, Parameter
from hydroid.posterior.covariance import Uncertainty, at_bounds
from hydroid.posterior.directions import Direction, Identifiability
from hydroid.posterior.flags import WEAK_ABOVE, Flag, ParameterStatus, Source
from hydroid.posterior.intervals import Profile
from hydroid.posterior.patterns import CURRENTS, DirectionKind
from hydroid.problem.problem import Problem
from hydroid.settings.problem import ObjectiveSettings, PriorSettings
from hydroid.words import listed, number

ALGORITHMS = {
    "ga": "simple genetic algorithm",
    "nsga2": "NSGA-II, a multi-objective genetic algorithm",
    "cmaes": "CMA-ES, an evolution strategy",
    "multistart": "bounded least squares from random starts",
}
STAGES = {
    "mech": "1, the arm, with a gain in place of the hydraulics",
    "hyd": "2, the hydraulic actuator",
}
_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}
_ESTIMATES = {
    "average": "mean of the best candidates of all segments, as in the article",
    "utopia": "candidate whose errors are nearest to the lowest error of every segment",
    "best": "candidate with the lowest error over the whole record",
    "refined": "least squares, started from the best (lowest rms error) of the estimates named before it",
    "joint": "both stages refined together by least squares, started from 'refined'",
}
_UNKNOWN = {
    DirectionKind.NO_EFFECT: "its value",
    DirectionKind.SINGLE: "its value",
    DirectionKind.COMMON_SCALE: "the factor",
    DirectionKind.CURRENT_SCALE: "the factor",
    DirectionKind.SOLENOID: "any other combination",
}
"""what the logs do not determine, by the kind of direction"""
_UNEQUAL = 0.1
"""relative changes that differ by more than this do not scale by one factor"""


def estimate_label(fit: Fit, name: str) -> str:
    """Name an estimate; the search's own is marked as such."""
    return f"search ({name})" if name == fit.searched.name else name


def estimate_meanings(fit: Fit) -> str:
    """Say what the names of a fit's estimates mean."""
    meanings = (f"{estimate_label(fit, name)}: {_ESTIMATES.get(name, name)}" for name in fit.estimates)
    return f"{'; '.join(meanings)}."


def norm_label(objective: ObjectiveSettings) -> str:
    """Name the objective, with its unit."""
    label = _NORMS[objective.norm]
    return f"relative {label} [-]" if objective.relative else f"{label} [deg]"


def in_reader_units(objective: ObjectiveSettings, values: Array) -> Array:
    """Return objectives in deg, or as they are where relative."""
    return values if objective.relative else np.degrees(values)


def status_phrase(status: ParameterStatus) -> str:
    """Say what is to be known about an estimate; empty where nothing is."""
    parts: list[str] = []
    if status.diverges and status.flag is not Flag.FIXED:
        parts.append("effect unknown, the changed arm diverges")
    elif status.flag is not Flag.IDENTIFIABLE and (
        status.source is not Source.PRIOR or status.flag is Flag.NO_EFFECT
    ):
        parts.append(status.flag.value)
    if status.source is Source.BOTH or status.source is Source.PRIOR:
        parts.append(status.source.value)
    if status.doubt is not None:
        parts.append(f"interval only to {100 * status.doubt:.0f} %")
    if status.at_bound is not None:
        parts.append(f"at {status.at_bound} bound")
    return ", ".join(parts)


def runs_phrase(parameter: Parameter, values: Array, without_effect: Collection[str]) -> str:
    """Say what is to be known about a parameter over several runs, values of shape (N,); may be empty."""
    if not parameter.lower < parameter.upper or (parameter.fixed is not None and not np.ptp(values)):
        return Flag.FIXED.value
    if parameter.name in without_effect:
        return Flag.NO_EFFECT.value
    counts = ((side, int(np.sum(at))) for side, at in at_bounds(parameter, values))
    return ", ".join(f"at {side} bound in {n} of {len(values)} runs" for side, n in counts if n)


def direction_phrases(problem: Problem, result: Identifiability) -> tuple[str, ...]:
    """Name each direction that is not identifiable, or only weakly, and how well it is known."""
    return tuple(_direction_phrase(problem, one) for one in result.unidentifiable)


def _direction_phrase(problem: Problem, direction: Direction) -> str:
    name = _direction_name(problem, direction)
    count = f" ({len(direction.changes)} directions)" if len(direction.changes) > 1 else ""
    what = _UNKNOWN.get(direction.kind, "the size of this change")
    if direction.flag is Flag.UNIDENTIFIABLE:
        return f"{name}: {what} cannot be determined{count}"
    percent = 100 * direction.relative_sd
    digits = f"{percent:.2g}" if percent < 10 else f"{percent:.0f}"
    return f"{name}: {what} is known only weakly (standard deviation {digits} %){count}"


def _direction_name(problem: Problem, direction: Direction) -> str:
    names, changes = list(direction.parameters), list(direction.parameters.values())
    numbers = direction.numbers
    match direction.kind:
        case DirectionKind.NO_EFFECT:
            return f"{names[0]} has no effect on {outputs_phrase(problem)}"
        case DirectionKind.SINGLE:
            return names[0]
        case DirectionKind.COMMON_SCALE:
            unequal = np.ptp(changes) > _UNEQUAL
            note = " (the masses by unequal factors, to make up for what is fixed)" if unequal else ""
            return f"{listed(names)} can be multiplied by a common factor{note} with almost the same response"
        case DirectionKind.SOLENOID:
            values = f"δ = {numbers['delta']:.3g} mm and k·i0² = {numbers['k_i0']:.3g} N·mm²"
            return f"only two combinations of {listed(names)} matter, {values}"
        case DirectionKind.CURRENT_SCALE:
            settings = problem.settings.parameters
            currents = [n for n in names if settings[n].quantity in CURRENTS]
            coil = [n for n in names if n not in currents]
            held = ("δ", "delta", "mm"), ("k·I_max²", "k_imax", "N·mm²"), ("k·I_min²", "k_imin", "N·mm²")
            values = listed([f"{symbol} = {numbers[key]:.3g} {unit}" for symbol, key, unit in held])
            return (
                f"{listed(currents)} can be multiplied by a common factor if {listed(coil)} change so "
                f"that {values} "
                "stay the same"
            )
        case DirectionKind.COMBINATION:
            pairs = zip(names, changes, strict=True)
            parts = [f"{name} by " + f"{change:+.2g} %".replace("-", "−") for name, change in pairs]
            return f"changing {listed(parts)} together has almost no effect"


def outputs_phrase(problem: Problem) -> str:
    """Name what is compared."""
    joints = [str(joint) for joint in dict.fromkeys(c.joint for c in problem.channels)]
    which = (
        f"the angle of joint {joints[0]}" if len(joints) == 1 else f"the angles of joints {listed(joints)}"
    )
    pressed = any(c.quantity != "angle" for c in problem.channels)
    return f"{which} and the pressures" if pressed else which


def prior_phrase(prior: PriorSettings) -> str:
    """Write a prior as an equation."""
    if prior.ratio is not None:
        what = " / ".join(prior.ratio)
    else:
        terms = (n if f == 1 else f"{number(f)} {n}" for n, f in prior.factors.items())
        what = " + ".join(terms).replace("+ -", "- ")
    spread = ", exact" if prior.sd is None else f" ± {number(prior.sd)} (standard deviation)"
    return f"{what} = {number(prior.value)}{spread}"


def fit_summary(fit: Fit) -> str:
    """Say in a sentence how well the final estimate predicts the fitted logs, and whether it converged."""
    error = f"predicts the fitted logs with an rms error of {number(math.degrees(fit.best.rms))} deg"
    if fit.refinement is None:
        return f"The search's estimate {error}; it was not refined."
    ending = "converged" if fit.refinement.ending.converged else "did not converge"
    return f"The estimate '{fit.final}' {error}; its refinement {ending}."


def at_limits(problem: Problem, known: Uncertainty) -> list[str]:
    """Return the parameters that lie at a bound which could be wider."""
    nothing = at_zero(problem, known)
    names = zip(problem.parameters.names, known.status, strict=True)
    return [n for n, s in names if s.at_bound and s.flag is not Flag.NO_EFFECT and n not in nothing]


def at_zero(problem: Problem, known: Uncertainty) -> list[str]:
    """Return the parameters that lie at a lower bound of 0: no quantity can be negative."""
    return [
        p.name
        for p, status in zip(problem.parameters.parameters, known.status, strict=True)
        if status.at_bound == "lower" and p.lower == 0 and status.flag is not Flag.NO_EFFECT
    ]


def profile_warnings(profiles: Sequence[Profile]) -> tuple[str, ...]:
    """Say which profiles fit better than the estimate somewhere, and which hang on a bound."""
    bounded = tuple(
        f"Within the profile of {p.name}, {listed(p.bounded)} reached a bound, which limits its interval."
        for p in profiles
        if p.bounded
    )
    names = [profile.name for profile in profiles if profile.better_optimum]
    if not names:
        return bounded
    return (
        *bounded,
        f"The profile of {listed(names)} found a better fit than the estimate, which is no optimum: fit "
        "again from there, with more iterations or another seed.",
    )


def rank_phrase(result: Identifiability) -> str:
    """Say in a sentence how much the logs determine."""
    plural = "" if result.rank == 1 else "s"
    return (
        f"These logs determine {result.rank} independent combination{plural} of the {len(result.names)} free "
        f"parameters with a relative standard deviation of {100 * WEAK_ABOVE:.0f} % or less."
    )


def parameter_advice(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """Say which parameters have no effect or are not identifiable, and what to do about it."""
    statuses = dict(zip(problem.parameters.names, fit.uncertainty.status, strict=True))
    shown = {
        name: Source.PRIOR if status.source is Source.PRIOR else status.flag
        for name, status in statuses.items()
    }
    advice: dict[Flag | Source, str] = {
        Flag.NO_EFFECT: "Any value within the bounds gives the same response. Fix it, or compare a joint "
        "that it moves.",
        Flag.UNIDENTIFIABLE: "A small output error does not confirm such a value. Fix what is known from "
        "elsewhere or give it as a prior, compare more joints, or add logs in other poses.",
        Source.PRIOR: "The logs add next to nothing: value and interval are the prior's.",
        Flag.WEAK: "A prior, more joints or logs in other poses help.",
    }
    by_flag = {flag: [name for name, its in shown.items() if its is flag] for flag in advice}
    return tuple(f"{listed(names)}: {flag.value}. {advice[flag]}" for flag, names in by_flag.items() if names)
