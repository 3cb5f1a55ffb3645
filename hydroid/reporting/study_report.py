"""A study as a page: a table of the cells' errors, failed runs, and every run as CSV."""

from collections.abc import Sequence

import numpy as np

from hydroid.reporting.page import Page, Section
from hydroid.reporting.table import Cell, Table
from hydroid.studies.study import Row, StudyRuns

UNITS = {"largest error": "deg", "mean absolute error": "deg", "rms error": "deg", "seconds": "s"}


def study_page(name: str, runs: StudyRuns) -> Page:
    """Return the page of a study, by its file's name; its CSV holds every run with every measure."""
    failed = tuple((row.cell, row.seed, row.failed) for row in runs.rows if row.failed)
    sections = [Section("Errors by cell", runs.study.about, tables={"cells": cell_table(runs)})]
    warnings: tuple[str, ...] = ()
    if failed:
        warnings = (f"{len(failed)} of {len(runs.rows)} runs failed; they are listed below.",)
        table = Table("Failed runs", ("cell", "seed", "why"), failed)
        sections.append(Section("Runs that failed", tables={"failed": table}))
    lead = f"{len(runs.cells)} cells over {runs.study.seeds} seeds."
    data = {f"{name}_runs.csv": runs_csv(runs.rows)}
    return Page(name, runs.study.title, lead, tuple(sections), warnings, data=data)


def cell_table(runs: StudyRuns) -> Table:
    """Return the median of each measure over the seeds of each cell, with the lowest and the highest."""
    measures = ("rms error", "mean absolute error", *(f"check {c}" for c in runs.study.checks), "simulations")
    rows: list[tuple[Cell, ...]] = []
    for cell in runs.cells:
        good = [row for row in runs.rows if row.cell == cell and not row.failed]
        values = [np.array([row.values[name] for row in good]) for name in measures]
        rows.append((cell, len(good), *map(spread, values)))
    header = ("cell", "runs", *(f"{m} [{UNITS[m]}]" if m in UNITS else m for m in measures))
    return Table("Median over the seeds [lowest, highest]", header, tuple(rows))


def spread(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> str:
    """Return median, lowest and highest of the finite values, shape (n,); empty where there are none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ""
    return f"{np.median(finite):.3g} [{finite.min():.3g}, {finite.max():.3g}]"


def runs_csv(rows: Sequence[Row]) -> str:
    """Return all runs with all measures."""
    names = sorted({name for row in rows for name in row.values})
    cells = tuple((r.cell, r.seed, r.failed, *(r.values.get(n) for n in names)) for r in rows)
    return Table("", ("cell", "seed", "failed", *names), cells).csv()
