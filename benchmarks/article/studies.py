"""The article's studies: cells and seeds, the truth, what is shown, and what is claimed."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from common import pseudo_random_log
from measures import Directions, true_directions, with_truth
from pydantic import Field

from hydroid import read_logs
from hydroid.errors import RunError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.prediction import predict, simulate_log
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import Settings, load
from hydroid.settings.study import Changes, StudySettings, cell_settings
from hydroid.studies import Result, Row, Task, make_tasks, measured, run_all

FOLDER = Path(__file__).parent
QUICK_S, QUICK_SEEDS = 15.0, 2
"""length of the data and number of seeds in the short form"""
BLIND_DRAWS = 100


class Simulated(Settings):
    """Data simulated at the true parameters under pseudo-random commands, as in the article's figure 17."""

    pose: str = "study"
    joints: tuple[int, ...] = (2,)
    duration_s: float = 75.0
    seed: int = 0
    range_deg: tuple[float, float] | None = None
    """a level that would move a compared joint out of this range is turned round or reduced [deg]"""


class Table(Settings):
    """A row for each cell, a column for each measure, and the values that the article prints, by cell."""

    title: str
    columns: tuple[str, ...]
    article: dict[str, tuple[float | None, ...]] = Field(default_factory=dict[str, Any])
    cells: tuple[str, ...] = ()
    note: str = ""


class Figure(Settings):
    """A figure."""

    title: str
    kind: Literal["convergence", "responses", "segment bests", "sensitivity", "surface"]
    cells: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    window_s: tuple[float, float] | None = None
    normalized: bool = False

    @property
    def item(self) -> str:
        """The article's item that the figure is, as its title says."""
        return self.title.lower().partition(":")[0]


class Claim(Settings):
    """A statement that is tested over the seeds: one cell has the lower measure than another."""

    says: str
    item: str
    column: str
    lower: str
    than: str
    ours: bool = False
    """the statement is not the article's"""


class CheckLog(Settings):
    """A log that every estimate predicts, and settings of its own, by dotted key."""

    log: str
    set: Changes = Field(default_factory=dict[str, Any])


class ArticleStudy(StudySettings):
    """A study with what the article prints and says of it."""

    logs: tuple[str, ...] = ()
    about: str
    items: tuple[str, ...]
    checks: dict[str, CheckLog] = Field(default_factory=dict[str, CheckLog])
    """further logs, by name; their measure is the mean absolute error"""
    truth: dict[str, float] = Field(default_factory=dict[str, float])
    simulated: Simulated | None = None
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    claims: tuple[Claim, ...] = ()
    quick: Changes = Field(default_factory=dict[str, Any])
    """settings that the short form replaces in every cell"""


def load_studies() -> dict[str, ArticleStudy]:
    """Return the studies by the name of their file, in the order of the article's tables and figures."""
    studies = {file.stem: load(file, ArticleStudy) for file in FOLDER.glob("*.yaml")}
    return dict(sorted(studies.items(), key=lambda each: order(each[1].items[0])))


def order(item: str) -> tuple[bool, int]:
    """Return what sorts tables before figures, each by number."""
    return item.startswith("figure"), int(item.split()[1])


