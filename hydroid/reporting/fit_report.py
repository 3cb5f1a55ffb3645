"""The page of a fit, from what its run stores: prediction, what is known and what is not, what to do next."""

import shlex
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import sqrt

import numpy as np

from hydroid.advice.proposals import action_findings, missing_findings
from hydroid.errors import SettingsError
from hydroid.estimate import FitSummary
from hydroid.findings import Finding
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import Prediction
from hydroid.identified_model import IdentifiedModel
from hydroid.parameters import Array
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.posterior import stored_posterior
from hydroid.problem.bindings import Bindings
from hydroid.reporting.actuator_report import KnownActuator, actuator_plot, joint_actuator, joint_records
from hydroid.reporting.objectives import learning, pareto
from hydroid.reporting.page import Light, Page, Plot, Section, Step, Tab, Verdict, log_names
from hydroid.reporting.parameters_report import parameter_section
from hydroid.reporting.phrases import ALGORITHMS, norm_label, prior_phrase
from hydroid.reporting.predictions import motion, prediction_section, response_data
from hydroid.reporting.quantities_report import BEST_WITHIN, best_known, curves_csv, quantity_section
from hydroid.reporting.suggestion_report import MOST_STEPS, step, suggestion_sections
from hydroid.reporting.table import Table, numbers_csv
from hydroid.reporting.uncertainty_report import determined_sections
from hydroid.run.record import Record
from hydroid.words import number, sentence

_FILES = (
    "config.yaml, arm.yaml and model/ (the fitted arm), estimate.yaml, result.npz, tables/, responses/ (all "
    "series in full), history.csv, pareto.csv, run.json (hashes), run.log"
)


def fit_page(record: Record) -> Page:
    """Return the page of a fit, with the unseen logs that it was validated on."""
    settings, summary, result = record.settings, record.summary, record.result
    folded = (*(advice_sections(record)), *determined_sections(summary, result.noise, _names(record)))
    search = (_search(record), _front(record))
    sections = (
        Section("Do next", steps=steps(record)),
        prediction_section(record.predictions, settings.arm),
        *quantity_section(settings, summary, [p.log for p in result.fitted]),
        parameter_section(settings, summary, {}),
        _unknown(summary),
        *_actuators(record),
        *motion(record.predictions, settings.arm),
        *(replace(section, folded=True) for section in (*folded, *search)),
        Section("Reproduce", facts=_facts(record), folded=True),
    )
    verdict = fit_verdict(record)
    versions = {
        k: str(v) for k, v in record.identity.items() if k in ("hydroid", "mujoco", "numpy", "python")
    }
    title = f"Fit of {settings.arm.name}, stage {2 if settings.stage == 'hyd' else 1}"
    return Page(
        "report",
        title,
        verdict.prediction,
        sections,
        fit_warnings(summary),
        versions,
        _data(record),
        verdict,
    )


def fit_verdict(record: Record) -> Verdict:
    """Return the error on unseen and on fitted logs, what the logs fix, and two lights."""
    summary, unseen = record.summary, list(record.validations.values())
    count = len(record.result.fitted)
    logs = "the fitted log" if count == 1 else f"the {count} fitted logs"
    own = (
        "diverges on"
        if summary.rms_deg is None
        else f"reproduces {logs} with an error of {summary.rms_deg:.2g}° rms"
    )
    prediction = f"The fit {own}."
    if unseen:
        rms = sqrt(sum(p.rms_deg**2 for p in unseen) / len(unseen))
        which = "an unseen log" if len(unseen) == 1 else f"{len(unseen)} unseen logs"
        prediction = f"The fit predicts {which} with an error of {rms:.2g}° rms and {own}."
    return Verdict(
        prediction, known_phrase(summary), (_converged(summary), _validated(unseen, record.folder))
    )


def known_phrase(summary: FitSummary) -> str:
    """Say how many quantities and parameters the logs fix."""
    free = [p for p in summary.estimate.values() if p.data_share is not None]
    known = sum(p.sd is not None and p.sd <= WEAK_ABOVE * abs(p.value) for p in free)
    parameters = f"Of the {len(free)} parameters they fix {known} to {100 * WEAK_ABOVE:.0f} %."
    fixed = sum(q.within <= BEST_WITHIN for q in summary.quantities.values())
    if not fixed:
        return parameters.replace("they fix", "the logs fix")
    return f"The logs fix {fixed} of the machine's properties, such as speeds and dead bands. {parameters}"


def fit_warnings(summary: FitSummary) -> tuple[str, ...]:
    """Return what must be read before any use of the estimate."""
    return tuple(sentence(f) for f in summary.findings if f.level != "note")


def fit_lines(summary: FitSummary) -> list[str]:
    """Return what a terminal prints under the table of parameters."""
    error = "diverges" if summary.rms_deg is None else f"has an rms error of {number(summary.rms_deg)} deg"
    first = f"The estimate '{summary.final}' {error} on the fitted logs."
    return [first, *best_known(summary.quantities), *fit_warnings(summary)]


def steps(record: Record) -> tuple[Step, ...]:
    """Return what to do next, the first things first."""
    settings, run = record.settings, shlex.quote(record.folder)
    findings: list[Finding] = []
    if settings.stage == "mech":
        command = f"hydroid fit-hyd {record.given} --mech {run}"
        findings.append(Finding("fit the hydraulics", "note", (), {"command": command}))
    if not record.validations:
        command = f"hydroid validate OTHER.csv --fit {run}"
        findings.append(Finding("predict unseen", "note", (), {"command": command}))
    if record.result.advice is not None:
        content = record.result.advice.content
        missing = [f for f in missing_findings(content) if "command" in f.numbers]
        findings += [*missing, *action_findings(content, settings)]
    return tuple(step(finding) for finding in findings[:MOST_STEPS])


