"""`hydroid suggest` and `hydroid design`: what the model lacks, and the next
experiment."""

from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import (
    ConfigSource,
    LogSources,
    ModelSource,
    SettingChanges,
    Source,
    command,
    names,
    open_model,
    setting_changes,
)
from hydroid.commands.joint_units import in_joint_units
from hydroid.commands.logs import problem_of, read_logs
from hydroid.commands.progress import Progress
from hydroid.files import Plain, is_file
from hydroid.findings import Finding
from hydroid.identified_model import CONFIG
from hydroid.log import write_log

if TYPE_CHECKING:
    from hydroid.advice.design import Design

TERMS = {
    "name": "quantity",
    "held": "held at",
    "gain": "promised",
    "freed": "freed",
    "verdict": "verdict",
}
PRECISION = {
    "parameter": "name",
    "estimate": "estimate",
    "before_percent": "before [%]",
    "random_percent": "random [%]",
    "designed_percent": "designed [%]",
    "flag": "flag",
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

    First it tests every parameter that the fit keeps fixed or switched off, such as a
    delay or dry friction. Where both directions of a joint, or several joints, share a
    value, it also tests separate values. It frees the most promising ones, and judges them
    by the error on parts of the logs that are left out. Then it tests whether an
    angle of the logs has the wrong sign. Last it lists actions, from weighing a link to a
    new experiment, and how much each would reduce the uncertainty.

    Example: hydroid suggest --fit runs/hyd

        suggested = hydroid.suggest(fit="runs/a").plain()
        print([(term["name"], term["gain"]) for term in suggested["terms"]])

    Args:
        logs (LOG): Logs of commands and joint angles [default: those of the run].
        config (YAML): Settings; not needed if --fit is a run folder, which has its own.

    Raises:
        LogError: a log cannot be used.
        SettingsError: no log is given, and the estimate is not in a run folder.
        RunError: the simulation diverged, a log of the run is not there,
            or the folder cannot be written.
    """
    model = open_model(fit, config, set)
    problem = problem_of(model, logs, repair=repair)
    from hydroid.advice.suggestions import advice
    from hydroid.posterior.uncertainty import uncertainty
    from hydroid.reporting.verdict_table import left_out_table
    from hydroid.run.record import load_record, run_of

    folder = Path(model.source).parent
    run = "RUN"
    if is_file(folder / CONFIG):
        run = str(folder)
    with Progress() as progress:
        content, findings = advice(
            problem, uncertainty(problem, model.theta), run, progress
        )
    finished = run_of(model)
    if finished:
        verdicts = load_record(finished).verdict
        failing = tuple(v.name for v in verdicts if v.unseen_logs and v.verdict.fails)
        if failing:
            findings = (Finding("fails unseen", "warning", failing), *findings)
    note = (
        f"Of {content['tested']} quantities that the fit holds. promised: rise of the "
        "log-likelihood by freeing it. "
    )
    rows = [{**content, "name": "none of them"}]
    rows += [term | {"verdict": _advised(term)} for term in content["terms"]]
    table = left_out_table(
        "Quantities that the fit holds", TERMS, rows, model.settings.arm, note
    )
    lines = list[str]()
    for finding in findings:
        lines.append(f"- {finding}")
        if "command" in finding.numbers:
            lines.append(f"  {finding.numbers['command']}")
    files = written({"missing_terms": table}, out)
    content = in_joint_units(content, model.settings.arm)
    return Result([table, *lines, *files], content, findings)


def _advised(term: Plain) -> str:
    """Return what to do with a term: free it, or not, where freeing it was tried."""
    if "command" in term:
        return "free it"
    return "leave it" if "freed" in term else "others first"


@command
def design(
    logs: "LogSources" = (),
    *,
    fit: "ModelSource",
    out: "Source | None" = None,
    duration: float | None = None,
    joints: str | list[str] | None = None,
    seed: int = 1,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[Design]":
    """Design the next experiment: start pose and commands that best reduce the
    uncertainty of the estimate.

    SAFETY: Keep a hand on the emergency stop during the first run. The limits
    (design.speed_deg_s, design.margin_deg, design.clearance_m) are checked only in
    simulation with the present estimate; the real arm may exceed them. Collisions are
    checked between the parts of the model only. The model knows neither hoses nor what
    stands around the machine.

    Writes commands.csv (the experiment) and predicted.csv (the motion that is expected). The
    settings define the limits, the free parameters, and the joints to measure (outputs).

    Example: hydroid design LOG.csv --fit runs/mech --duration 30

        commands = hydroid.design("a.csv", fit="runs/a", duration=30).result.log

    Args:
        logs (LOG): Logs that you already have. The experiment is designed to add to them.
        config (YAML): Settings; not needed if --fit is a run folder, which has its own.
        duration (S): Length of the experiment [s].
        joints (2,3): Joints to drive, by number or name [default: the joints that the
            setting `outputs` lists as measured].

    Raises:
        SettingsError: limits that no experiment keeps.
        RunError: the folder cannot be written.
    """
    options = {"design.duration_s": duration, "design.joints": names(joints) or None}
    model = open_model(fit, config, setting_changes(set, options))
    from hydroid.advice.design import design as best_experiment
    from hydroid.posterior.uncertainty import flag_of
    from hydroid.reporting.page import Table

    settings = model.settings
    with Progress() as progress:
        existing = read_logs(logs, settings, repair=repair)
        result = best_experiment(settings, model.theta, existing, seed, progress)
    rows = list[Plain]()
    for i, name in enumerate(result.names):
        before = result.before.deviations[i]
        random = result.random_deviations[i]
        after = result.after.deviations[i]
        rows.append(
            {
                "parameter": name,
                "estimate": model.values[name],
                "before_percent": 100 * before,
                "random_percent": 100 * random,
                "designed_percent": 100 * after,
                "gain": random / after,
                "moved": bool(result.moved[i]),
                "flag": flag_of(after).value,
            }
        )
    findings = list[str]()
    still = tuple(row["parameter"] for row in rows if not row["moved"])
    if still:
        unmoved = Finding("no experiment moves", "note", still)
        findings.append(f"- {unmoved}")
    note = (
        f"Noise: {settings.design.noise_deg:g} deg. before: every parameter ±100 % unless logs say "
        f"more. random: median of {len(result.random)} experiments of the same length and limits. "
    )
    safety = Finding("run the experiment", "note").hint
    table = Table.of(
        "Predicted relative standard deviations", PRECISION, rows, note + safety
    )
    files = written({"design": table}, out)
    commands = None
    if out is not None:
        commands = str(Path(out) / "commands.csv")
        write_log(Path(commands), result.log, settings.log, arm=settings.arm)
        write_log(
            Path(out) / "predicted.csv", result.best.log, settings.log, arm=settings.arm
        )
        files.insert(0, commands)
    content = {"commands": commands, "precision": rows}
    return Result([table, *findings, *files], content, result)