@dataclass(frozen=True, eq=False)
class Plan:
    """A study that is ready to run; `quick` is its short form."""

    name: str
    study: ArticleStudy
    quick: bool

    @cached_property
    def cells(self) -> dict[str, FitSettings]:
        """Settings of a fit, by cell."""
        return cell_settings(self.study, FOLDER / self.name, self.study.quick if self.quick else {})

    @cached_property
    def logs(self) -> list[Log]:
        """What the runs are fitted to."""
        first, longest = next(iter(self.cells.values())), QUICK_S if self.quick else np.inf
        if self.study.simulated is not None:
            return [simulated_log(first, self.study.simulated, self.study.truth, longest)]
        return [log.first(longest) for log in read_logs([FOLDER / n for n in self.study.logs], first)]

    @cached_property
    def tasks(self) -> list[Task]:
        """All runs."""
        seeds = min(self.study.seeds, QUICK_SEEDS) if self.quick else self.study.seeds
        return make_tasks(self.cells, seeds, self.logs)

    def run(self, folder: Path, executor: Executor) -> "Runs":
        """Perform the runs that `folder` does not have yet; return what all of them gave."""
        problem, truth = Problem(next(iter(self.cells.values())), self.logs), self.study.truth
        directions = true_directions(problem, truth) if truth else None
        results = tuple(run_all(self.tasks, folder, executor, no_progress))
        pairs = list(zip(self.tasks, results, strict=True))
        rows = [with_truth(measured(task, one), one, directions) for task, one in pairs]
        for name, check in self.study.checks.items():
            errors = self.check_errors(check, pairs)
            rows = [
                replace(row, values={**row.values, f"check {name}": error})
                for row, error in zip(rows, errors, strict=True)
            ]
        if rows and directions:
            rows += directions.without_data(BLIND_DRAWS)
        return Runs(self, problem, directions, results, tuple(rows))

    def check_errors(self, check: CheckLog, runs: Sequence[tuple[Task, Result]]) -> Iterator[float]:
        """Yield the mean absolute error [deg] of each run on another log; NaN where it diverged."""
        changes = (self.study.quick if self.quick else {}) | check.set
        cells = cell_settings(self.study, FOLDER / self.name, changes)
        (log,) = read_logs([FOLDER / check.log], next(iter(cells.values())))
        log = log.first(QUICK_S if self.quick else np.inf)
        for task, result in runs:
            settings = cells[task.cell]
            try:
                theta = settings.parameter_set().vector(result["theta"], "a run")
                angle = predict(IdentifiedModel(settings, theta, "a run"), log, settings.outputs)
            except (RunError, KeyError):
                yield np.nan
                continue
            measured = log.angle[:, [j - 1 for j in settings.outputs]]
            yield float(np.degrees(np.abs(angle - measured)).mean())


@dataclass(frozen=True, eq=False)
class Runs:
    """What a study gave: the problem of its first cell, a result and a row of measures for every run."""

    plan: Plan
    problem: Problem
    directions: Directions | None
    results: tuple[Result, ...]
    rows: tuple[Row, ...]

    @property
    def theta(self) -> Array:
        """The true parameters, shape (P,)."""
        return self.problem.parameters.vector(self.plan.study.truth, "truth")

    @property
    def record(self) -> tuple[Array, Array]:
        """Time [s] and angle [deg] of the first compared joint in the first log, shapes (T,)."""
        log = self.problem.logs[0]
        return log.time, np.degrees(log.angle[:, self.problem.outputs[0]])

    def of(self, cell: str) -> list[tuple[Row, Result]]:
        """Return the runs of a cell that did not fail."""
        pairs = zip(self.rows, self.results, strict=False)  # blind draws have no result
        return [(row, result) for row, result in pairs if row.cell == cell and not row.failed]

    def median_run(self, cell: str) -> Result | None:
        """Return the run of a cell whose error is the median: of the parameters, or of the output."""
        by = "rms error" if self.directions is None else "parameter error"
        runs = sorted(self.of(cell), key=lambda pair: pair[0].values[by])
        return runs[(len(runs) - 1) // 2][1] if runs else None


def simulated_log(
    settings: FitSettings, data: Simulated, truth: Mapping[str, float], longest: float = np.inf
) -> Log:
    """Return a log simulated at the true parameters, at most `longest` seconds long."""
    columns, (low, high) = [j - 1 for j in settings.outputs], data.range_deg or (-np.inf, np.inf)

    def inside(log: Log) -> bool:
        try:
            angle = np.degrees(simulate_log(settings, log, truth, "truth").angle[:, columns])
        except RunError:
            return False
        return bool(low < angle.min() and angle.max() < high)

    pose, seconds = settings.arm.pose(data.pose), min(data.duration_s, longest)
    allowed = inside if data.range_deg else lambda log: True
    commands = pseudo_random_log(pose, list(data.joints), seconds, seed=data.seed, allowed=allowed)
    return simulate_log(settings, commands, truth, "truth")
