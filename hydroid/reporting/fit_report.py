"""The page of a fit, from what its run stores: prediction, what is known and what is not, what to do next."""

import shlex
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import yaml

from hydroid.advice.proposals import action_findings, missing_findings
from hydroid.errors import SettingsError
from hydroid.estimate import FitSummary
from hydroid.findings import Finding
from hydroid.fitting.search import HISTORY
from hydroid.identified_model import IdentifiedModel
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.reporting.actuator_report import actuator_plot, joint_actuator
from hydroid.reporting.objectives import learning, pareto
from hydroid.reporting.page import Light, Page, Plot, Section, Tab, log_names
from hydroid.reporting.parameters_report import parameter_section
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.quantities_report import BEST_WITHIN, best_known, curves_csv, quantity_section
from hydroid.reporting.suggestion_report import MOST_STEPS, suggestion_sections
from hydroid.reporting.table import numbers_csv
from hydroid.reporting.uncertainty_report import determined_sections, unknown_section, warnings
from hydroid.reporting.verdict import verdict
from hydroid.run.record import Record
from hydroid.words import number


def fit_page(record: Record) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings, summary, result = record.settings, record.summary, record.result
    # a validation has the name of the run, a fitted log that of the estimate: here both are the fit
    predictions = [replace(p, fit=str(summary.final)) for p in record.predictions]
    logs = log_names([p.log for p in result.fitted])
    advice = () if result.advice is None else suggestion_sections(settings, result.advice, logs)
    folded = (*advice, *determined_sections(summary, result.noise, logs), _search(record))
    sections = (
        Section("Do next", steps=_steps(record)),
        prediction_section(predictions, settings.arm),
        *quantity_section(settings, summary, [p.log for p in result.fitted]),
        parameter_section(settings, summary),
        unknown_section(summary),
        *_actuators(record),
        *motion(predictions, settings.arm),
        *(replace(section, folded=True) for section in folded),
        Section("Reproduce", facts=tuple(_facts(record)), folded=True),
    )
    ended = {None: ("fair", "Not refined."), True: ("good", "Yes."), False: ("bad", "No.")}[summary.converged]
    judged = verdict({"The fit": predictions}, _known(summary), Light("Converged", *ended))
    title = f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}"
    made_by = {k: str(v) for k, v in record.identity.items() if k in ("hydroid", "mujoco", "numpy", "python")}
    return Page(
        "report", title, judged.prediction, sections, warnings(summary), made_by, _data(record), judged
    )


def fit_lines(summary: FitSummary) -> list[str]:
    """Return what a terminal prints under the table of parameters."""
    error = "diverges" if summary.rms_deg is None else f"has an rms error of {number(summary.rms_deg)} deg"
    first = f"The estimate '{summary.final}' {error} on the fitted logs."
    return [first, *best_known(summary.quantities), *warnings(summary)]


def _known(summary: FitSummary) -> str:
    """Say how many quantities and parameters the logs fix."""
    free = [p for p in summary.estimate.values() if p.data_share is not None]
    known = sum(p.sd is not None and p.sd <= WEAK_ABOVE * abs(p.value) for p in free)
    fixed = sum(q.within <= BEST_WITHIN for q in summary.quantities.values())
    return (
        f"The logs fix {fixed} of the machine's properties, such as speeds and dead bands, and {known} of "
        f"the {len(free)} parameters to {100 * WEAK_ABOVE:.0f} % or better."
    )


def _steps(record: Record) -> tuple[Finding, ...]:
    """Return what to do next, the first things first."""
    settings, run, findings = record.settings, shlex.quote(record.folder), list[Finding]()
    if settings.stage == "mech":
        command = {"command": f"hydroid fit-hyd {record.given} --mech {run}"}
        findings.append(Finding("fit the hydraulics", "note", (), command))
    if not record.validations:
        command = {"command": f"hydroid validate OTHER.csv --fit {run}"}
        findings.append(Finding("predict unseen", "note", (), command))
    if record.result.advice is not None:
        content = record.result.advice.content
        findings += [f for f in missing_findings(content) if "command" in f.numbers]
        findings += action_findings(content, settings)
    return tuple(findings[:MOST_STEPS])


def _actuators(record: Record) -> Iterator[Section]:
    """Yield the curves of each compared joint's actuator, with their bands."""
    settings, summary = record.settings, record.summary
    if settings.stage != "hyd":
        return
    theta = settings.parameter_set().vector(summary.values, record.folder)
    model, tabs = IdentifiedModel(settings, theta, record.folder, summary), list[Tab]()
    for joint in settings.outputs:
        with suppress(SettingsError):  # no force-stroke curve runs through its two points: it diverged
            actuator = joint_actuator(model, joint)
            tabs.append(Tab(actuator.title, (actuator_plot(actuator, f"actuator_joint_{joint}"),)))
    if tabs:
        yield Section("The actuator", tabs=tuple(tabs))


def _search(record: Record) -> Section:
    """How the search went: its learning curve, the Pareto set, and what each refinement took."""
    result, objective = record.result, record.settings.objective
    facts: list[tuple[str, str]] = []
    if len(result.history):
        _, candidates, simulated, diverged = (f"{int(v):,}" for v in result.history[-1, :4])
        tried = f"{candidates} candidates, of which {simulated} were simulated and {diverged} diverged"
        facts.append((record.settings.search.name, tried))
    facts += [
        (one.name, f"{one.iterations} iterations, {one.simulations:,} simulations; {one.ending}")
        for one in result.refinements
    ]
    first = record.summary.final, record.summary.searched
    segments = dict(sorted(result.segments.items(), key=lambda one: (one[0] != first[0], one[0] != first[1])))
    plots = (
        Plot("learning", "Best candidate so far.", partial(learning, result.history, objective)),
        Plot(
            "pareto",
            "The Pareto set: lower fits that segment better.",
            partial(pareto, result.front[1], segments, objective),
        ),
    )
    return Section("How the search went", facts=tuple(facts), plots=plots)


def _facts(record: Record) -> Iterator[tuple[str, str]]:
    """Yield the command, and the settings that are not the defaults."""
    run, settings = record.folder, record.settings
    config, again = shlex.quote(f"{run}/config.yaml"), shlex.quote(f"{run}-again")
    yield "command", f"hydroid fit-{settings.stage} {record.given} --config {config} --out {again}"
    kinds = {"objective", "search", "payloads", "priors"}
    for kind, given in settings.model_dump(mode="json", exclude_defaults=True, include=kinds).items():
        yield (
            kind,
            yaml.safe_dump(given, default_flow_style=True, allow_unicode=True, width=10_000).strip()[1:-1],
        )


def _data(record: Record) -> dict[str, str]:
    """Return the history and the Pareto set with every bit, in the search's units: rad unless relative."""
    result = record.result
    theta, objectives = result.front
    unit = "" if record.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, objectives.shape[1]))
    header = (*record.settings.parameter_set().names, *segments, f"overall{unit}")
    return {
        "history.csv": numbers_csv(HISTORY, result.history),
        "pareto.csv": numbers_csv(header, np.column_stack([theta, objectives])),
        "tables/curves.csv": curves_csv(record.summary.curves),
        **response_data(record.predictions, record.settings.arm),
    }
