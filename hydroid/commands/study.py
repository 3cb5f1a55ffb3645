"""`hydroid study`: settings compared over many seeds."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import Source, command
from hydroid.commands.logs import read_logs
from hydroid.commands.progress import Progress
from hydroid.errors import Stopped
from hydroid.settings.fit import StudySettings
from hydroid.settings.load import load

if TYPE_CHECKING:
    from hydroid.studies import Row


@command
def study(
    file: "Source",
    *,
    out: "Source" = "runs/study",
    processes: int = 0,
) -> "Result[tuple[Row, ...]]":
    """Compare settings over many seeds.

    The file names a config, the settings that vary, and the logs. Every run leaves a small file in
    DIR/runs when it ends. To continue a study that was stopped, give the same command again: it
    ends with the same bits.

    Example: hydroid study my-study.yaml --out runs/my-study

        runs = hydroid.study("my-study.yaml", out="runs/my-study").result
        print([(row.cell, row.seed, row.values["rms error"]) for row in runs])

    Args:
        file (STUDY.yaml): The study's file (docs/studies.md).
        processes (0 to 1024): Number of processes. 0 means one per core.

    Raises:
        SettingsError: a key or value of the file that is not allowed.
        RunError: the folder cannot be written or is in use, or a process died.
    """
    path, folder = Path(file), Path(out)
    load(path, StudySettings)  # a wrong file is refused before anything heavy is imported
    from hydroid.estimate import finite
    from hydroid.reporting.page import Table
    from hydroid.run.process import locked
    from hydroid.studies import processes as open_processes, run_study

    try:
        with locked(folder), open_processes(processes) as executor, Progress() as progress:
            runs = run_study(path, folder, read_logs, executor, progress)
    except KeyboardInterrupt:
        count = len(list(folder.glob("runs/*.json")))
        raise Stopped(f"{folder} holds {count} runs that have ended; the same command goes on") from None
    each = [
        {"cell": row.cell, "seed": row.seed, "failed": row.failed or None}
        | {name: finite(value) for name, value in row.values.items()}
        for row in runs
    ]
    measures, cells = ("rms error", "mean absolute error", "simulations"), list[dict[str, Any]]()
    for cell in dict.fromkeys(row.cell for row in runs):
        good = [row.values for row in runs if row.cell == cell and not row.failed]
        medians = {name: _median([values[name] for values in good]) for name in measures}
        cells.append({"cell": cell, "runs": len(good)} | medians)
    title = "Median over the seeds [lowest, highest], errors in deg"
    columns = sorted({name for row in runs for name in row.values})
    tables = {
        "cells": Table.of(title, {name: name for name in ("cell", "runs", *measures)}, cells),
        "runs": Table.of("Runs", {name: name for name in ("cell", "seed", "failed", *columns)}, each),
    }
    failures = [f"failed: {row.cell}, seed {row.seed}: {row.failed}" for row in runs if row.failed]
    lines = [tables["cells"], *failures, *written(tables, folder)]
    return Result(lines, {"out": str(folder), "runs": each}, runs)


def _median(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.3g} [{min(finite):.3g}, {max(finite):.3g}]" if finite else ""
