"""`hydroid report`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Folder, Output
from hydroid.cli.output import show


def report(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders of finished runs or studies.")
    ],
    output: Output,
    out: Folder = Path("runs/report"),
    figures: Annotated[
        bool, typer.Option("--figures", help="Also write every chart as PNG and SVG, to figures/.")
    ] = False,
) -> None:
    """Draw the report of a finished run or study anew, or several side by side on one page.

    Nothing is simulated, and no log is needed. With one folder, its report is written again in place. With
    several, --out gets one page that compares verdicts, errors, parameters, and responses to the same logs.
    """
    from hydroid.api.report import report

    page = report(folders, out, figures=figures)
    show(output, lambda: {"out": str(page)}, [str(page)])
