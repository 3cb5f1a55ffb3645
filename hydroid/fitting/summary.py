"""A fit's result as `estimate.yaml` and `--json` hold it, with what a reader must know
before using it."""

from collections import defaultdict
from collections.abc import Iterator, Mapping

import numpy as np

from hydroid.estimate import (
    AngleError,
    FitSummary,
    NamedEstimate,
    ParameterEstimate,
    finite,
    finite_ends,
)
from hydroid.findings import Finding
from hydroid.fitting.estimates import Estimate
from hydroid.fitting.fit import Fit
from hydroid.parameters import Parameter
from hydroid.posterior.by_log import ByLog, by_log
from hydroid.posterior.error_model import ErrorModel
from hydroid.posterior.identifiability import identifiability
from hydroid.posterior.uncertainty import Flag, Source, Uncertainty
from hydroid.posterior.whiteness import lasting
from hydroid.problem.problem import Problem
from hydroid.quantity_table import CHOICES
from hydroid.search.descent import Ending

STRAINED_ABOVE = 2.0
"""standard deviations from its prior beyond which an estimate strains it, if the logs
determine it"""
SAME_OPTIMUM = 10.0
"""log-likelihood below the best up to which a start has found the same optimum"""
MOST_COMBINATIONS = 6
"""of parameters that stand in for each other, as findings"""
_WARNINGS = "at bound", "effect unknown"
_KINDS = (
    *_WARNINGS,
    "at zero",
    "at limit",
    "no effect",
    "not identifiable",
    "prior only",
    "weakly identifiable",
)
"""of what is found about single parameters, the most important first"""


def summarise(problem: Problem, fit: Fit) -> FitSummary:
    """Return the final estimate with its uncertainty, and the estimates it was chosen
    from."""
    known = account(fit.problem, fit.uncertainty)
    scalars, curves = fit.quantities
    simulations, diverged = fit.history[-1, 2:4]
    # those that were not kept, too: a reader sees what a term or a model gained
    estimates = dict[str, NamedEstimate]()
    for estimate in fit.estimates.values():
        estimates[estimate.name] = _named_estimate(problem, estimate)
    converged = None
    ending = None
    if fit.refinement is not None:
        converged = fit.refinement.ending.converged
        ending = fit.refinement.ending.value
    return known.changed(
        {
            "joints": problem.active_joints,
            "final": fit.final,
            "converged": converged,
            "ending": ending,
            "rms_deg": finite(np.degrees(fit.best.rms)),
            "seed": problem.settings.search.seed,
            "simulations": int(simulations),
            "diverged": int(diverged),
            "findings": (*fit_findings(fit), *known.findings),
            "estimates": estimates,
            "tried": {
                term: gained and finite_ends(np.array(gained))
                for term, gained in fit.tried.items()
            },
            "quantities": scalars,
            "curves": curves,
        }
    )


def _named_estimate(problem: Problem, estimate: Estimate) -> NamedEstimate:
    """Return an estimate as it is stored: by names, and in degrees."""
    settings = problem.settings
    objective = estimate.overall
    if not settings.objective.relative:
        objective = np.degrees(objective)
    gained = None
    if estimate.gained is not None:
        gained = finite_ends(np.array(estimate.gained))
    # one of another model or with another term has other parameters
    parameters = settings.of_estimate(estimate.name).parameter_set()
    return NamedEstimate(
        values=parameters.mapping(estimate.theta),
        rms_deg=finite(np.degrees(estimate.rms)),
        objective=finite(objective),
        gained=gained,
    )


def account(problem: Problem, known: Uncertainty) -> FitSummary:
    """Return an estimate with what its logs say about it, whatever led to it."""
    logs = by_log(problem, known)
    parameters = problem.parameters
    estimate = dict[str, ParameterEstimate]()
    for i, parameter in enumerate(parameters.parameters):
        estimate[parameter.name] = _parameter_estimate(parameter.unit, i, known, logs)
    errors = angle_errors(known)

    findings = _parameter_findings(problem, estimate)
    if logs.differing:
        findings.append(Finding("logs disagree", "warning", logs.differing))
    settings = problem.settings
    alone = [j for j in settings.outputs if settings.is_by_command(j)]
    if alone:
        names = tuple(map(settings.arm.name_of, alone))
        findings.append(Finding("by command", "note", names))
    findings += _lasting_findings(problem, errors)
    combinations = identifiability(problem, known).combinations
    several = [names for names in combinations if len(names) > 1]
    # the table of directions has all
    for names in several[:MOST_COMBINATIONS]:
        findings.append(Finding("combination", "note", tuple(names)))
    # warnings come first
    findings.sort(key=lambda finding: finding.level == "note")
    return FitSummary(
        stage=problem.settings.stage,
        estimate=estimate,
        findings=tuple(findings),
        covariance=known.posterior.stored(parameters),
        errors=errors,
        left_out_deg={angle: tuple(rms) for angle, rms in logs.left_out.items()},
    )


