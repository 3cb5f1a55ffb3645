"""Suggestions: what the model lacks, what the residual shows, what actions would bring."""

from collections.abc import Mapping, Sequence
from typing import Any

from hydroid.advice.proposals import Advice, action_findings, missing_findings, residual_findings
from hydroid.reporting.page import Page, Section
from hydroid.reporting.table import Cell, Table
from hydroid.settings.fit import FitSettings

_VERDICTS = {
    "free": "free it",
    "untried": "others first",
    "leave": "leave it: no gain",
    "invisible": "the logs cannot tell it from the free parameters",
}

MOST_STEPS = 3
"""things to do that a page names first"""
Content = Mapping[str, Any]


def suggestion_page(settings: FitSettings, advice: Advice, logs: Sequence[str], source: str) -> Page:
    """Return the page of all suggestions; its tables are `missing_terms` and `next_actions`.

    `logs` are their names, and `source` names the estimate.
    """
    missing = next(missing_findings(advice.content))
    lead = f"At {source} the rms error is {advice.content['rms_deg']:.2g}°."
    if missing.kind == "nothing missing":
        lead, found = f"{lead} {missing}", []
    else:
        found = [missing]
    steps = (*found, *action_findings(advice.content, settings))[:MOST_STEPS]
    sections = suggestion_sections(settings, advice, logs)
    sections = (Section("Do next", steps=steps), *sections) if steps else sections
    return Page("suggestions", "What to change next", lead, sections)


def suggestion_sections(settings: FitSettings, advice: Advice, logs: Sequence[str]) -> tuple[Section, ...]:
    """Return the three sections; `logs` are their names."""
    content, checks, joints = advice.content, advice.residuals, settings.arm.joint_names
    places = [f"{joints[check.joint - 1]} in {logs[check.log]}" for check in checks]
    lacks = {"missing_terms": missing_table(content)} if content["missing"] else {}
    brings = {"next_actions": action_table(content)} if content["actions"] else {}
    return (
        Section(
            "What the model lacks",
            "" if lacks else "Every quantity that could be tested is free already.",
            tuple(str(f) for f in missing_findings(content) if f.kind == "more terms missing"),
            tables=lacks,
        ),
        Section(
            "What the residual shows",
            points=tuple(str(finding) for finding in residual_findings(checks, places)),
        ),
        Section(
            "What each action would bring",
            "" if brings else "No action of those tested would help much.",
            tables=brings,
        ),
    )


def missing_table(content: Content) -> Table:
    """Return one row per tested quantity."""

    def row(test: Content) -> dict[str, Cell]:
        seen = test["verdict"] != "invisible"
        tried = seen and test["freed"] != test["held"]
        return {
            "quantity": test["name"],
            "unit": test["unit"],
            "held at": "no limit" if test["held"] is None else test["held"],
            "freed": test["freed"] if tried else None,
            "rms [deg]": test["rms_deg"] if tried else None,
            "score": test["score"] if seen else None,
            "verdict": _VERDICTS[test["verdict"]],
        }

    rms = f"rms without any of them: {content['rms_deg']:.4g} deg."
    note = f"{rms} score: the effect in the residual, in standard deviations."
    return Table.of("Quantities that the fit holds", map(row, content["missing"]), note, ("unit", "score"))


def action_table(content: Content) -> Table:
    """Return one row per action."""
    columns = {
        "action": "action",
        "of": "of",
        "improves most": "parameter",
        "from ± [%]": "before_percent",
        "to ± [%]": "after_percent",
        "quantity": "quantity",
        "quantity from ± [%]": "quantity_before_percent",
        "quantity to ± [%]": "quantity_after_percent",
    }
    rows = ({name: action[key] for name, key in columns.items()} for action in content["actions"])
    return Table.of("Predicted effect of each action on standard deviations", rows)
