"""`hydroid report`: the reports of finished runs, drawn anew."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hydroid.commands.inputs import Source, as_list
from hydroid.commands.options import command
from hydroid.commands.result import Result, written

if TYPE_CHECKING:
    from hydroid.run.record import Record


@command
def report(
    runs: "Source | Sequence[Source]",
    *,
    merge: bool = False,
    without: Sequence[str] = (),
    figures: bool = False,
    out: "Source | None" = None,
) -> "Result[tuple[Record, ...]]":
    """Draw the reports of finished runs anew, or merge runs of one fit with different seeds.

    Nothing is simulated, and no log is needed: a run stores all that its report shows, which is written again
    in its folder. `hydroid validate` compares several fits.

    Example: hydroid report runs/mech runs/hyd

        hydroid.report(["runs/mech", "runs/hyd"])
        print(hydroid.report("runs/array/seed-*", merge=True).content["best"])

    Args:
        runs (RUN): Folders of finished runs; with --merge also a quoted pattern.
        merge: The folders are runs of one fit with different seeds: show median and spread of their
            estimates. Runs that are not finished or damaged are left out, with a warning.
        without (NAME): Leave out a validation of the run; repeat for several.
        figures: Also write every chart as PNG and SVG, to figures/.
        out (DIR): Folder for the tables of --merge.

    Raises:
        RunError: a folder holds no finished run of this version, runs to be merged differ in more than their
            seeds, or the page cannot be written.
    """
    if not merge:
        from hydroid.reporting.fit_report import draw

        files = [str(draw(run, without or (), figures=figures)) for run in as_list(runs)]
        return Result(files, {"files": files}, ())
    from hydroid.reporting.validation_report import merged_tables
    from hydroid.run.collection import read_runs

    collected = read_runs([str(run) for run in as_list(runs)], out)
    tables, best = merged_tables(collected), min(collected, key=lambda run: run.rms_deg)
    line = f"smallest error: {best.folder} (seed {best.seed}, rms {best.rms_deg:.4g} deg)"
    spread = tables["spread"]
    content = {
        "out": out and str(out),
        "best": best.folder,
        "runs": {run.folder: {"seed": run.seed, "rms_deg": run.rms_deg} for run in collected},
        "parameters": [dict(zip(spread.header, row, strict=True)) for row in spread.rows],
    }
    return Result([spread, line, *written(tables, out)], content, collected)
