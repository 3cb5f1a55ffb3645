"""Suggestions: what the model lacks, what the residual shows, what actions would bring."""

from collections.abc import Mapping, Sequence
from typing import Any

from hydroid.advice.suggestions import Advice, action_findings, missing_findings, residual_findings
from hydroid.reporting.table import Cell, Table
from hydroid.settings.fit import FitSettings

Content = Mapping[str, Any]


def suggestions(settings: FitSettings, advice: Advice, logs: Sequence[str]) -> list[str]:
    """Return what is to be said, the first things to do first; `logs` are their names."""
    content, checks, joints = advice.content, advice.residuals, settings.arm.joint_names
    places = [f"{joints[check.joint - 1]} in {logs[check.log]}" for check in checks]
    findings = *missing_findings(content), *action_findings(content, settings)
    return list(map(str, (*findings, *residual_findings(checks, places))))


def suggestion_tables(content: Content) -> dict[str, Table]:
    """Return the tables `missing_terms` and, if an action would help, `next_actions`."""
    brings = {"next_actions": action_table(content)} if content["actions"] else {}
    return {"missing_terms": missing_table(content)} | brings


def missing_table(content: Content) -> Table:
    """Return one row per quantity that the model may lack, after the model without any of them."""

    def row(term: Content) -> dict[str, Cell]:
        return {
            "quantity": term["name"],
            "unit": term["unit"],
            "held at": "no limit" if term["held"] is None else term["held"],
            "score": term["score"],
            "promised [%]": term["gain_percent"],
            "freed": term.get("freed"),
            "rms [deg]": term.get("rms_deg"),
            "rms left out [deg]": term.get("left_out_deg"),
            "verdict": "free it" if "command" in term else "leave it" if "freed" in term else "others first",
        }

    none: dict[str, Cell] = dict.fromkeys(("unit", "held at", "score", "promised [%]", "freed"))
    errors = {"rms [deg]": content["rms_deg"], "rms left out [deg]": content["left_out_deg"]}
    rows = [{"quantity": "none of them", **none, **errors, "verdict": ""}, *map(row, content["terms"])]
    note = (
        f"Of {content['tested']} quantities that the fit holds. score: the effect in the residual, in "
        "standard deviations. promised: part of the rms error that freeing it saves. left out: the error on "
        "parts of the logs, each predicted by a fit without it."
    )
    return Table.of("Quantities that the fit holds", rows, note, ("unit", "score"))


def action_table(content: Content) -> Table:
    """Return one row per action."""
    columns = {
        "action": "action",
        "of": "of",
        "improves most": "parameter",
        "from ± [%]": "before_percent",
        "to ± [%]": "after_percent",
    }
    rows = ({name: action[key] for name, key in columns.items()} for action in content["actions"])
    return Table.of("Predicted effect of each action on standard deviations", rows)
