"""The report of a fit: prediction and convergence, parameters, what the logs determine, the search."""

from collections.abc import Mapping
from functools import partial
from math import degrees
from typing import Any

import numpy as np

from hydroid.fitting.fit import Estimate, Fit
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import ErrorIndices, error_indices, pooled_indices
from hydroid.problem.problem import Problem
from hydroid.report.joint_record import joint_records
from hydroid.report.page import Page, Plot, Section
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
from hydroid.report.plots.estimates import estimates as draw_estimates
from hydroid.report.plots.objectives import learning as draw_learning
from hydroid.report.plots.objectives import pareto as draw_pareto
from hydroid.report.plots.responses import fit_response
from hydroid.report.table import Cell, Given, Table, number, unless_nan
from hydroid.report.uncertainty_report import determined_section

MOST_RESPONSES = 12
"""responses drawn at most, those with the largest errors"""
INDICES = ("mean absolute [deg]", "rms [deg]", "largest [deg]", "fit [%]")
INDICES_NOTE = (
    "fit: 100 % for a perfect response, 0 % for the mean of the measured angle, – for a joint at rest."
)
_SINGLE = (
    "The search minimises the error over the whole record and does not look for the Pareto set. Shown are "
    "the candidates of its last population that no other beats in every segment."
)
_SEVERAL = "No candidate beats one of these in every segment: a better fit of one segment costs another."


def fit_page(identity: Mapping[str, Any], problem: Problem, fit: Fit) -> Page:
    """Return the page of a fit.

    Args:
        identity: the run's versions, seed and log hashes.
        problem: the problem.
        fit: the fit.
    """
    objective, arm = problem.settings.objective, problem.settings.arm.name
    responses, more = _responses(problem, fit)
    determined = determined_section(problem, fit.uncertainty, fit.identifiability)
    estimates = "Every estimate within its bounds; grey where the parameter is fixed or has no effect."
    learning = "Best candidate so far, and the median of each population."
    pareto = "Each grey line is one candidate of the Pareto set; the estimates are drawn on top."
    sections = (
        Section(
            "How well it predicts the fitted logs",
            f"Judge a fit also on a log that it was not fitted on, with hydroid validate.{more}",
            tables={"errors": objective_table(problem, fit)},
            plots=responses,
        ),
        Section(
            "Parameters",
            rank_phrase(fit.identifiability),
            points=parameter_advice(problem, fit),
            tables={"parameters": parameter_table(problem, fit)},
            plots=(Plot("estimates", estimates, partial(draw_estimates, problem, fit)),),
        ),
        determined,
        Section(
            "How the search went",
            facts=_effort(fit),
            plots=(Plot("learning", learning, partial(draw_learning, fit, objective)),),
        ),
        Section(
            "Pareto set",
            _SEVERAL if _has_segment_objectives(problem, fit) else _SINGLE,
            plots=(Plot("pareto", pareto, partial(draw_pareto, fit, objective)),),
        ),
        Section("What was fitted", facts=_facts(identity, problem)),
    )
    data = {
        "tables/pareto.csv": pareto_table(problem, fit).csv(),
        "history.csv": _history(fit),
        "pareto.csv": _pareto(problem, fit),
    }
    known = {k: str(identity[k]) for k in ("hydroid", "mujoco", "numpy", "python") if k in identity}
    title = f"Parameters of {arm}"
    return Page("report", title, fit_summary(fit), sections, fit_warnings(problem, fit), known, data)


def parameter_table(problem: Problem, fit: Fit) -> Table:
    """Return one row per parameter: bounds, every estimate, interval, effect, flag."""
    names = list(fit.estimates)
    labels = [estimate_label(fit, name) for name in names]
    half = np.diff(fit.uncertainty.interval, axis=1)[:, 0] / 2
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(problem.parameters.parameters):
        bounded = parameter.lower < parameter.upper
        bounds = (Given(parameter.lower), Given(parameter.upper)) if bounded else (None, None)
        values = (float(fit.estimates[name].theta[i]) for name in names)
        judged = unless_nan(half[i]), unless_nan(degrees(fit.effects[i]))
        phrase = status_phrase(fit.uncertainty.status[i])
        rows.append((parameter.name, parameter.unit, *bounds, *values, *judged, phrase))
    header = ("name", "unit", "lower", "upper", *labels, "±", "effect [deg]", "flag")
    final = estimate_label(fit, fit.final)
    others = [label for label in labels[1:] if label != final]
    optional = (*others, "effect [deg]", *(labels[:1] if labels[0] != final else ()), "lower", "upper")
    note = (
        f"{estimate_meanings(fit)} ±: half of the 95 % interval of {final}, for noise as the logs show it"
        ", as far as the model holds; – if it is not identifiable. effect: rms change of the output for "
        "1 % of the value."
    )
    return Table("Parameters", header, tuple(rows), note, optional)


def objective_table(problem: Problem, fit: Fit) -> Table:
    """Return the output error of each estimate on the fitted logs, and the norm that the search minimised."""
    records = joint_records(problem)
    several = len(records) > 1
    objective = problem.settings.objective
    rows: list[tuple[Cell, ...]] = []
    for name, estimate in fit.estimates.items():
        label, overall = estimate_label(fit, name), _overall(problem, estimate)
        pairs = [(record.measured, record.simulated(estimate.responses)) for record in records]
        for record, pair in zip(records, pairs, strict=True):
            indices = index_cells(error_indices(*pair))
            rows.append((label, record.log, record.joint, *indices, None if several else overall))
        if several:
            rows.append((label, "all", None, *index_cells(pooled_indices(pairs)), overall))
    pooled = " all: every joint about its own mean." if several else ""
    note = f"{INDICES_NOTE}{pooled} objective: {norm_label(objective)} over the whole record."
    column = "objective [-]" if objective.relative else "objective [deg]"
    header = ("estimate", "log", "joint", *INDICES, column)
    return Table("Output error on the fitted logs", header, tuple(rows), note, (INDICES[0], column))


