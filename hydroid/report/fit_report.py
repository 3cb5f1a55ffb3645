"""The report of a fit: prediction and convergence, parameters, what the logs determine, the search."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import degrees
from typing import Any

import numpy as np

from hydroid.advice.suggest import Suggestions
from hydroid.errors import SettingsError
from hydroid.estimate import finite
from hydroid.fitting.findings import fit_findings
from hydroid.fitting.fit import Fit
from hydroid.fitting.search import HISTORY
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report.actuator_report import KnownActuator, actuator_plot, joint_actuator, joint_records
from hydroid.report.fit_tables import objective_table, parameter_table
from hydroid.report.moving_arm import Movement, motion_section
from hydroid.report.names import plain_name
from hydroid.report.next_steps import fit_steps
from hydroid.report.objectives import learning, pareto
from hydroid.report.page import Page, Plot, Section, Step, Tab, log_names
from hydroid.report.parameter_bars import fit_bars
from hydroid.report.phrases import (
    ALGORITHMS,
    STAGES,
    direction_phrases,
    fit_summary,
    norm_label,
    parameter_advice,
    prior_phrase,
    rank_phrase,
)
from hydroid.report.quantities_report import curves_csv, lost_quantities, quantity_section
from hydroid.report.responses import joint_responses, response_data, response_tabs
from hydroid.report.suggestion_report import action_effect, action_name, suggestion_sections
from hydroid.report.table import Table, numbers_csv
from hydroid.report.uncertainty_report import determined_sections
from hydroid.report.verdict import fit_verdict
from hydroid.words import number, sentence

FITTED = "Prediction of the fitted logs"
"""title of a section"""
_FILES = (
    "config.yaml, arm.yaml and model/ (what was asked, and the fitted arm), estimate.yaml, tables/, "
    "responses/ (every series in full), history.csv, pareto.csv, run.json (hashes), run.log"
)
_SAME = {
    "mech": "with the same versions. This config.yaml holds all settings, and the seed.",
    "hyd": "with the same versions. This config.yaml holds all settings, the seed, and the values of stage 1 "
    "if it used any: the command needs no --mech.",
}
_CITATION = (
    "A. Montazeri, C. West, S. Monk and C. J. Taylor, Dynamic modelling and parameter estimation of a "
    "hydraulic robot manipulator using a multi-objective genetic algorithm, 2017. To cite hydroid: "
    "CITATION.cff."
)
_MOST_DIRECTIONS = 6
_LEARNING = "Best candidate so far, and the median of each population."
_PARETO = "Each grey line is one candidate of the Pareto set; the estimates are drawn on top."
_SINGLE = (
    "The search minimises the error over the whole record and does not look for the Pareto set. Shown are "
    "those candidates of its last population to which no other is better in every segment."
)
_SEVERAL = "Among these candidates, a better fit of one segment goes with a worse fit of another."


def fit_page(
    identity: Mapping[str, Any],
    problem: Problem,
    fit: Fit,
    suggested: Suggestions | None = None,
    run: str = "RUN",
) -> Page:
    """Return the page of a fit; `identity` holds the run's versions and log hashes, `run` is its folder."""
    found = joint_responses(problem, fit)
    outputs = len(problem.outputs)
    names = [
        "response" if len(found) == 1 else f"response_{i // outputs + 1}_joint_{r.joint}"
        for i, r in enumerate(found)
    ]
    responses = dict(zip(names, found, strict=True))
    last = problem.varied(problem.settings.freed()) if fit.final == "joint" else problem
    sections = (
        fit_steps(problem, fit, suggested, run),
        Section(
            FITTED,
            tabs=response_tabs(responses),
            more={"errors": objective_table(problem, fit)},
        ),
        *_known(last, fit),
        _unknown(last, fit, suggested),
        *_actuators(last, fit),
        *motion_section(problem.settings.arm, _movements(problem, fit)),
        *_folded(last, fit, suggested, run),
        Section("Reproduce", facts=_facts(identity, problem, run)),
    )
    versions = {k: str(identity[k]) for k in ("hydroid", "mujoco", "numpy", "python") if k in identity}
    title = f"Fit of {problem.settings.arm.name}, stage {STAGES[problem.settings.stage][:1]}"
    return Page(
        "report",
        title,
        fit_summary(fit),
        sections,
        tuple(sentence(finding) for finding in fit_findings(last, fit)),
        versions,
        _data(problem, fit) | response_data(responses),
        fit_verdict(last, fit),
        fit_numbers(last, fit),
    )


def fit_numbers(problem: Problem, fit: Fit) -> dict[str, Any]:
    """Return what a comparison of pages needs: each parameter with unit, value, interval and bounds."""
    known = fit.uncertainty
    columns = problem.parameters.parameters, fit.best.theta.tolist(), known.interval.tolist()
    parameters = {
        p.name: {
            "unit": p.unit,
            "value": value,
            "interval": [finite(end) for end in ends],
            "bounds": [p.lower, p.upper],
            "log": p.log,
            "meaning": plain_name(problem.settings.parameters[p.name]),
        }
        for p, value, ends in zip(*columns, strict=True)
        if p.lower < p.upper and p.fixed is None
    }
    return {"kind": "fit", "rms_deg": finite(degrees(fit.best.rms)), "parameters": parameters}


