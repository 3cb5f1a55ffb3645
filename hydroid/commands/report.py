"""`hydroid report`: the reports of finished runs, drawn anew."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.inputs import as_list
from hydroid.commands.options import command
from hydroid.commands.result import Result, rows, written

if TYPE_CHECKING:
    from hydroid.commands.inputs import Source
    from hydroid.run.collection import Runs

SPREAD = ("name", "unit", "median", "lowest", "lower_quartile", "upper_quartile", "highest", "flag")
"""keys of the table of several runs"""


@command
def report(
    runs: "Source | Sequence[Source]",
    *,
    merge: bool = False,
    without: Sequence[str] = (),
    figures: bool = False,
    out: "Source" = "runs/report",
) -> "Result[Runs | None]":
    """Draw the report of a finished run anew, or several side by side on one page.

    Nothing is simulated, and no log is needed: a run stores all that its report shows. With one folder, its
    report is written again in place. With several, --out gets one page that compares errors, parameters, and
    responses to the same logs.

    Example: hydroid report runs/mech runs/hyd

        hydroid.report(["runs/mech", "runs/hyd"], out="runs/report")
        print(hydroid.report("runs/array/seed-*", merge=True).result.best.folder)

    Args:
        runs (RUN): Folders of finished runs; with --merge also a quoted pattern.
        merge: The folders are runs of one fit with different seeds: show median and spread of their
            estimates. Runs that are not finished or damaged are left out, with a warning.
        without (NAME): Leave out a validation of the run; repeat for several.
        figures: Also write every chart as PNG and SVG, to figures/.
        out (DIR): Folder for the page of several.

    Raises:
        RunError: a folder holds no finished run of this version, runs to be merged differ in more than their
            seeds, or the page cannot be written.
    """
    if not merge:
        from hydroid.reporting.drawing import draw

        file = str(draw(as_list(runs), out, without or (), figures=figures))
        return Result([file], {"out": file}, None)
    from hydroid.reporting.comparison import spread_page
    from hydroid.run.collection import read_runs

    collected = read_runs([str(run) for run in as_list(runs)], Path(out))
    page, best = spread_page(collected), collected.best
    table = page.tables["spread"]
    line = f"smallest error: {best.folder} (seed {best.seed}, rms {best.rms_deg:.4g} deg)"
    content = {
        "out": str(out),
        "best": best.folder,
        "runs": {run.folder: {"seed": run.seed, "rms_deg": run.rms_deg} for run in collected.runs},
        "parameters": rows(table, *SPREAD),
    }
    return Result([table, line, *written(page, out)], content, collected, page)
