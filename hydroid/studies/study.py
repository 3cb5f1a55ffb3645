"""A study: every cell of some settings, fitted over every seed, and what is measured of each run."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from hydroid.log import Log
from hydroid.progress import Progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.study import StudySettings, cell_settings, load_study
from hydroid.studies.execution import run_all
from hydroid.studies.runs import Result, Task

Read = Callable[[Sequence[Path], FitSettings], list[Log]]
"""reads logs as settings map their columns"""

Checks = Mapping[str, tuple[Log, Mapping[str, FitSettings]]]
"""logs that are only predicted, by name, and the settings that simulate each, by cell"""


@dataclass(frozen=True, eq=False)
class Row:
    """One run: its cell and seed, its measures by name (empty where it failed), and why it failed."""

    cell: str
    seed: int
    values: Mapping[str, float]
    failed: str = ""


@dataclass(frozen=True, eq=False)
class StudyRuns:
    """What a study gave: its settings, the cells' settings by name, and a row for every run."""

    study: StudySettings
    cells: Mapping[str, FitSettings]
    rows: tuple[Row, ...]


def run_study(path: Path, folder: Path, read: Read, executor: Executor, progress: Progress) -> StudyRuns:
    """Perform the runs of a study that `folder` does not have yet; measure all of them.

    Raises:
        SettingsError: a key or value of the file that is not allowed, with file and line.
        LogError: a log cannot be used.
        RunError: the folder cannot be written, or a process died.
    """
    study = load_study(path)
    cells = cell_settings(study, path)
    logs = read([path.parent / name for name in study.logs], next(iter(cells.values())))
    tasks = make_tasks(cells, range(1, study.seeds + 1), logs, read_checks(study, path, read))
    results = run_all(tasks, folder, executor, progress)
    rows = (measured(task, result) for task, result in zip(tasks, results, strict=True))
    return StudyRuns(study, cells, tuple(rows))


def read_checks(
    study: StudySettings, path: Path, read: Read, extra: Mapping[str, object] | None = None
) -> Checks:
    """Read the logs that are only predicted; `extra` settings are replaced in every cell."""
    checks: dict[str, tuple[Log, Mapping[str, FitSettings]]] = {}
    for name, check in study.checks.items():
        cells = cell_settings(study, path, {**(extra or {}), **check.set})
        (log,) = read([path.parent / check.log], next(iter(cells.values())))
        checks[name] = log, cells
    return checks


def make_tasks(
    cells: Mapping[str, FitSettings], seeds: Iterable[int], logs: Sequence[Log], checks: Checks
) -> list[Task]:
    """Return all runs of a study, seed by seed."""
    return [
        Task(
            name,
            seed,
            _seeded(settings, seed),
            tuple(logs),
            tuple((check, by_cell[name], log) for check, (log, by_cell) in checks.items()),
        )
        for seed in seeds
        for name, settings in cells.items()
    ]


def measured(task: Task, result: Result) -> Row:
    """Return the measures of one run (docs/studies.md)."""
    if "failed" in result:
        return Row(task.cell, task.seed, {}, str(result["failed"]))
    values = result["measures"] | {f"value {name}": value for name, value in result["theta"].items()}
    values |= {f"check {n}": math.nan if v is None else v for n, v in result["checks"].items()}
    return Row(task.cell, task.seed, {name: float(value) for name, value in values.items()})


def _seeded(settings: FitSettings, seed: int) -> FitSettings:
    """Return a run's settings: one thread, for the runs are what is shared out."""
    search = settings.search.model_copy(update={"seed": seed})
    simulation = settings.simulation.model_copy(update={"threads": 1})
    return settings.model_copy(update={"search": search, "simulation": simulation})
