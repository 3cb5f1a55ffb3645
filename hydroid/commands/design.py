"""`hydroid design`: the next experiment."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.commands.inputs import (
    ConfigSource,
    ModelSource,
    SettingChanges,
    Source,
    open_model,
    setting_changes,
)
from hydroid.commands.logs import read_logs
from hydroid.commands.options import command, names
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result, written
from hydroid.findings import Finding

if TYPE_CHECKING:
    from hydroid.advice.design import Design
    from hydroid.commands.logs import LogSources

COLUMNS = {
    "parameter": "name",
    "estimate": "estimate",
    "before_percent": "before [%]",
    "random_percent": "random [%]",
    "designed_percent": "designed [%]",
    "flag": "flag",
}
"""of the table of predicted standard deviations, by their keys in JSON"""


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
    """Design the next experiment: start pose and commands that best reduce the uncertainty of the estimate.

    SAFETY: Keep a hand on the emergency stop during the first run. The limits (design.speed_deg_s,
    design.margin_deg, design.clearance_m) are checked only in simulation with the present estimate; the
    real arm may exceed them. Collisions are checked with the shapes of the model, which knows no hoses and
    nothing that stands around the machine.

    Writes commands.csv (the experiment) and predicted.csv (the simulated motion, no measurement). The
    settings define the compared joints, the free parameters and the limits.

    Example: hydroid design LOG.csv --fit runs/mech --duration 30

        commands = hydroid.design("a.csv", fit="runs/a", duration=30).result.log

    Args:
        duration (S): Length of the experiment [s].
        joints (2,3): Joints to drive, by number or name [default: the compared joints].

    Raises:
        SettingsError: limits that no experiment keeps.
        RunError: the folder cannot be written.
    """
    driven = [int(name) if name.isdigit() else name for name in names(joints)] or None
    options = {"design.duration_s": duration, "design.joints": driven}
    model = open_model(fit, config, setting_changes(set, options))
    from hydroid.advice.design import design as best_experiment
    from hydroid.log import write_log
    from hydroid.posterior.flags import flag_of
    from hydroid.reporting.table import Table

    settings, commands = model.settings, None if out is None else str(Path(out) / "commands.csv")
    with Progress() as progress:
        existing = read_logs(logs, settings, repair=repair)
        result = best_experiment(settings, model.theta, existing, seed, progress)
    stages = (result.known.deviations, result.random_deviations, result.after.deviations)
    rows: list[dict[str, Any]] = [
        {"parameter": name, "estimate": model.values[name]}
        | {"before_percent": 100 * before, "random_percent": 100 * random, "designed_percent": 100 * after}
        | {"gain": random / after, "flag": flag_of(after).value}
        for name, before, random, after in zip(
            result.names, *(deviations.tolist() for deviations in stages), strict=True
        )
    ]
    note = (
        f"Noise: {settings.design.noise_deg:g} deg. before: every parameter ±100 % unless logs say more. "
        f"random: median of {len(result.random)} experiments of the same length and limits. "
    )
    safety = Finding("run the experiment", "note").hint
    table = Table.of("Predicted relative standard deviations", COLUMNS, rows, note + safety)
    files = written({"design": table}, out)
    if out is not None:
        write_log(Path(out) / "commands.csv", result.log, settings.log)
        write_log(Path(out) / "predicted.csv", result.best.log, settings.log)
        files.insert(0, str(commands))
    return Result([table, *files], {"commands": commands, "precision": rows}, result)