def pareto_table(problem: Problem, fit: Fit) -> Table:
    """Return the non-dominated candidates of the last population, best overall first."""
    theta, evaluation = fit.front
    objective = problem.settings.objective
    segments, overall = (in_reader_units(objective, a) for a in (evaluation.segments, evaluation.overall))
    header = [f"{p.name} [{p.unit}]" for p in problem.parameters.parameters]
    header += [f"segment {s}" for s in range(1, segments.shape[1] + 1)]
    rows = tuple(
        tuple(map(float, (*theta[i], *segments[i], overall[i]))) for i in np.argsort(overall, kind="stable")
    )
    return Table("Pareto set", (*header, "whole record"), rows, f"Objectives: {norm_label(objective)}.")


def index_cells(indices: ErrorIndices) -> tuple[float, ...]:
    """Return the cells of INDICES."""
    return (degrees(indices.mean_absolute), degrees(indices.rms), degrees(indices.largest), indices.fit)


def _responses(problem: Problem, fit: Fit) -> tuple[tuple[Plot, ...], str]:
    """Return plots of the records with the largest errors, and a sentence about those not drawn."""
    records = joint_records(problem)
    errors = [np.mean((r.measured - r.simulated(fit.best.responses)) ** 2) for r in records]
    worst = sorted(np.argsort(np.nan_to_num(errors, nan=np.inf))[::-1][:MOST_RESPONSES])
    caption = (
        "Top: measured and simulated angle, segments numbered. Middle: their difference. Bottom: command."
    )
    plots: list[Plot] = []
    for record in (records[i] for i in worst):
        name = "response" if len(records) == 1 else f"response_{record.index[0] + 1}_joint_{record.joint}"
        plots.append(Plot(name, caption, partial(fit_response, fit, record)))
    left_out = len(records) - len(plots)
    noun = "response is" if left_out == 1 else "responses are"
    return tuple(
        plots
    ), f" {left_out} further {noun} not drawn; the table has all errors." if left_out else ""


def _facts(identity: Mapping[str, Any], problem: Problem) -> tuple[tuple[str, str], ...]:
    settings = problem.settings
    hashes = list(identity.get("logs", {}).values())
    logs: list[tuple[str, str]] = []
    for record in joint_records(problem):
        i, k = record.index
        if k == 0:
            seconds, samples = len(record.time) * problem.logs[i].period, len(record.time)
            digest = f", SHA-256 {hashes[i][:12]}…" if i < len(hashes) else ""
            label = "log" if len(problem.logs) == 1 else f"log {i + 1}"
            logs.append((label, f"{record.log}, {number(seconds)} s, {samples} samples{digest}"))
    return (
        ("arm", f"{settings.arm.name}; its geometry is taken as configured in arm.yaml"),
        ("stage", STAGES[settings.stage]),
        *logs,
        *((f"payload in {name}", f"{number(mass)} kg") for name, mass in settings.payloads.items()),
        *((f"prior {name}", prior_phrase(prior)) for name, prior in settings.priors.items()),
        ("compared", f"measured angle of joint {', '.join(str(j) for j in settings.outputs)}"),
        ("other joints", settings.simulation.other_joints),
        ("objective", f"{norm_label(settings.objective)}, {len(problem.bounds)} segments"),
        ("search", ALGORITHMS.get(settings.search.name, f"{settings.search.name}, of pymoo")),
        ("seed", str(settings.search.seed)),
    )


def _has_segment_objectives(problem: Problem, fit: Fit) -> bool:
    """Say whether the search minimised each segment; of a library's algorithm the estimates tell it."""
    algorithm = problem.settings.search.algorithm
    return "average" in fit.estimates if algorithm == "pymoo" else algorithm == "nsga2"


def _effort(fit: Fit) -> tuple[tuple[str, str], ...]:
    facts: list[tuple[str, str]] = []
    if len(fit.history):
        generations, evaluations, simulated, diverged = (int(v) for v in fit.history[-1, :4])
        facts += [
            ("generations", f"{generations}"),
            ("candidates", f"{evaluations:,} evaluated, {simulated:,} of them simulated"),
            ("diverged", f"{diverged:,} of {simulated:,} simulated candidates; ranked behind all others"),
        ]
    for name, one in fit.refinements.items():
        effort = f"{one.iterations} iterations, {one.evaluations:,} simulations"
        facts.append((f"refinement to {name}", f"{effort}; {one.ending.value}"))
    return tuple(facts)


def _overall(problem: Problem, estimate: Estimate) -> float:
    return float(in_reader_units(problem.settings.objective, np.array(estimate.overall)))


def _history(fit: Fit) -> str:
    """Return the history with every bit, in the search's units: rad unless relative."""
    counts = len(HISTORY) - 2
    rows = tuple((*(int(v) for v in row[:counts]), *(float(v) for v in row[counts:])) for row in fit.history)
    return Table("", HISTORY, rows).csv()


def _pareto(problem: Problem, fit: Fit) -> str:
    """Return the Pareto set with every bit, in the search's units."""
    theta, evaluation = fit.front
    unit = "" if problem.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, evaluation.segments.shape[1] + 1))
    header = (*problem.parameters.names, *segments, f"overall{unit}")
    rows = np.column_stack([theta, evaluation.segments, evaluation.overall])
    return Table("", header, tuple(tuple(map(float, row)) for row in rows)).csv()
