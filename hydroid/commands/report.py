"""`hydroid report`: the reports of finished runs, drawn anew."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.commands.inputs import as_list
from hydroid.commands.options import command
from hydroid.commands.result import Files, Printed, Result, rows

if TYPE_CHECKING:
    from hydroid.commands.inputs import Source
    from hydroid.reporting.table import Table
    from hydroid.run.collection import Collection

SPREAD = ("name", "unit", "median", "lowest", "lower_quartile", "upper_quartile", "highest", "flag")
"""keys of the table of several runs"""


@dataclass(frozen=True, eq=False, repr=False)
class MergedRuns(Result):
    """Runs of the same fit with different seeds."""

    result: "Collection"

    def lines(self) -> "list[Table | str]":
        """Return median and spread of the estimates, and the best run."""
        from hydroid.reporting.spread import final_spread

        best = self.result.best
        line = f"smallest error: {best.path} (seed {best.seed}, rms {best.rms_deg:.4g} deg)"
        return [final_spread(self.page), line, *self.written]

    def plain(self) -> dict[str, Any]:
        """Return the runs, and the spread of each parameter."""
        from hydroid.reporting.spread import final_spread

        return {
            "out": self.out and str(self.out),
            "best": str(self.result.best.path),
            "runs": {str(run.path): {"seed": run.seed, "rms_deg": run.rms_deg} for run in self.result.runs},
            "parameters": rows(final_spread(self.page), *SPREAD),
        }


@command
def report(
    runs: Annotated[
        "Source | Sequence[Source]",
        typer.Argument(metavar="RUN", help="Folders of finished runs; with --merge also a quoted pattern."),
        list[str],
    ],
    *,
    merge: Annotated[
        bool,
        typer.Option(
            help="The folders are runs of one fit with different seeds: show median and spread of their "
            "estimates. Runs that are not finished or damaged are left out, with a warning."
        ),
    ] = False,
    without: Annotated[
        "Sequence[str]",
        typer.Option(metavar="NAME", help="Leave out a validation of the run; repeat for several."),
        list[str] | None,
    ] = (),
    figures: Annotated[
        bool, typer.Option(help="Also write every chart as PNG and SVG, to figures/.")
    ] = False,
    out: Annotated[
        "Source", typer.Option(metavar="DIR", help="Folder for the page of several."), Path
    ] = "runs/report",
) -> Printed:
    """Draw the report of a finished run anew, or several side by side on one page.

    Nothing is simulated, and no log is needed: a run stores all that its report shows. With one folder, its
    report is written again in place. With several, --out gets one page that compares errors, parameters, and
    responses to the same logs.

    Example: hydroid report runs/mech runs/hyd

        hydroid.report(["runs/mech", "runs/hyd"], out="runs/report")
        print(hydroid.report("runs/array/seed-*", merge=True).result.best.path)

    Raises:
        RunError: a folder holds no finished run of this version, runs to be merged differ in more than their
            seeds, or the page cannot be written.
    """
    if merge:
        from hydroid.reporting.spread import spread_page
        from hydroid.run.collection import read_runs

        collected = read_runs([str(run) for run in as_list(runs)], Path(out))
        return MergedRuns(collected, spread_page(collected), Path(out)).write()
    from hydroid.reporting.drawing import draw

    page = str(draw(as_list(runs), out, without or (), figures=figures))
    return Files({"out": page}, (page,))
