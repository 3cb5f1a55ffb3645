"""A study as a table of its cells' errors, and every run as CSV."""

from collections.abc import Sequence

import numpy as np

from hydroid.reporting.table import Table
from hydroid.studies.study import Row


def cell_table(runs: Sequence[Row]) -> Table:
    """Return the median of each measure over the seeds of each cell, with the lowest and the highest."""
    measures = {"rms error": " [deg]", "mean absolute error": " [deg]", "simulations": ""}
    header = ("cell", "runs", *(name + unit for name, unit in measures.items()))
    rows: list[tuple[str | int, ...]] = []
    for cell in dict.fromkeys(row.cell for row in runs):
        good = [row.values for row in runs if row.cell == cell and not row.failed]
        values = ([one[name] for one in good] for name in measures)
        rows.append((cell, len(good), *map(_median, values)))
    return Table("Median over the seeds [lowest, highest]", header, tuple(rows))


def _median(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.3g} [{min(finite):.3g}, {max(finite):.3g}]" if finite else ""


def runs_table(rows: Sequence[Row]) -> Table:
    """Return all runs with all measures."""
    names = sorted({name for row in rows for name in row.values})
    cells = tuple((r.cell, r.seed, r.failed, *(r.values.get(n) for n in names)) for r in rows)
    return Table("Runs", ("cell", "seed", "failed", *names), cells)
