"""Parameters on bars from bound to bound: intervals, priors, and in plain words what each is."""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.flags import Flag, ParameterStatus
from hydroid.problem.problem import Problem
from hydroid.report.names import plain_name
from hydroid.report.page import Bar
from hydroid.report.phrases import runs_phrase, status_phrase
from hydroid.settings.problem import ParameterSettings
from hydroid.words import number, plain

_STATES = {
    Flag.IDENTIFIABLE: "known",
    Flag.WEAK: "weak",
    Flag.UNIDENTIFIABLE: "unknown",
    Flag.NO_EFFECT: "unknown",
    Flag.FIXED: "fixed",
}
_PRIOR_REACH = 1.96
"""standard deviations of a prior that its interval reaches"""


def fit_bars(problem: Problem, fit: Fit) -> tuple[Bar, ...]:
    """Return the bars of a fit's parameters."""
    known = fit.uncertainty
    columns = problem.parameters.parameters, fit.best.theta, known.interval, known.status
    others = [e.theta for e in fit.estimates.values() if e.name != fit.final and e.usable]
    settings = problem.settings.parameters
    return tuple(
        parameter_bar(p, settings[p.name], float(value), ends, status, [float(o[i]) for o in others])
        for i, (p, value, ends, status) in enumerate(zip(*columns, strict=True))
    )


def parameter_bar(
    parameter: Parameter,
    settings: ParameterSettings,
    value: float,
    ends: Array,
    status: ParameterStatus,
    others: Sequence[float] = (),
) -> Bar:
    """Return the bar of one parameter; `ends`, shape (2,), are of its interval, `others` more estimates."""
    low, high = map(float, ends)
    finite = math.isfinite(low) and math.isfinite(high)
    name = plain_name(settings)
    words = f"{number(low)} to {number(high)}" if finite else ""
    fixed = status.flag is Flag.FIXED or not parameter.lower < parameter.upper
    if fixed:
        return Bar(parameter.name, name, _value(value, parameter), note="fixed", state="fixed")
    return Bar(
        parameter.name,
        name,
        _value(value, parameter),
        words,
        (_bound(parameter.lower), _bound(parameter.upper)),
        status_phrase(status),
        _STATES[status.flag],
        _place(parameter, value),
        (_place(parameter, low), _place(parameter, high)) if finite else None,
        _prior(parameter),
        tuple(_place(parameter, other) for other in others if math.isfinite(other)),
    )


def spread_bars(
    parameters: ParameterSet, settings: Mapping[str, ParameterSettings], theta: Array, idle: Collection[str]
) -> tuple[Bar, ...]:
    """Return bars of several runs' estimates, theta of shape (N, P); `idle` parameters have no effect."""
    bars: list[Bar] = []
    for parameter, values in zip(parameters.parameters, theta.T, strict=True):
        middle = float(np.median(values))
        name = plain_name(settings[parameter.name]) if parameter.name in settings else ""
        note = runs_phrase(parameter, values, idle)
        if not parameter.lower < parameter.upper:
            bars.append(Bar(parameter.name, name, _value(middle, parameter), note="fixed", state="fixed"))
            continue
        places = tuple(_place(parameter, float(value)) for value in values)
        bars.append(
            Bar(
                parameter.name,
                name,
                f"median {_value(middle, parameter)}",
                f"{number(float(values.min()))} to {number(float(values.max()))}",
                (_bound(parameter.lower), _bound(parameter.upper)),
                note,
                "unknown" if parameter.name in idle else "known",
                _place(parameter, middle),
                dots=places,
            )
        )
    return tuple(bars)


def _value(value: float, parameter: Parameter) -> str:
    return f"{number(value)} {parameter.unit}".rstrip()


def _bound(value: float) -> str:
    return plain(float(f"{value:.3g}"))


def _place(parameter: Parameter, value: float) -> float:
    if parameter.log and value <= 0:
        return 0.0
    return float(np.clip(parameter.position(value), 0.0, 1.0))


def _prior(parameter: Parameter) -> tuple[float, float] | None:
    if parameter.prior is None:
        return None
    low, high = (parameter.prior.value(score) for score in (-_PRIOR_REACH, _PRIOR_REACH))
    return _place(parameter, low), _place(parameter, high)