def _parameter_estimate(
    unit: str, i: int, known: Uncertainty, logs: ByLog
) -> ParameterEstimate:
    """Return parameter number i of an estimate, with what is known of it."""
    status = known.status[i]
    return ParameterEstimate(
        value=float(known.theta[i]),
        unit=unit,
        sd=finite(known.standard_deviation[i]),
        sd_by_log=finite(logs.relative[i] * known.linear.box.scale[i]),
        interval=finite_ends(known.interval[i]),
        interval_by_log=finite_ends(logs.interval[i]),
        flag=status.flag.value,
        source=status.source and status.source.value,
        data_share=None if status.flag is Flag.FIXED else status.share,
        at_bound=status.at_bound,
        effect_deg=finite(np.degrees(known.sensitivity[i])),
    )


def angle_errors(known: Uncertainty) -> dict[str, AngleError]:
    """Return what is known of the error of each compared angle, by its name."""
    errors = known.errors
    lasts = lasting(errors, known.innovations)
    result = dict[str, AngleError]()
    for i, signal in enumerate(errors.signals):
        if signal.quantity != "angle":
            continue
        sensor, rate, way, lasting_square, time = errors.numbers[i].tolist()
        result[f"q{signal.joint}"] = AngleError(
            sensor_deg=np.degrees(np.sqrt(sensor)),
            # a variance, hence the factor twice
            drift_per_s=np.degrees(np.degrees(rate)),
            # a variance per way: one factor is left
            drift_per_way=np.degrees(way),
            lasting_deg=np.degrees(np.sqrt(lasting_square)),
            lasting_s=time,
            after_10_s_deg=np.degrees(_deviation_ahead(errors, i, 10.0)),
            lasts_s=lasts[signal.joint],
        )
    return result


def _deviation_ahead(errors: ErrorModel, i: int, seconds: float) -> float:
    """Return the standard deviation of a signal so many seconds ahead, at its mean
    speed in the logs [rad]."""
    sensor, rate, way, lasting_square, _ = errors.numbers[i]
    path = 0.0
    duration = 0.0
    for course, own in zip(errors.courses, errors.of, strict=True):
        if own == i:
            path += course.way.sum()
            duration += course.period * len(course.way)
    drift = rate + way * (path / duration)
    return np.sqrt(sensor + lasting_square + drift * seconds)


def fit_findings(fit: Fit) -> list[Finding]:
    """Return what is to be said about a fit's way to its estimate."""
    findings = [*_ending_findings(fit), *_optima_findings(fit), *_prior_findings(fit)]
    for estimate in fit.estimates.values():
        if not estimate.usable:
            findings.append(Finding("diverged", "warning", (estimate.name,)))
    if lost := _open_quantities(fit):
        details = {joint: "; ".join(labels) for joint, labels in lost.items()}
        findings.append(
            Finding("quantities open", "note", tuple(lost), details=details)
        )
    return findings


def _open_quantities(fit: Fit) -> dict[str, list[str]]:
    """Return the labels of quantities, by the names of their joints, half of whose 95 %
    interval is as large as the value, or has no end."""
    arm = fit.problem.settings.arm
    lost = dict[str, list[str]]()
    scalars, _ = fit.quantities
    for quantity in scalars.values():
        if not quantity.within <= 1.0:
            lost.setdefault(arm.name_of(quantity.joint), []).append(quantity.label)
    return lost


