"""A study as a page: a table of the cells' errors, failed runs, and every run as CSV."""

from collections.abc import Sequence

import numpy as np

from hydroid.reporting.page import Page, Section
from hydroid.reporting.table import Table
from hydroid.studies.study import Row, StudyRuns


def study_page(name: str, runs: StudyRuns) -> Page:
    """Return the page of a study, by its file's name; its CSV holds every run with every measure."""
    failed = tuple((row.cell, row.seed, row.failed) for row in runs.rows if row.failed)
    sections = [Section("Errors by cell", runs.study.about, tables={"cells": cell_table(runs)})]
    if failed:
        table = Table("", ("cell", "seed", "why"), failed)
        sections.append(Section("Runs that failed", tables={"failed": table}))
    warnings = (f"{len(failed)} of {len(runs.rows)} runs failed; they are listed below.",) if failed else ()
    lead = f"{len(runs.cells)} cells over {runs.study.seeds} seeds."
    data = {f"{name}_runs.csv": runs_csv(runs.rows)}
    return Page(name, runs.study.title, lead, tuple(sections), warnings, data=data)


def cell_table(runs: StudyRuns) -> Table:
    """Return the median of each measure over the seeds of each cell, with the lowest and the highest."""
    errors = ("rms error", "mean absolute error", *(f"check {name}" for name in runs.study.checks))
    header = ("cell", "runs", *(f"{n} [deg]" if n in errors[:2] else n for n in errors), "simulations")
    rows: list[tuple[str | int, ...]] = []
    for cell in runs.cells:
        good = [row.values for row in runs.rows if row.cell == cell and not row.failed]
        values = ([one[name] for one in good] for name in (*errors, "simulations"))
        rows.append((cell, len(good), *map(_median, values)))
    return Table("Median over the seeds [lowest, highest]", header, tuple(rows))


def _median(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.3g} [{min(finite):.3g}, {max(finite):.3g}]" if finite else ""


def runs_csv(rows: Sequence[Row]) -> str:
    """Return all runs with all measures."""
    names = sorted({name for row in rows for name in row.values})
    cells = tuple((r.cell, r.seed, r.failed, *(r.values.get(n) for n in names)) for r in rows)
    return Table("", ("cell", "seed", "failed", *names), cells).csv()