def _known(problem: Problem, fit: Fit) -> tuple[Section, ...]:
    """What follows from all parameters together, and each parameter between its bounds."""
    words = (
        "Bar: from the lower to the upper bound. Orange line: the estimate, with its 95 % interval. Grey: "
        "the interval of its prior. Blue dots: other estimates of the search. The intervals are only right "
        "if the model is right."
    )
    return (
        quantity_section(problem, fit.quantities),
        Section(
            "Parameters",
            " ".join(filter(None, (rank_phrase(fit.identifiability), _given_supply(problem), words))),
            bars=fit_bars(problem, fit),
            more={"parameters": parameter_table(problem, fit)},
        ),
    )


def _given_supply(problem: Problem) -> str:
    """Say what rests on a supply pressure that is given: without pressures in the log only p A is known."""
    free = {p.quantity for p in problem.settings.parameters.values() if p.fixed is None}
    compared = problem.settings.objective.pressure_weight > 0
    if problem.settings.stage != "hyd" or "supply_pressure" in free or compared:
        return ""
    supply = number(problem.settings.hydraulics.supply_pressure)
    return (
        f"Areas, masses, torques and flows hold for a supply of {supply} bar, which is given; speeds, dead "
        "bands and times do not depend on it."
    )


def _unknown(problem: Problem, fit: Fit, suggested: Suggestions | None) -> Section:
    """What the logs leave open, and the actions that would settle it."""
    points = (
        *parameter_advice(problem, fit),
        *_few_directions(direction_phrases(problem, fit.identifiability)),
        *lost_quantities(fit.quantities),
    )
    steps: tuple[Step, ...] = ()
    if points and suggested is not None:
        steps = tuple(Step(f"{action_name(problem, a)}.", f"{action_effect(a)}.") for a in suggested.actions)
    text = "" if points else "Nothing: the logs determine every free parameter."
    more = " What would settle it stands below, the best first." if steps else ""
    return Section("What is not known", f"{text}{more}".strip(), points, steps=steps)


def _few_directions(phrases: Sequence[str]) -> tuple[str, ...]:
    """Return the first sentences on unidentifiable directions, and where the others stand."""
    more = len(phrases) - _MOST_DIRECTIONS
    shown = tuple(f"{phrase}." for phrase in (phrases if more <= 1 else phrases[:_MOST_DIRECTIONS]))
    return shown if more <= 1 else (*shown, f"{more} more combinations: see Directions, below.")


def _actuators(problem: Problem, fit: Fit) -> tuple[Section, ...]:
    """The curves of each compared joint's actuator, with their bands."""
    if problem.settings.stage != "hyd":
        return ()
    stage, arm = problem.stage, problem.settings.arm
    candidate = stage.candidates(fit.best.theta[None])
    tabs: list[Tab] = []
    for joint in problem.settings.outputs:
        try:
            actuator = joint_actuator(arm, candidate, joint, "the estimate")
        except SettingsError:
            continue  # no force-stroke curve runs through its two points: it diverged
        records = partial(_records, problem, joint)
        known = KnownActuator(fit.quantities.precision, records)
        plot = replace(actuator_plot(replace(actuator, known=known)), name=f"actuator_joint_{joint}")
        tabs.append(Tab(actuator.title, (plot,)))
    text = "What its parameters mean in steady state, from the command to the torque at the joint."
    return (Section("The actuator", text, tabs=tuple(tabs)),) if tabs else ()


def _movements(problem: Problem, fit: Fit) -> list[Movement]:
    """How the arm moves in each log, measured and simulated with the final estimate."""
    joints = problem.settings.outputs
    logs = zip(log_names(problem.logs), problem.logs, fit.best.responses, strict=True)
    return [Movement.of(name, log, joints, response) for name, log, response in logs]


def _records(problem: Problem, joint: int, theta: Array) -> Any:
    return joint_records(problem.settings.arm, problem.stage.candidates(theta), joint)


def _folded(problem: Problem, fit: Fit, suggested: Suggestions | None, run: str) -> tuple[Section, ...]:
    objective = problem.settings.objective
    lacks, residual, actions = (
        suggestion_sections(problem, suggested, run) if suggested is not None else (None, None, None)
    )
    text = _SEVERAL if _has_segment_objectives(problem, fit) else _SINGLE
    hidden = (
        lacks,
        actions,
        *determined_sections(problem, fit.uncertainty, fit.identifiability),
        Section(
            "How the search went",
            facts=_effort(problem, fit),
            plots=(Plot("learning", _LEARNING, partial(learning, fit, objective)),),
        ),
        Section("Pareto set", text, plots=(Plot("pareto", _PARETO, partial(pareto, fit, objective)),)),
    )
    folded = tuple(replace(section, folded=True) for section in hidden if section is not None)
    if residual is None:
        return folded
    return (residual, *folded)


def _facts(identity: Mapping[str, Any], problem: Problem, run: str) -> tuple[tuple[str, str], ...]:
    settings = problem.settings
    hashes = list(identity.get("logs", {}).values())
    logs: list[tuple[str, str]] = []
    for i, (log, name) in enumerate(zip(problem.logs, log_names(problem.logs), strict=True)):
        seconds, samples = len(log.time) * log.period, len(log.time)
        digest = f", SHA-256 {hashes[i][:12]}…" if i < len(hashes) else ""
        label = "log" if len(problem.logs) == 1 else f"log {i + 1}"
        logs.append((label, f"{name}, {number(seconds)} s, {samples} samples{digest}"))
    given = " ".join(shlex.quote(log.source) for log in problem.logs)
    config, again = shlex.quote(f"{run}/config.yaml"), shlex.quote(f"{run}-again")
    return (
        ("command", f"hydroid fit-{settings.stage} {given} --config {config} --out {again}"),
        ("same bits", _SAME[settings.stage]),
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
        ("files", _FILES),
        ("method", _CITATION),
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
