"""The tables of a fit: parameters, output errors, Pareto set, validation (table 9), repeated runs."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from hydroid.fitting.fit import Estimate, Fit
from hydroid.fitting.validation import ErrorIndices, error_indices, pooled_indices
from hydroid.parameters import Array, Parameter, ParameterSet, relative_error
from hydroid.problem.problem import Problem
from hydroid.report.channels import channels
from hydroid.report.table import Cell, Given, Table, known
from hydroid.report.words import (
    estimate_label,
    estimate_words,
    flags,
    in_reader_units,
    norm_label,
    runs_flag,
    told,
)

_INDICES = ("mean absolute [deg]", "rms [deg]", "largest [deg]", "fit [%]")
_INDICES_NOTE = (
    "fit = 100 % for a perfect response, 0 % for the mean of the measured angle; a dash: it does not move."
)
_POOLED_NOTE = " all: every joint about its own mean."


def parameter_table(problem: Problem, fit: Fit, truth: Mapping[str, float] | None = None) -> Table:
    """One row a parameter: its bounds, every estimate of it, what it moves, and what to know about it.

    Args:
        problem: the problem.
        fit: what was found.
        truth: true values by name, in a study on simulated data; adds relative errors and their sum
            as in the article's table 6.
    """
    names = list(fit.estimates)
    header = ["name", "unit", "lower", "upper", *(estimate_label(fit, name) for name in names)]
    judged = [fit.estimates[name] for name in dict.fromkeys([fit.searched.name, fit.final])]
    if truth:
        header += ["true", *(f"relative error, {_short(estimate, fit)}" for estimate in judged)]
    header += ["±", "effect [deg]", "flag"]
    said = flags(fit)
    half = np.diff(fit.uncertainty.interval, axis=1)[:, 0] / 2
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(problem.parameters.parameters):
        row: list[Cell] = [*_named(parameter), *(float(fit.estimates[name].theta[i]) for name in names)]
        if truth:
            true = truth.get(parameter.name)
            row += [Given(true) if true is not None else None, *(_relative(e.theta[i], true) for e in judged)]
        rows.append((*row, known(half[i]), known(degrees(fit.effects[i])), said[i]))
    if truth:
        without = [n for n, none in zip(problem.parameters.names, fit.without_effect, strict=True) if none]
        rows += _sum_rows(problem.parameters, [e.theta for e in judged], truth, without, 5 + len(names))
    note = f"{estimate_words(fit)} effect: rms change of the output for 1 % of the value. {told(fit)}"
    return Table("Parameters", tuple(header), tuple(rows), note)


def objective_table(problem: Problem, fit: Fit) -> Table:
    """Output error of each estimate on the fitted logs, and the norm that the search minimised."""
    known = channels(problem)
    several = len(known) > 1
    settings = problem.settings.objective
    about = f"{_INDICES_NOTE}{_POOLED_NOTE if several else ''}"
    objective = "objective [-]" if settings.relative else "objective [deg]"
    rows: list[tuple[Cell, ...]] = []
    for name, estimate in fit.estimates.items():
        label = estimate_label(fit, name)
        for c in known:
            indices = error_indices(c.measured, c.simulated(estimate.responses))
            rows.append(
                (label, c.log, c.joint, *_indices(indices), None if several else _overall(problem, estimate))
            )
        if several:
            indices = pooled_indices([(c.measured, c.simulated(estimate.responses)) for c in known])
            rows.append((label, "all", None, *_indices(indices), _overall(problem, estimate)))
    return Table(
        "Output error on the fitted logs",
        ("estimate", "log", "joint", *_INDICES, objective),
        tuple(rows),
        f"{about} objective: {norm_label(settings)} over the whole record.",
    )


def pareto_table(problem: Problem, fit: Fit) -> Table:
    """The non-dominated parameter sets of the last population, best overall first."""
    theta, evaluation = fit.front
    settings = problem.settings.objective
    segments, overall = (in_reader_units(settings, a) for a in (evaluation.segments, evaluation.overall))
    header = [f"{p.name} [{p.unit}]" for p in problem.parameters.parameters]
    header += [f"segment {s}" for s in range(1, segments.shape[1] + 1)]
    rows = tuple(
        tuple(map(float, (*theta[i], *segments[i], overall[i]))) for i in np.argsort(overall, kind="stable")
    )
    return Table("Pareto set", (*header, "whole record"), rows, f"Objectives: {norm_label(settings)}.")


@dataclass(frozen=True)
class ValidationRow:
    """How one fit does on one joint, numbered from 1, of one log."""

    fit: str
    log: str
    joint: int
    indices: ErrorIndices


def validation_table(rows: Sequence[ValidationRow]) -> Table:
    """Error indices of several fits on several logs, as in the article's table 9."""
    return Table(
        "Output error on given logs",
        ("fit", "log", "joint", *_INDICES),
        tuple((r.fit, r.log, r.joint, *_indices(r.indices)) for r in rows),
        _INDICES_NOTE,
    )


