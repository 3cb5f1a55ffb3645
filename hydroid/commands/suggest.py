"""`hydroid suggest`: what the model lacks, and what would determine more."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.commands.inputs import ConfigSource, ModelSource, SettingChanges, Source, open_model
from hydroid.commands.logs import problem_of
from hydroid.commands.options import command
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result, written
from hydroid.files import is_file
from hydroid.identified_model import CONFIG

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.findings import Finding

TERMS = {
    "name": "quantity",
    "held": "held at",
    "gain_percent": "promised [%]",
    "freed": "freed",
    "rms_deg": "rms [deg]",
    "left_out_deg": "rms left out [deg]",
    "verdict": "verdict",
}
ACTIONS = {
    "action": "action",
    "of": "of",
    "parameter": "improves most",
    "before_percent": "from ± [%]",
    "after_percent": "to ± [%]",
}
"""columns of tables by their keys in JSON"""


@command
def suggest(
    logs: "LogSources" = (),
    *,
    fit: "ModelSource",
    out: "Source | None" = None,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[tuple[Finding, ...]]":
    """Find what the model lacks, and what to do next.

    Tests every parameter that is kept fixed, switched off or shared, such as a delay or dry friction. The
    most promising ones are freed: does that lower the error on parts of the logs left out? Tests whether the
    logs contradict the sign, zero or scale of an angle, and predicts for the best actions, from weighing a
    link to a new experiment, how much each would reduce the uncertainty.

    Example: hydroid suggest --fit runs/hyd

        suggested = hydroid.suggest(fit="runs/a").plain()
        print([(term["name"], term["gain_percent"]) for term in suggested["terms"]])

    Raises:
        LogError: a log cannot be used.
        SettingsError: no log is given, and the estimate is not in a run folder.
        RunError: the simulation diverged, a log of the run is not there, or the folder cannot be written.
    """
    model = open_model(fit, config, set)
    problem = problem_of(model, logs, repair=repair)
    from hydroid.advice.suggestions import advice
    from hydroid.posterior.uncertainty import uncertainty
    from hydroid.reporting.table import Table

    folder = Path(model.source).parent
    run = str(folder) if is_file(folder / CONFIG) else "RUN"
    with Progress() as progress:
        content, findings = advice(problem, uncertainty(problem, model.theta), run, progress)
    none = {"name": "none of them", "rms_deg": content["rms_deg"], "left_out_deg": content["left_out_deg"]}
    note = (
        f"Of {content['tested']} quantities that the fit holds. promised: part of the rms error that freeing "
        "it saves. left out: the error on parts of the logs, each predicted by a fit without it."
    )
    terms = [none, *(term | {"verdict": _verdict(term)} for term in content["terms"])]
    tables = {"missing_terms": Table.of("Quantities that the fit holds", TERMS, terms, note)}
    if actions := content["actions"]:
        title = "Predicted effect of each action on standard deviations"
        tables["next_actions"] = Table.of(title, ACTIONS, actions)
    lines = [*tables.values(), *(f"- {finding}" for finding in findings), *written(tables, out)]
    return Result(lines, content, findings)


def _verdict(term: dict[str, Any]) -> str:
    return "free it" if "command" in term else "leave it" if "freed" in term else "others first"
