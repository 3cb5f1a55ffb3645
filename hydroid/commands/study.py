"""`hydroid study`: settings compared over many seeds."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import Source, command
from hydroid.commands.logs import read_logs
from hydroid.commands.progress import Progress
from hydroid.errors import Stopped
from hydroid.files import Plain
from hydroid.settings.fit import StudySettings
from hydroid.settings.load import load

if TYPE_CHECKING:
    from hydroid.studies import Row


MEASURES = ("rms error", "mean absolute error", "simulations")
"""of a run, whose medians a study's table shows"""


@command
def study(
    file: "Source",
    *,
    out: "Source" = "runs/study",
    processes: int = 0,
) -> "Result[tuple[Row, ...]]":
    """Compare settings over many seeds.

    The file names a config, the settings that vary, and the logs. Every run leaves a
    small file in DIR/runs when it ends. To continue a study that was stopped, give the
    same command again. The result is the same to the last bit.

    Example: hydroid study my-study.yaml --out runs/my-study

        runs = hydroid.study("my-study.yaml", out="runs/my-study").result
        print([(row.cell, row.seed, row.values["rms error"]) for row in runs])

    Args:
        file (STUDY.yaml): The study's file (docs/studies.md).
        out (DIR): Folder of the tables and of the file of each run.
        processes (0 to 1024): Number of processes. 0 means one per core.

    Raises:
        SettingsError: a key or value of the file that is not allowed.
        RunError: the folder cannot be written or is in use, or a process died.
    """
    path = Path(file)
    folder = Path(out)
    # a wrong file is refused before anything heavy is imported
    load(path, StudySettings)
    from hydroid.estimate import finite
    from hydroid.reporting.page import Table
    from hydroid.run.process import locked
    from hydroid.studies import processes as open_processes, run_study

    try:
        with (
            locked(folder),
            open_processes(processes) as executor,
            Progress() as progress,
        ):
            runs = run_study(path, folder, read_logs, executor, progress)
    except KeyboardInterrupt:
        count = len(list(folder.glob("runs/*.json")))
        raise Stopped(
            f"{folder} holds {count} runs that have ended; the same command goes on"
        ) from None
    run_rows = list[Plain]()
    names = set[str]()
    failures = list[str]()
    for run in runs:
        values = {name: finite(value) for name, value in run.values.items()}
        row = {"cell": run.cell, "seed": run.seed, "failed": run.failed or None}
        run_rows.append(row | values)
        names |= values.keys()
        if run.failed:
            failures.append(f"failed: {run.cell}, seed {run.seed}: {run.failed}")
    columns = ("cell", "seed", "failed", *sorted(names))
    title = "Median over the seeds [lowest, highest], errors in deg"
    cell_columns = ("cell", "runs", *MEASURES)
    tables = {
        "cells": Table.of(title, _headed(cell_columns), _cells(runs)),
        "runs": Table.of("Runs", _headed(columns), run_rows),
    }
    lines = [tables["cells"], *failures, *written(tables, folder)]
    return Result(lines, {"out": str(folder), "runs": run_rows}, runs)


def _headed(columns: Sequence[str]) -> dict[str, str]:
    """Return columns of a table that are called by their keys."""
    return dict(zip(columns, columns, strict=True))


def _cells(runs: "Sequence[Row]") -> list[Plain]:
    """Return a row for each cell of a study: its medians over the seeds."""
    rows = list[Plain]()
    for cell in dict.fromkeys(run.cell for run in runs):
        finished = [run.values for run in runs if run.cell == cell and not run.failed]
        row: Plain = {"cell": cell, "runs": len(finished)}
        for measure in MEASURES:
            row[measure] = _median([values[measure] for values in finished])
        rows.append(row)
    return rows


def _median(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    if not finite:
        return ""
    extent = f"[{min(finite):.3g}, {max(finite):.3g}]"
    return f"{np.median(finite):.3g} {extent}"
