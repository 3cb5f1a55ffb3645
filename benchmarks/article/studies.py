"""The article's studies: what runs on which record, the truth, what is shown, and what
is claimed."""

import csv
import sys
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from common import pseudo_random_log, true_log
from made_logs import simulate_log
from measures import Directions, course, output_errors
from pydantic import Field

from hydroid import read_logs
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import Changes, FitSettings, StudySettings, cell_settings
from hydroid.settings.load import Settings, load
from hydroid.studies import Result, Task, measures_of

FOLDER = Path(__file__).parent
SECONDS, QUICK_SECONDS = 75.0, 15.0
"""length of the data; in the short form, which has one seed"""
TRUTHS_FROM = 0.7
"""a seed with a record of its own has true values of 0.7 to 1 / 0.7 times the
article's"""
Runs = list[dict[str, Any]]
"""runs as a CSV has them: TEXTS (why it failed, best parameters of each segment), seed
and measures"""
TEXTS = ("cell", "failed", "history", "segment bests")
BLIND, CENTRE, RECORDS = "blind draw", "centre of the box", "records"
"""cells without a search: estimates that no data went into, and what records say at the
truth"""


class Table(Settings):
    """A row for each cell, a column for each measure, and the values that the article
    prints, by cell."""

    title: str
    columns: tuple[str, ...]
    article: dict[str, tuple[float | None, ...]] = Field(default_factory=dict[str, Any])
    cells: tuple[str, ...] = ()


class Figure(Settings):
    title: str
    kind: Literal["convergence", "responses", "segment bests", "sensitivity", "surface"]
    cells: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    window_s: tuple[float, float] | None = None
    normalized: bool = False

    @property
    def file(self) -> str:
        return self.title.lower().partition(":")[0].replace(" ", "_") + ".svg"


class Claim(Settings):
    """A statement that is tested over the seeds: a ratio of two measures is below a
    limit, or near 1.

    lower, column: the cell and the measure above the line. than, to: those below it;
    without `to` the same measure, without `than` 1. equal: the claim is that the ratio
    is near 1. ours: it is not the article's.
    """

    says: str
    item: str
    lower: str
    column: str
    than: str = ""
    to: str = ""
    below: float = 1.0
    equal: bool = False
    ours: bool = False


class ArticleStudy(StudySettings):
    """A study with what the article prints and says of it.

    seeds: of the simple GA's cells; others have half as many. same_record: seeds up to
    this one share the article's truth and one record; every later one has its own.
    records: number of records on which the model itself is looked at. truth: the
    article's; none: `logs` are fitted. range_deg: where simulated data keep the
    compared joint. checks: settings by further log. quick: settings that the short form
    replaces in every cell.
    """

    logs: tuple[str, ...] = ()
    about: str
    same_record: int = 0
    records: int = 0
    truth: dict[str, float] = Field(default_factory=dict[str, float])
    range_deg: tuple[float, float] | None = None
    checks: dict[str, Changes] = Field(default_factory=dict[str, Any])
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    claims: tuple[Claim, ...] = ()
    quick: Changes = Field(default_factory=dict[str, Any])


def load_studies() -> dict[str, ArticleStudy]:
    names = ("mechanical", "wide", "elbow", "hydraulic", "surface", "rig")
    return {name: load(FOLDER / f"{name}.yaml", ArticleStudy) for name in names}


