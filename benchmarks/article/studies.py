"""The article's studies: cells and seeds, the truth, what is shown, and what is claimed."""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from measures import Directions, true_directions, with_truth
from pydantic import Field

from hydroid import read_logs
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.errors import RunError
from hydroid.log import Log
from hydroid.parameters import Array, Parameter
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import Settings, load
from hydroid.settings.study import Changes, StudySettings, cell_settings
from hydroid.studies.execution import run_all
from hydroid.studies.runs import Result, Task
from hydroid.studies.study import Row, make_tasks, measured, read_checks

FOLDER = Path(__file__).parent
DETERMINED_AT_DEG = 0.1
"""noise of the angle for which a direction counts as identifiable [deg]"""
POINTS, QUICK_S, QUICK_SEEDS, QUICK_POINTS = 31, 15.0, 2, 7
"""values of each parameter of a surface; in the short form length of the data, seeds, and these values"""


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
    """A figure, and the statement `says` or the orders of effects that it is judged by."""

    title: str
    kind: Literal["convergence", "responses", "commands", "segments", "segment bests",
                  "sensitivity", "surface", "arm"]  # fmt: skip
    says: str = ""
    cells: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    orders: dict[str, tuple[tuple[str, ...], ...]] = Field(default_factory=dict[str, Any])
    window_s: tuple[float, float] | None = None
    normalized: bool = False
    actuators: dict[str, int] = Field(default_factory=dict[str, int])

    @property
    def item(self) -> str:
        """The article's item that the figure is, as its title says."""
        return self.title.lower().partition(":")[0]


class Claim(Settings):
    """A statement that is tested over the seeds: one cell has the lower measure than another."""

    says: str
    item: str
    column: str = ""
    lower: str = ""
    than: str = ""
    ours: bool = False
    """the statement is not the article's"""
    untested: str = ""
    """why no run can tell, in place of column, lower and than"""


class ArticleStudy(StudySettings):
    """A study with what the article prints and says of it."""

    items: tuple[str, ...]
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
        changes = self.study.quick if self.quick else {}
        checks = read_checks(self.study, FOLDER / self.name, read_logs, changes)
        if self.quick:
            checks = {name: (log.first(QUICK_S), own) for name, (log, own) in checks.items()}
        seeds = min(self.study.seeds, QUICK_SEEDS) if self.quick else self.study.seeds
        return make_tasks(self.cells, range(1, seeds + 1), self.logs, checks)

    def run(self, folder: Path, executor: Executor) -> "Runs":
        """Perform the runs that `folder` does not have yet; return what all of them gave."""
        problem, truth = Problem(next(iter(self.cells.values())), self.logs), self.study.truth
        directions = true_directions(problem, truth, DETERMINED_AT_DEG) if truth else None
        results = tuple(run_all(self.tasks, folder, executor, no_progress))
        pairs = zip(self.tasks, results, strict=True)
        rows = tuple(with_truth(measured(task, one), task, one, directions) for task, one in pairs)
        return Runs(self, problem, directions, results, rows)


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

    def surface(self, figure: Figure) -> tuple[list[Parameter], list[Array], Array]:
        """Return the two parameters of a figure, their values, (n,), and the error [rad], (n, n).

        All other parameters are at the truth; the values are even on each parameter's own scale.
        """
        at = [self.problem.parameters.names.index(name) for name in figure.parameters]
        chosen = [self.problem.parameters.parameters[i] for i in at]
        count = QUICK_POINTS if self.plan.quick else POINTS
        values = [p.at(np.linspace(0, 1, count)) for p in chosen]
        points = np.tile(self.theta, (count**2, 1))
        points[:, at] = np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, 2)
        return chosen, values, self.problem.evaluate(points).overall.reshape(count, count)

    def of(self, cell: str) -> list[tuple[Row, Result]]:
        """Return the runs of a cell that did not fail."""
        pairs = zip(self.rows, self.results, strict=True)
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
