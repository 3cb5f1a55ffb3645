"""A study from its file to its measures and verdicts."""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.study import StudySettings, cell_settings, load_study
from hydroid.settings.study_shown import StudyFigure
from hydroid.study.claims import Verdict, verdicts
from hydroid.study.data import Read, StudyData, make_data
from hydroid.study.execution import run_all
from hydroid.study.findings import findings
from hydroid.study.measures import Directions, Row, check_measures, measured, measures, true_directions
from hydroid.study.runs import Result, Task, make_tasks

RUNS = "runs"
"""folder of the runs' files, which several studies may share"""


@dataclass(frozen=True, eq=False)
class StudyPlan:
    """A study that is ready to run.

    Attributes:
        path: its file.
        study: its settings.
        cells: settings of a fit, by cell.
        data: the logs.
        tasks: all runs.
        units: of the measures, by name.
        quick: whether it is the short form.
    """

    path: Path
    study: StudySettings
    cells: Mapping[str, FitSettings]
    data: StudyData
    tasks: tuple[Task, ...]
    units: Mapping[str, str]
    quick: bool

    @property
    def name(self) -> str:
        """Of the study's file, for the names of what it writes."""
        return self.path.stem

    @property
    def seeds(self) -> int:
        """Number of seeds."""
        return len({task.seed for task in self.tasks})

    def grid(self, figure: StudyFigure) -> int:
        """Return how many values of each parameter a surface has."""
        return self.study.quick.points if self.quick else figure.points


@dataclass(frozen=True, eq=False)
class StudyRuns:
    """What a study found.

    Attributes:
        plan: the study.
        problem: of its first cell.
        directions: what the data determine at the truth; None where no truth is stated.
        results: of every task.
        rows: their measures.
        verdicts: on the study's claims.
        findings: on the statements that its figures are judged by.
    """

    plan: StudyPlan
    problem: Problem
    directions: Directions | None
    results: tuple[Result, ...]
    rows: tuple[Row, ...]
    verdicts: tuple[Verdict, ...]
    findings: tuple[Verdict, ...]

    def of(self, cell: str) -> list[tuple[Row, Result]]:
        """Return the runs of a cell that did not fail."""
        pairs = zip(self.rows, self.results, strict=True)
        return [(row, result) for row, result in pairs if row.cell == cell and not row.failed]

    def median_run(self, cell: str) -> tuple[Row, Result] | None:
        """Return the run of a cell whose error is the median: of the parameters, or of the output."""
        runs = self.of(cell)
        by = "rms error" if self.directions is None else "parameter error"
        order = np.argsort([row.values[by] for row, _ in runs], kind="stable")
        return runs[order[(len(runs) - 1) // 2]] if runs else None


def plan_study(path: Path, read: Read, *, seeds: int | None = None, quick: bool = False) -> StudyPlan:
    """Read a study's file and make its data.

    Args:
        path: the file.
        read: reads logs.
        seeds: number of seeds; None: what the file says. A study that fits nothing stays one.
        quick: the short form.

    Raises:
        SettingsError: a key or value that is not allowed, with file and line.
        LogError: a log cannot be used.
    """
    study = load_study(path)
    cells = cell_settings(study, path, quick=quick)
    parameters = next(iter(cells.values())).parameters
    units = measures(study, [n for n, p in parameters.items() if p.quantity == "mass"], list(parameters))
    units |= {f"value {name}": p.unit for name, p in parameters.items()}
    check_measures(study, units, str(path))
    data = make_data(study, path, next(iter(cells.values())), read, quick=quick)
    count = (seeds or (study.quick.seeds if quick else study.seeds)) if study.seeds else 0
    tasks = make_tasks(cells, range(1, count + 1), data)
    return StudyPlan(path, study, cells, data, tuple(tasks), units, quick)


def run_study(plan: StudyPlan, folder: Path, executor: Executor, progress: Progress) -> StudyRuns:
    """Perform the runs that `folder` does not have yet; return what all of them found.

    Raises:
        RunError: the folder cannot be written, or a process died.
    """
    problem = Problem(next(iter(plan.cells.values())), plan.data.logs)
    data = plan.study.data
    directions = true_directions(problem, data.truth, data.determined_at_deg) if data.truth else None
    results = run_all(plan.tasks, folder / RUNS, executor, progress)
    rows = [measured(task, result, directions) for task, result in zip(plan.tasks, results, strict=True)]
    claimed = verdicts(plan.study.claims, rows)
    judged = findings(plan.study, problem, rows, plan.grid)
    return StudyRuns(plan, problem, directions, tuple(results), tuple(rows), tuple(claimed), tuple(judged))
