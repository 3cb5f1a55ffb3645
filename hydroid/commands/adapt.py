"""`hydroid adapt`: a fit moved to new logs by a few of its parameters."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.fit import FitResult
from hydroid.commands.fit import fit as run_fit
from hydroid.commands.inputs import ModelSource, Source, command, names, open_model
from hydroid.commands.logs import read_logs
from hydroid.commands.progress import FitProgress, Progress
from hydroid.errors import SettingsError

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources


@command
def adapt(
    logs: "LogSources",
    *,
    fit: "ModelSource",
    free: "str | None" = None,
    out: "Source | None" = None,
    repair: bool = False,
) -> FitResult:
    """Adapt a fit to new logs: a few parameters are freed, all others are held at its estimate.

    For another load, a slower engine, a colder day. Writes a run that every command takes. Judges each
    freed parameter by parts of the logs left out.

    Example: hydroid adapt LOADED.csv --fit runs/hyd --free P_flow,P_droop

        adapted = hydroid.adapt("b.csv", fit="runs/a", free="M3")
        print(adapted.summary.values)

    Args:
        logs (LOG): The new logs.
        free (NAME,NAME): Parameters to be freed [default: masses and pump, one after the other, as long as
            the error on parts of the logs left out falls].
        out (DIR): Run folder [default of the command line: runs/adapt].

    Raises:
        HydroidError: an input or a folder that cannot be used, or no parameter that helps.
    """
    model = open_model(fit)
    read = read_logs(logs, model.settings, repair=repair)
    from hydroid.advice.adaptation import adapted, steps
    from hydroid.reporting.table import Table

    with Progress() as progress:
        path = steps(model, read, names(free), progress)
    chosen = [step["parameter"] for step in path[1:]]
    if not chosen:
        hint = "name parameters with --free, or fit anew with --start RUN"
        raise SettingsError("no parameter lowers the error on parts left out", where=model.source, hint=hint)
    settings = adapted(model, chosen)
    with FitProgress(settings) as watcher:
        result = run_fit(settings, read, out and Path(out), progress=watcher)
    rows = [step | {"parameter": step["parameter"] or "none"} for step in path]
    columns = {"parameter": "freed", "rms_deg": "rms [deg]", "left_out_deg": "left out [deg]"}
    note = "left out: the error on parts of the logs, each predicted by an adaptation without it."
    steps_table = Table.of("Parameters freed one after another", columns, rows, note)
    content = {**result.content, "steps": path}
    return replace(result, lines=[steps_table, *result.lines], content=content)
