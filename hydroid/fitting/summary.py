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
from hydroid.fitting.fit import Fit
from hydroid.fitting.ladder import Estimate
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
            "estimates": {
                one.name: _named_estimate(problem, one)
                for one in fit.estimates.values()
            },
            "quantities": scalars,
            "curves": curves,
        }
    )


def _named_estimate(problem: Problem, estimate: Estimate) -> NamedEstimate:
    """Return an estimate as it is stored: by names, and in degrees."""
    settings = problem.settings
    objective = (
        estimate.overall
        if settings.objective.relative
        else np.degrees(estimate.overall)
    )
    gained = None
    if estimate.gained is not None:
        gained = finite_ends(np.array(estimate.gained))
    return NamedEstimate(
        values=settings.of_estimate(estimate.name)
        .parameter_set()
        .mapping(estimate.theta),
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
    findings += _lasting_findings(problem, errors)
    several = [
        one for one in identifiability(problem, known).combinations if len(one) > 1
    ]
    # the table of directions has all
    findings += [
        Finding("combination", "note", tuple(one))
        for one in several[:MOST_COMBINATIONS]
    ]
    return FitSummary(
        stage=problem.settings.stage,
        estimate=estimate,
        findings=tuple(sorted(findings, key=lambda finding: finding.level == "note")),
        covariance=known.posterior.stored(parameters),
        errors=errors,
        left_out_deg={
            angle: tuple(left_out) for angle, left_out in logs.left_out.items()
        },
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
        if signal.quantity == "angle":
            sensor, rate, way, lasting_square, time = errors.numbers[i].tolist()
            result[f"q{signal.joint}"] = AngleError(
                sensor_deg=np.degrees(np.sqrt(sensor)),
                drift_per_s=np.degrees(np.degrees(rate)),
                drift_per_way=np.degrees(way),
                lasting_deg=np.degrees(np.sqrt(lasting_square)),
                lasting_s=time,
                after_10_s_deg=np.degrees(_deviation_ahead(errors, i, 10.0)),
                lasts_s=lasts[signal.joint],
            )
    return result


def _deviation_ahead(errors: ErrorModel, i: int, seconds: float) -> float:
    """Standard deviation of a signal so many seconds ahead, at its mean speed in the
    logs [rad]."""
    sensor, rate, way, lasting_square, _ = errors.numbers[i]
    courses = [
        course
        for course, own in zip(errors.courses, errors.of, strict=True)
        if own == i
    ]
    speed = sum(course.way.sum() for course in courses) / sum(
        c.period * len(c.way) for c in courses
    )
    return np.sqrt(sensor + lasting_square + (rate + way * speed) * seconds)


def fit_findings(fit: Fit) -> list[Finding]:
    """Return what is to be said about a fit's way to its estimate."""
    findings = [*_ending_findings(fit), *_optima_findings(fit), *_prior_findings(fit)]
    findings += [
        Finding("diverged", "warning", (e.name,))
        for e in fit.estimates.values()
        if not e.usable
    ]
    if lost := _open_quantities(fit):
        details = {joint: "; ".join(labels) for joint, labels in lost.items()}
        findings.append(
            Finding("quantities open", "note", tuple(lost), details=details)
        )
    return findings


def _open_quantities(fit: Fit) -> dict[str, list[str]]:
    """Return what half of a 95 % interval is as large as, or that has no limit: labels
    of quantities, by the names of their joints."""
    names = fit.problem.settings.arm.joint_names
    lost = dict[str, list[str]]()
    for quantity in fit.quantities[0].values():
        if not quantity.within <= 1.0:
            lost.setdefault(names[quantity.joint - 1], []).append(quantity.label)
    return lost


def _ending_findings(fit: Fit) -> Iterator[Finding]:
    """Yield why the refinement ended, if not at an optimum."""
    if fit.refinement is None:
        yield Finding("not refined", "warning")
        return
    ending = fit.refinement.ending
    if ending.converged:
        return
    kind = (
        "not converged"
        if fit.problem.settings.seeded
        else "not converged from its start"
    )
    if ending is Ending.TIME:
        kind = "time up"
    yield Finding(kind, "warning", (fit.final,), {"ending": ending.value})


def _optima_findings(fit: Fit) -> Iterator[Finding]:
    """Yield the joints whose starts ended at different optima."""
    apart = [
        joint
        for joint, ends in fit.ends.items()
        if max(ends) > SAME_OPTIMUM + min(ends)
    ]
    if apart:
        names = [
            fit.problem.settings.arm.joint_names[joint - 1] for joint in apart if joint
        ]
        yield Finding("several optima", "note", tuple(names or ["all joints"]))


def _prior_findings(fit: Fit) -> Iterator[Finding]:
    """Yield the priors from which the logs have led the estimate far away, the farthest
    first."""
    priors = fit.problem.priors
    vague = set[str]()
    for name, status in zip(
        fit.problem.parameters.names, fit.uncertainty.status, strict=True
    ):
        if status.source is Source.PRIOR or status.flag is Flag.UNIDENTIFIABLE:
            vague.add(name)
    # heavy tails foresee any distance
    distances = priors.scores(fit.best.theta[None])[0] * priors.firm
    scores = dict(zip(priors.names, distances.tolist(), strict=True))
    far = dict[str, str]()
    for prior in sorted(scores, key=lambda name: -abs(scores[name])):
        score = scores[prior]
        if abs(score) > STRAINED_ABOVE and prior not in vague:
            far[prior] = f"{abs(score):.1f} {'above' if score > 0 else 'below'}"
    if far:
        yield Finding("strained prior", "warning", tuple(far), details=far)


def _lasting_findings(
    problem: Problem, errors: Mapping[str, AngleError]
) -> list[Finding]:
    """Return the joints whose innovations are not white."""
    names = problem.settings.arm.joint_names
    return [
        Finding(
            "error lasts",
            "note",
            (names[joint - 1],),
            {"time": errors[f"q{joint}"].lasts_s},
        )
        for joint in problem.settings.outputs
        if errors[f"q{joint}"].lasts_s > 0
    ]


def _parameter_findings(
    problem: Problem, estimate: Mapping[str, ParameterEstimate]
) -> list[Finding]:
    """What is to be said about what the logs determine; a bound of 0 cannot be
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
    limits = CHOICES[problem.settings.parameters[parameter.name].quantity].limits
    return (
        "at limit"
        if limits is not None and parameter.upper >= limits[1]
        else "at bound"
    )