def advice_sections(record: Record) -> tuple[Section, ...]:
    """Return what the model lacks, what the residual shows and what actions would bring."""
    advice = record.result.advice
    if advice is None:
        return ()
    return suggestion_sections(record.settings, advice, _names(record))


def _names(record: Record) -> list[str]:
    return log_names([p.log for p in record.result.fitted])


def _converged(summary: FitSummary) -> Light:
    if summary.converged is None:
        return Light("Converged", "fair", "Not refined.")
    return Light("Converged", "good", "Yes.") if summary.converged else Light("Converged", "bad", "No.")


def _validated(unseen: Sequence[Prediction], folder: str) -> Light:
    question = "Validated on unseen logs"
    if not unseen:
        return Light(question, "open", "Not tested.")
    worse = sum(p.as_expected is False for p in unseen)
    if worse:
        answer = f"The error is clearly larger than expected on {worse} of {len(unseen)}."
        return Light(question, "fair", answer)
    return Light(question, "good", "The errors are as expected.")


def _unknown(summary: FitSummary) -> Section:
    points = tuple(sentence(f) for f in summary.findings if f.level == "note")
    return Section("What is not known", "" if points else "The logs determine every free parameter.", points)


def _actuators(record: Record) -> tuple[Section, ...]:
    """The curves of each compared joint's actuator, with their bands."""
    settings, summary = record.settings, record.summary
    if settings.stage != "hyd":
        return ()
    bindings, arm = Bindings(settings), settings.arm
    theta = settings.parameter_set().vector(summary.values, record.folder)
    known = stored_posterior(IdentifiedModel(settings, theta, record.folder, summary))
    tabs: list[Tab] = []
    for joint in settings.outputs:
        try:
            actuator = joint_actuator(arm, bindings.candidates(theta[None]), joint, "the estimate")
        except SettingsError:
            continue  # no force-stroke curve runs through its two points: it diverged
        if known is not None:

            def records(values: Array, joint: int = joint) -> object:
                return joint_records(arm, bindings.candidates(values), joint)

            actuator = replace(actuator, known=KnownActuator(known, records))
        plot = replace(actuator_plot(actuator), name=f"actuator_joint_{joint}")
        tabs.append(Tab(actuator.title, (plot,)))
    return (Section("The actuator", tabs=tuple(tabs)),) if tabs else ()


def _search(record: Record) -> Section:
    result, objective = record.result, record.settings.objective
    facts: list[tuple[str, str]] = []
    if len(result.history):
        rounds, evaluations, simulated, diverged = (int(v) for v in result.history[-1, :4])
        facts = [
            ("starts" if record.settings.search.algorithm == "multistart" else "populations", str(rounds)),
            (
                "candidates",
                f"{evaluations:,}, of which {simulated:,} were simulated and {diverged:,} diverged",
            ),
        ]
    for one in result.refinements:
        effort = f"{one.iterations} iterations, {one.simulations:,} simulations; {one.ending}"
        facts.append((f"least squares: {one.name}", effort))
    caption = "Best candidate so far, and the median of each population."
    plot = Plot("learning", caption, partial(learning, result.history, objective))
    return Section("How the search went", facts=tuple(facts), plots=(plot,))


def _front(record: Record) -> Section:
    result, final = record.result, record.summary.final
    order = sorted(result.segments, key=lambda name: (name != final, name != record.summary.searched))
    segments = {name: result.segments[name] for name in order}
    draw = partial(pareto, result.front[1], segments, record.settings.objective)
    caption = "Each grey line is one candidate of the Pareto set. A lower line fits that segment better."
    return Section("Pareto set", plots=(Plot("pareto", caption, draw),))


def _facts(record: Record) -> tuple[tuple[str, str], ...]:
    settings, run = record.settings, record.folder
    config, again = shlex.quote(f"{run}/config.yaml"), shlex.quote(f"{run}-again")
    hashes = record.identity["logs"]
    logs = [
        (name, f"{number(len(p.log.time) * p.log.period)} s, SHA-256 {hashes[p.log.source][:12]}…")
        for p, name in zip(record.result.fitted, _names(record), strict=True)
    ]
    search, segments = settings.search, record.result.front[1].shape[1] - 1
    return (
        ("command", f"hydroid fit-{settings.stage} {record.given} --config {config} --out {again}"),
        *logs,
        *((f"payload in {name}", f"{number(mass)} kg") for name, mass in settings.payloads.items()),
        *((f"prior {name}", prior_phrase(prior)) for name, prior in settings.priors.items()),
        ("objective", f"{norm_label(settings.objective)}, {segments} segments"),
        ("search", f"{ALGORITHMS.get(search.name, search.name)}, seed {search.seed}"),
        ("files", _FILES),
    )


def _data(record: Record) -> dict[str, str]:
    """Return the history and the Pareto set with every bit, in the search's units: rad unless relative."""
    result, counts = record.result, len(HISTORY) - 2
    rows = tuple(
        (*(int(v) for v in row[:counts]), *(float(v) for v in row[counts:])) for row in result.history
    )
    theta, objectives = result.front
    unit = "" if record.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, objectives.shape[1]))
    header = (*record.settings.parameter_set().names, *segments, f"overall{unit}")
    return {
        "history.csv": Table("", HISTORY, rows).csv(),
        "pareto.csv": numbers_csv(header, np.column_stack([theta, objectives])),
        "tables/curves.csv": curves_csv(record.summary.curves),
        **response_data(record.predictions, record.settings.arm),
    }