@dataclass(frozen=True, eq=False)
class SeedResult:
    """What one of several runs found: its seed, theta of shape (P,), rms output error [rad]."""

    seed: int
    theta: Array
    rms: float


def runs_table(
    parameters: ParameterSet,
    results: Sequence[SeedResult],
    truth: Mapping[str, float] | None = None,
    ignore: Collection[str] = (),
    what: str = "refined",
) -> Table:
    """Median and spread over seeds of each parameter and of the output error.

    Args:
        parameters: the parameters.
        results: one a seed.
        truth: true values by name; adds the relative error of the median, and the spread of each seed's sum.
        ignore: parameters left out of that sum, having no effect in any run.
        what: which estimate of the runs this is.
    """
    theta = np.array([r.theta for r in results])
    header = ["name", "unit", "median", "lowest", "lower quartile", "upper quartile", "highest"]
    end: tuple[Cell, ...] = (None, None, "") if truth else ("",)
    rows: list[tuple[Cell, ...]] = []
    for i, p in enumerate(parameters.parameters):
        spread = _spread(theta[:, i])
        true = truth.get(p.name) if truth else None
        compared = (Given(true) if true is not None else None, _relative(spread[0], true)) if truth else ()
        rows.append((p.name, p.unit, *spread, *compared, runs_flag(p, theta[:, i], ignore)))
    rows.append(("rms output error", "deg", *_spread(np.degrees([r.rms for r in results])), *end))
    if truth:
        header += ["true", "relative error of the median"]
        sums = np.array([_error_sum(parameters, r.theta, truth, ignore) for r in results])
        rows.append((f"sum of relative errors{_but(ignore)}", "", *_spread(sums), *end))
    header.append("flag")
    seeds = ", ".join(str(r.seed) for r in results)
    return Table(f"{len(results)} runs, {what}", tuple(header), tuple(rows), f"Seeds: {seeds}.")


def _named(parameter: Parameter) -> tuple[Cell, ...]:
    bounded = parameter.lower < parameter.upper
    limits = (Given(parameter.lower), Given(parameter.upper)) if bounded else (None, None)
    return (parameter.name, parameter.unit, *limits)


def _short(estimate: Estimate, fit: Fit) -> str:
    return "search" if estimate is fit.searched else estimate.name


def _indices(indices: ErrorIndices) -> tuple[float, ...]:
    return (degrees(indices.mean_absolute), degrees(indices.rms), degrees(indices.largest), indices.fit)


def _overall(problem: Problem, estimate: Estimate) -> float:
    return float(in_reader_units(problem.settings.objective, np.array(estimate.overall)))


def _relative(value: float, true: float | None) -> float | None:
    return float(relative_error(np.array(value), np.array(true))) if true else None


def _sum_rows(
    parameters: ParameterSet,
    found: Iterable[Array],
    truth: Mapping[str, float],
    without: list[str],
    before: int,
) -> list[tuple[Cell, ...]]:
    """The sum of the article's table 6, and again without parameters that the outputs cannot tell."""
    thetas = list(found)
    rows: list[tuple[Cell, ...]] = []
    for ignore in ([], without) if without else ([],):
        sums = [_error_sum(parameters, theta, truth, ignore) for theta in thetas]
        rows.append((f"sum{_but(ignore)}", *(None,) * (before - 1), *sums, None, None, ""))
    return rows


def _error_sum(
    parameters: ParameterSet, theta: Array, truth: Mapping[str, float], ignore: Collection[str]
) -> float:
    """Sum of relative errors over parameters with a true value other than 0."""
    errors = [
        _relative(value, truth.get(name))
        for name, value in zip(parameters.names, theta, strict=True)
        if name not in ignore
    ]
    return float(sum(e for e in errors if e is not None))


def _but(ignore: Collection[str]) -> str:
    return f" without {', '.join(ignore)}" if ignore else ""


def _spread(values: Array) -> tuple[float, ...]:
    low, q1, median, q3, high = np.quantile(values, [0, 0.25, 0.5, 0.75, 1])
    return float(median), float(low), float(q1), float(q3), float(high)