class Plan:
    """A study that is ready to run; `quick` is its short form."""

    def __init__(self, name: str, study: ArticleStudy, *, quick: bool = False) -> None:
        self.name, self.study, self.quick = name, study, quick
        self.longest = QUICK_SECONDS if quick else SECONDS
        self._record = cache(self._make_record)
        self._directions = cache(
            lambda seed: Directions(self.problem(seed), self.truth(seed))
        )

    def settings(self, changes: Changes) -> dict[str, FitSettings]:
        quick = self.study.quick if self.quick else {}
        return cell_settings(self.study, FOLDER / self.name, quick | changes)

    @cached_property
    def cells(self) -> dict[str, FitSettings]:
        return self.settings({})

    def seeds(self, cell: str) -> range:
        """Return the seeds that a cell should have; half as many where the search is
        not the simple GA."""
        half = cell in self.cells and self.cells[cell].search.algorithm != "ga"
        return range(
            1,
            1
            + min(
                self.study.seeds // (1 + half), 1 if self.quick else self.study.seeds
            ),
        )

    def truth(self, seed: int) -> dict[str, float]:
        own = seed > self.study.same_record
        exponents = (
            np.random.default_rng(seed).uniform(-1, 1, len(self.study.truth)) * own
        )
        return {
            n: v * TRUTHS_FROM**e
            for (n, v), e in zip(self.study.truth.items(), exponents, strict=True)
        }

    def log(self, seed: int) -> Log:
        return self._record(
            seed if self.study.truth and seed > self.study.same_record else 0
        )

    def directions(self, seed: int) -> Directions:
        """Return what a seed's record determines at its truth."""
        return self._directions(seed if seed > self.study.same_record else 0)

    def problem(self, seed: int, cell: str = "") -> Problem:
        """Return the problem of a seed's record, for the first cell where there is no
        such cell."""
        return Problem(
            self.cells.get(cell, next(iter(self.cells.values()))), [self.log(seed)]
        )

    def task(self, cell: str, seed: int) -> Task:
        # the runs are what is shared out
        changes = {"search.seed": seed, "simulation.threads": 1}
        return Task(cell, seed, self.cells[cell].changed(changes), (self.log(seed),))

    def row(self, cell: str, seed: int, result: Result) -> dict[str, Any]:
        """Return a run with all its measures, as it is kept."""
        made = measures_of(self.task(cell, seed), result)
        row: dict[str, Any] = {"cell": cell, "seed": seed} | dict(made.values)
        if made.failed:
            return row | {"failed": made.failed}
        bests = (
            " ".join(f"{value:.6g}" for value in best.values())
            for best in result["segment_bests"]
        )
        return self.judged(
            row | course(result["history"]) | {"segment bests": ";".join(bests)}
        )

    def judged(self, row: dict[str, Any]) -> dict[str, Any]:
        """Return a run with the measures of its estimate that it lacks."""
        problem = self.problem(row["seed"], row["cell"])
        values = {
            name: float(row[f"value {name}"]) for name in problem.parameters.names
        }
        theta = np.array([*values.values()])
        found = output_errors(problem, theta)
        if self.study.truth:
            found |= self.directions(row["seed"]).measures(values)
        for number, (file, changes) in enumerate(self.study.checks.items(), 2):
            if (name := f"check set {number}") not in row:
                cells = self.settings(changes)
                settings = cells.get(row["cell"], next(iter(cells.values())))
                log = read_logs([FOLDER / file], settings)[0].first(self.longest)
                found[name] = output_errors(Problem(settings, [log]), theta)[
                    "mean absolute error"
                ]
        return found | row

    def _make_record(self, seed: int) -> Log:
        """Read the log, or simulate the truth under pseudo-random commands, as in the
        article's figure 17."""
        settings, truth = next(iter(self.cells.values())), self.truth(seed)
        if not truth:
            return read_logs([FOLDER / name for name in self.study.logs], settings)[
                0
            ].first(self.longest)
        pose, joints = settings.arm.pose("study"), [*settings.outputs]
        if self.study.range_deg is None:
            return simulate_log(
                settings,
                pseudo_random_log(pose, joints, self.longest, seed=seed),
                truth,
            )
        limits = np.tile([[-np.inf], [np.inf]], len(pose))
        limits[:, joints[0] - 1] = np.radians(self.study.range_deg)
        return true_log(settings, truth, self.longest, seed, limits=limits)


def read_runs(file: Path) -> Runs:
    """Read the runs of a study; none where there is no file."""
    lines = csv.DictReader(
        file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    )
    return [
        {
            name: text if name in TEXTS else float(text)
            for name, text in line.items()
            if text
        }
        | {"seed": int(line["seed"])}
        for line in lines
    ]


def of_cell(runs: Runs, cell: str, column: str) -> dict[int, float]:
    """Return a measure, or the ratio `A / B` of two, of the runs of a cell that have
    it, by seed."""
    above, _, below = column.partition(" / ")
    if below:
        upper, lower = of_cell(runs, cell, above), of_cell(runs, cell, below)
        return {
            seed: value / lower[seed] for seed, value in upper.items() if seed in lower
        }
    found = {
        run["seed"]: run.get(column, np.nan) for run in runs if run["cell"] == cell
    }
    return {seed: value for seed, value in found.items() if np.isfinite(value)}