def _ending_findings(fit: Fit) -> Iterator[Finding]:
    """Yield why the refinement ended, if not at an optimum."""
    if fit.refinement is None:
        yield Finding("not refined", "warning")
        return
    ending = fit.refinement.ending
    if ending.converged:
        return
    kind = "not converged"
    # another seed would lead it nowhere else
    if not fit.problem.settings.seeded:
        kind = "not converged from its start"
    if ending is Ending.TIME:
        kind = "time up"
    yield Finding(kind, "warning", (fit.final,), {"ending": ending.value})


def _optima_findings(fit: Fit) -> Iterator[Finding]:
    """Yield the joints whose starts ended at different optima."""
    joint_names = fit.problem.settings.arm.joint_names
    names = list[str]()
    for joint, ends in fit.ends.items():
        if max(ends) <= SAME_OPTIMUM + min(ends):
            continue
        # joint 0 stands for all of them together
        names.append(joint_names[joint - 1] if joint else "all joints")
    if names:
        yield Finding("several optima", "note", tuple(names))


def _prior_findings(fit: Fit) -> Iterator[Finding]:
    """Yield the priors from which the logs have led the estimate far away, the farthest
    first."""
    priors = fit.problem.priors
    vague = set[str]()
    parameters = fit.problem.parameters.names
    for name, status in zip(parameters, fit.uncertainty.status, strict=True):
        # the logs say too little of it to contradict its prior
        if status.source is Source.PRIOR or status.flag is Flag.UNIDENTIFIABLE:
            vague.add(name)
    # heavy tails foresee any distance
    distances = priors.scores(fit.best.theta[None])[0] * priors.firm
    scores = dict(zip(priors.names, distances.tolist(), strict=True))
    far = dict[str, str]()
    for prior in sorted(scores, key=lambda name: -abs(scores[name])):
        score = scores[prior]
        if abs(score) > STRAINED_ABOVE and prior not in vague:
            side = "above" if score > 0 else "below"
            far[prior] = f"{abs(score):.1f} {side}"
    if far:
        yield Finding("strained prior", "warning", tuple(far), details=far)


def _lasting_findings(
    problem: Problem, errors: Mapping[str, AngleError]
) -> list[Finding]:
    """Return the joints whose innovations are not white."""
    findings = list[Finding]()
    for joint in problem.settings.outputs:
        lasts_s = errors[f"q{joint}"].lasts_s
        if lasts_s > 0:
            name = problem.settings.arm.name_of(joint)
            findings.append(Finding("error lasts", "note", (name,), {"time": lasts_s}))
    return findings


def _parameter_findings(
    problem: Problem, estimate: Mapping[str, ParameterEstimate]
) -> list[Finding]:
    """Return what is to be said about what the logs determine; a bound of 0 cannot be
    widened."""
    kinds = defaultdict[tuple[str, str], list[str]](list)
    for parameter in problem.parameters.parameters:
        for kind in _kinds_of(problem, parameter, estimate[parameter.name]):
            kinds[kind].append(parameter.name)
    findings = list[Finding]()
    for kind in _KINDS:
        level = "warning" if kind in _WARNINGS else "note"
        for (own, side), names in kinds.items():
            if own == kind:
                values = {"side": side} if side else {}
                findings.append(Finding(kind, level, tuple(names), values))
    return findings


def _kinds_of(
    problem: Problem, parameter: Parameter, one: ParameterEstimate
) -> Iterator[tuple[str, str]]:
    """Yield kinds of findings about a parameter, each with the side of its bounds.

    That no log has an effect of other groups is meant to be so.
    """
    idle = one.flag == Flag.NO_EFFECT
    if one.at_bound and not idle:
        yield _at_bound(problem, parameter, one.at_bound), one.at_bound
    if idle and problem.settings.parameters[parameter.name].per:
        return
    by_prior = one.source == Source.PRIOR and not idle
    yield str(one.source if by_prior else one.flag), ""
    # simulations diverge where it is changed
    if one.effect_deg is None and one.flag != Flag.FIXED:
        yield "effect unknown", ""


def _at_bound(problem: Problem, parameter: Parameter, side: str) -> str:
    """Return the kind of finding of an estimate at a bound: none asks to widen what
    nobody can widen."""
    if side == "lower":
        return "at zero" if parameter.lower == 0 else "at bound"
    quantity = problem.settings.parameters[parameter.name].quantity
    limits = CHOICES[quantity].limits
    if limits is not None and parameter.upper >= limits[1]:
        return "at limit"
    return "at bound"
