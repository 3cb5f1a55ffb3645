"""The tables of a fit: its parameters, and its errors on the fitted logs."""

from math import degrees

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.fitting.validation import ErrorIndices, error_indices, pooled_indices
from hydroid.problem.problem import Problem
from hydroid.report.phrases import (
    estimate_label,
    estimate_meanings,
    in_reader_units,
    norm_label,
    status_phrase,
)
from hydroid.report.responses import joint_responses
from hydroid.report.table import Cell, Given, Table, unless_nan

INDICES = ("mean absolute [deg]", "rms [deg]", "largest [deg]", "fit [%]")
INDICES_NOTE = (
    "fit: 100 % for a perfect response, 0 % for a response that is always the mean of the measured angle. A "
    "dash (–): the joint does not move."
)


def parameter_table(problem: Problem, fit: Fit) -> Table:
    """Return one row per parameter: bounds, every estimate, interval, share of the data, effect, flag."""
    names = list(fit.estimates)
    labels = [estimate_label(fit, name) for name in names]
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(problem.parameters.parameters):
        bounds = (parameter.lower, parameter.upper) if parameter.lower < parameter.upper else (None, None)
        if given := problem.settings.parameters[parameter.name].bounds:
            bounds = (Given(given[0]), Given(given[1]))
        values = (float(fit.estimates[name].theta[i]) for name in names)
        status = fit.uncertainty.status[i]
        ends = (unless_nan(end) for end in fit.uncertainty.interval[i])
        share = 100 * status.share if fit.uncertainty.free[i] else None
        judged = *ends, share, unless_nan(degrees(fit.effects[i]))
        phrase = status_phrase(status)
        rows.append((parameter.name, parameter.unit, *bounds, *values, *judged, phrase))
    header = ("name", "unit", "lower", "upper", *labels, "from", "to", "data [%]", "effect [deg]", "flag")
    final = estimate_label(fit, fit.final)
    others = [label for label in labels[1:] if label != final]
    optional = (
        *others,
        "effect [deg]",
        "data [%]",
        *(labels[:1] if labels[0] != final else ()),
        "lower",
        "upper",
    )
    note = (
        f"{estimate_meanings(fit)} from, to: 95 % interval of {final}. "
        "The noise is taken from the residuals. The interval is only right if the model is right. A dash "
        "(–): it has no limit, or the parameter is at a bound or fixed. data: part of the information on the "
        "parameter that the logs gave; its prior gave the rest. effect: rms change of the output when the "
        "parameter changes by 1 %."
    )
    return Table("Parameters", header, tuple(rows), note, optional)


def objective_table(problem: Problem, fit: Fit) -> Table:
    """Return the output error of each estimate on the fitted logs, and the norm that the search minimised."""
    responses = joint_responses(problem, fit)
    several = len(responses) > 1
    objective = problem.settings.objective
    rows: list[tuple[Cell, ...]] = []
    for name, estimate in fit.estimates.items():
        label = estimate_label(fit, name)
        overall = float(in_reader_units(objective, np.array(estimate.overall)))
        pairs = [(response.measured, response.simulated[label]) for response in responses]
        for response, pair in zip(responses, pairs, strict=True):
            indices = index_cells(error_indices(*pair))
            rows.append((label, response.log, response.joint, *indices, None if several else overall))
        if several:
            rows.append((label, "all", None, *index_cells(pooled_indices(pairs)), overall))
    pooled = " all: every joint about its own mean." if several else ""
    note = f"{INDICES_NOTE}{pooled} objective: {norm_label(objective)} over the whole record."
    column = "objective [-]" if objective.relative else "objective [deg]"
    header = ("estimate", "log", "joint", *INDICES, column)
    return Table("Output error on the fitted logs", header, tuple(rows), note, (INDICES[0], column))


def index_cells(indices: ErrorIndices) -> tuple[float, ...]:
    """Return the cells of INDICES."""
    return (degrees(indices.mean_absolute), degrees(indices.rms), degrees(indices.largest), indices.fit)
