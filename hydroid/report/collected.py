"""Several runs that were made apart, such as the elements of a job array, in one table and one figure."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path

from hydroid.parameters import ParameterSet
from hydroid.report.table import Table
from hydroid.report.tables import SeedResult
from hydroid.report.write import write_spread, write_table


@dataclass(frozen=True, eq=False)
class RunResult:
    """What one run found: the search's estimate, and the one to use.

    refined: whether these two differ. without_effect: parameters that the outputs do not feel.
    """

    path: Path
    searched: SeedResult
    best: SeedResult
    refined: bool
    without_effect: frozenset[str]

    @property
    def seed(self) -> int:
        """Of the search."""
        return self.best.seed

    @property
    def rms_deg(self) -> float:
        """Rms output error of the estimate to use [deg]."""
        return degrees(self.best.rms)


def write_collected(out: Path, parameters: ParameterSet, runs: Sequence[RunResult]) -> Table:
    """Write the spread over runs, and their estimates run by run; return the table of the spread.

    Args:
        out: folder to write.
        parameters: of all runs.
        runs: at least one.

    Raises:
        RunError: the folder cannot be written.
    """
    ignore = frozenset[str].intersection(*(run.without_effect for run in runs))
    found = {"search": [run.searched for run in runs]}
    if any(run.refined for run in runs):
        found["refined"] = [run.best for run in runs]
    table = write_spread(out, parameters, found, [n for n in parameters.names if n in ignore])
    write_table(out, "runs", runs_by_error(parameters, runs))
    return table


def runs_by_error(parameters: ParameterSet, runs: Sequence[RunResult]) -> Table:
    """One row a run, the one with the smallest output error first."""
    header = (
        "run",
        "seed",
        "rms output error [deg]",
        *(f"{p.name} [{p.unit}]" for p in parameters.parameters),
    )
    rows = tuple(
        (str(run.path), run.seed, run.rms_deg, *map(float, run.best.theta))
        for run in sorted(runs, key=lambda run: (run.best.rms, run.seed))
    )
    return Table("Runs, the smallest error first", header, rows)
