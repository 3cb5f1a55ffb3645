"""Suggestions: what the model lacks, what the residual shows, what actions would bring."""

from collections.abc import Mapping, Sequence
from typing import Any

from hydroid.advice.missing import LEVEL, MIN_GAIN
from hydroid.advice.proposals import Advice, action_findings, missing_findings, residual_findings
from hydroid.findings import Finding
from hydroid.reporting.page import Page, Section, Step, Verdict
from hydroid.reporting.residual_chart import residual_tabs
from hydroid.reporting.table import Cell, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import hint, sentence, statement

_VERDICTS = {
    "free": "free it",
    "untried": "others first",
    "leave": "leave it: no gain",
    "invisible": "the logs cannot tell it from the free parameters",
}
MOST_STEPS = 3
"""steps that a page names first"""

Content = Mapping[str, Any]


def suggestion_page(settings: FitSettings, advice: Advice, logs: Sequence[str], source: str) -> Page:
    """Return the page of all suggestions; its tables are `missing_terms`, `next_actions` and `residuals`.

    `logs` are their names, and `source` names the estimate.
    """
    findings = [*missing_findings(advice.content), *action_findings(advice.content, settings)]
    lead = statement(findings[0])
    idle = "nothing missing", "more terms missing"
    steps = tuple(step(finding) for finding in findings if finding.kind not in idle)
    first = (Section("Do next", steps=steps[:MOST_STEPS]),) if steps else ()
    verdict = Verdict(lead, f"At {source}, where the error is {advice.content['rms_deg']:.2g}° rms.")
    sections = suggestion_sections(settings, advice, logs)
    title = f"What to change next, at {source}"
    return Page("suggestions", title, lead, (*first, *sections), verdict=verdict)


def step(finding: Finding) -> Step:
    """Return a finding as something to do."""
    return Step(statement(finding), hint(finding), str(finding.numbers.get("command", "")))


def suggestion_sections(settings: FitSettings, advice: Advice, logs: Sequence[str]) -> tuple[Section, ...]:
    """Return the three sections; `logs` are their names."""
    content, checks = advice.content, advice.residuals
    places = [f"{settings.arm.joint_names[c.joint - 1]} in {logs[c.log]}" for c in checks]
    more = [sentence(f) for f in missing_findings(content) if f.kind == "more terms missing"]
    table = missing_table(content)
    actions = {"next_actions": action_table(content)} if content["actions"] else {}
    text = "" if actions else "No action of those tested would help much."
    tests = {"missing_terms": table} if table.rows else {}
    nothing = "" if tests else "Every quantity that could be tested is free already."
    return (
        Section("What the model lacks", nothing, points=tuple(more), tables=tests),
        Section(
            "What the residual shows",
            points=tuple(sentence(f) for f in residual_findings(checks, places)),
            tabs=residual_tabs(checks, places),
            more={"residuals": residual_table(content, settings, logs)},
        ),
        Section("What each action would bring", text, tables=actions),
    )


def missing_table(content: Content) -> Table:
    """Return one row per tested quantity."""
    rows: list[tuple[Cell, ...]] = []
    for test in content["missing"]:
        seen = test["verdict"] != "invisible"
        tried = seen and test["freed"] != test["held"]
        rows.append(
            (
                test["name"],
                test["unit"],
                "no limit" if test["held"] is None else test["held"],
                *((test["freed"], test["rms_deg"]) if tried else (None, None)),
                test["score"] if seen else None,
                _VERDICTS[test["verdict"]],
            )
        )
    header = ("quantity", "unit", "held at", "freed", "rms [deg]", "score", "verdict")
    note = (
        f"rms without any of them: {content['rms_deg']:.4g} deg. score: how clearly the residual shows the "
        f"effect, in standard deviations. 'free it': significant among all tests ({100 * LEVEL:.0f} %), and "
        f"the simulated error falls by {100 * MIN_GAIN:.0f} % at least."
    )
    return Table("Quantities that the fit holds", header, tuple(rows), note, ("unit", "score"))


def residual_table(content: Content, settings: FitSettings, logs: Sequence[str]) -> Table:
    """Return one row per compared angle."""
    keys = "rms_deg", "correlation_s", "at_stop_s"
    rows: list[tuple[Cell, ...]] = []
    for residual in content["residuals"]:
        place = logs[int(residual["log"])], settings.arm.joint_names[int(residual["joint"]) - 1]
        rows.append((*place, *(residual[key] for key in keys)))
    header = ("log", "joint", "rms [deg]", "correlation time [s]", "at a stop [s]")
    return Table("Residuals", header, tuple(rows))


def action_table(content: Content) -> Table:
    """Return one row per action."""
    keys = ("action", "of", "parameter", "before_percent", "after_percent")
    keys += ("quantity", "quantity_before_percent", "quantity_after_percent")
    header = ("action", "of", "improves most", "from ± [%]", "to ± [%]")
    header += ("quantity", "quantity from ± [%]", "quantity to ± [%]")
    rows = tuple(tuple(action[key] for key in keys) for action in content["actions"])
    note = "Predicted relative standard deviations, with ±100 % on each parameter before any log."
    return Table("Predicted effect of each action", header, rows, note)
