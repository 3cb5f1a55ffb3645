"""The report of a fit: prediction and convergence, parameters, what the logs determine, the search."""

from collections.abc import Mapping
from functools import partial
from math import degrees
from typing import Any

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import ErrorIndices, error_indices, pooled_indices
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.by_log_report import by_log_warning
from hydroid.report.estimates import estimates as draw_estimates
from hydroid.report.objectives import learning, pareto
from hydroid.report.page import Page, Plot, Section, log_names
from hydroid.report.phrases import (
    ALGORITHMS,
    STAGES,
    estimate_label,
    estimate_meanings,
    fit_summary,
    fit_warnings,
    in_reader_units,
    norm_label,
    parameter_advice,
    prior_phrase,
    rank_phrase,
    status_phrase,
)
from hydroid.report.quantities_report import curves_csv, quantity_section
from hydroid.report.responses import joint_responses, response_plots
from hydroid.report.suggestion_report import suggestion_sections
from hydroid.report.table import Cell, Given, Table, number, numbers_csv, unless_nan
from hydroid.report.uncertainty_report import determined_section
from hydroid.suggestion.suggest import Suggestions
from hydroid.uncertainty.by_log import by_log

INDICES = ("mean absolute [deg]", "rms [deg]", "largest [deg]", "fit [%]")
INDICES_NOTE = (
    "fit: 100 % for a perfect response, 0 % for a response that is always the mean of the measured angle. A "
    "dash (–): the joint does not move."
)
_ESTIMATES = "Every estimate within its bounds; grey where the parameter is fixed or has no effect."
_LEARNING = "Best candidate so far, and the median of each population."
_PARETO = "Each grey line is one candidate of the Pareto set; the estimates are drawn on top."
_SINGLE = (
    "The search minimises the error over the whole record and does not look for the Pareto set. Shown are "
    "those candidates of its last population to which no other is better in every segment."
)
_SEVERAL = "Among these candidates, a better fit of one segment goes with a worse fit of another."


def fit_page(
    identity: Mapping[str, Any], problem: Problem, fit: Fit, suggested: Suggestions | None = None
) -> Page:
    """Return the page of a fit; `identity` holds the run's versions and log hashes."""
    objective = problem.settings.objective
    responses = joint_responses(problem, fit)
    outputs = len(problem.outputs)
    names = [
        "response" if len(responses) == 1 else f"response_{i // outputs + 1}_joint_{r.joint}"
        for i, r in enumerate(responses)
    ]
    final_errors = [response.mean_squares()[0] for response in responses]
    colors = [color for color, _ in style.estimate_looks(fit).values()]
    drawn, more = response_plots(dict(zip(names, responses, strict=True)), final_errors, colors)
    sections = (
        Section(
            "How well it predicts the fitted logs",
            f"Judge a fit also on a log that it was not fitted on, with hydroid validate.{more}",
            tables={"errors": objective_table(problem, fit)},
            plots=drawn,
        ),
        quantity_section(problem, fit.quantities),
        Section(
            "Parameters",
            rank_phrase(fit.identifiability),
            points=parameter_advice(problem, fit),
            tables={"parameters": parameter_table(problem, fit)},
            plots=(Plot("estimates", _ESTIMATES, partial(draw_estimates, problem, fit)),),
        ),
        determined_section(problem, fit.uncertainty, fit.identifiability),
        *(suggestion_sections(problem, suggested) if suggested is not None else ()),
        Section(
            "How the search went",
            facts=_effort(problem, fit),
            plots=(Plot("learning", _LEARNING, partial(learning, fit, objective)),),
        ),
        Section(
            "Pareto set",
            _SEVERAL if _has_segment_objectives(problem, fit) else _SINGLE,
            plots=(Plot("pareto", _PARETO, partial(pareto, fit, objective)),),
        ),
        Section("What was fitted", facts=_facts(identity, problem)),
    )
    versions = {k: str(identity[k]) for k in ("hydroid", "mujoco", "numpy", "python") if k in identity}
    title = f"Parameters of {problem.settings.arm.name}"
    warnings = (*fit_warnings(problem, fit), *by_log_warning(by_log(problem, fit.uncertainty)))
    data = _data(problem, fit)
    return Page("report", title, fit_summary(fit), sections, warnings, versions, data)


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


def _facts(identity: Mapping[str, Any], problem: Problem) -> tuple[tuple[str, str], ...]:
    settings = problem.settings
    hashes = list(identity.get("logs", {}).values())
    logs: list[tuple[str, str]] = []
    for i, (log, name) in enumerate(zip(problem.logs, log_names(problem.logs), strict=True)):
        seconds, samples = len(log.time) * log.period, len(log.time)
        digest = f", SHA-256 {hashes[i][:12]}…" if i < len(hashes) else ""
        label = "log" if len(problem.logs) == 1 else f"log {i + 1}"
        logs.append((label, f"{name}, {number(seconds)} s, {samples} samples{digest}"))
    return (
        ("arm", f"{settings.arm.name}; its geometry is not estimated but read from arm.yaml"),
        ("stage", STAGES[settings.stage]),
        *logs,
        *((f"payload in {name}", f"{number(mass)} kg") for name, mass in settings.payloads.items()),
        *((f"prior {name}", prior_phrase(prior)) for name, prior in settings.priors.items()),
        ("compared", f"measured angle of joint {', '.join(str(j) for j in settings.outputs)}"),
        ("joints without command and comparison", settings.simulation.other_joints),
        ("objective", f"{norm_label(settings.objective)}, {len(problem.bounds)} segments"),
        ("search", ALGORITHMS.get(settings.search.name, f"{settings.search.name}, of pymoo")),
        ("seed", str(settings.search.seed)),
    )


def _has_segment_objectives(problem: Problem, fit: Fit) -> bool:
    """Say whether the search minimised each segment; of a library's algorithm the estimates tell it."""
    algorithm = problem.settings.search.algorithm
    return "average" in fit.estimates if algorithm == "pymoo" else algorithm == "nsga2"


def _effort(problem: Problem, fit: Fit) -> tuple[tuple[str, str], ...]:
    facts: list[tuple[str, str]] = []
    if len(fit.history):
        multistart = problem.settings.search.algorithm == "multistart"
        rounds, evaluations, simulated, diverged = (int(v) for v in fit.history[-1, :4])
        repeated = "; the others repeat earlier ones" if evaluations > simulated else ""
        ranked = "; they rank behind all others" if diverged else ""
        facts += [
            ("starts", str(rounds))
            if multistart
            else ("populations", f"{rounds}: the first one and {rounds - 1} generations"),
            ("candidates", f"{evaluations:,}, of which {simulated:,} were simulated{repeated}"),
            ("diverged", f"{diverged:,} of {simulated:,} simulated candidates{ranked}"),
        ]
    for name, one in fit.refinements.items():
        effort = f"{one.iterations} iterations, {one.evaluations:,} simulations"
        facts.append((f"least squares: {name}", f"{effort}; {one.ending.value}"))
    return tuple(facts)


def _data(problem: Problem, fit: Fit) -> dict[str, str]:
    """Return the history and the Pareto set with every bit, in the search's units: rad unless relative."""
    counts = len(HISTORY) - 2
    rows = tuple((*(int(v) for v in row[:counts]), *(float(v) for v in row[counts:])) for row in fit.history)
    theta, evaluation = fit.front
    unit = "" if problem.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, evaluation.segments.shape[1] + 1))
    header = (*problem.parameters.names, *segments, f"overall{unit}")
    front = np.column_stack([theta, evaluation.segments, evaluation.overall])
    curves = curves_csv(fit.quantities.curves)
    return {
        "history.csv": Table("", HISTORY, rows).csv(),
        "pareto.csv": numbers_csv(header, front),
        "tables/curves.csv": curves,
    }
