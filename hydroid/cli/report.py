"""`hydroid report`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Folder, Output
from hydroid.cli.output import show


def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of finished runs.")],
    output: Output,
    out: Folder = Path("runs/report"),
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Leave out a validation of the run; repeat for several."),
    ] = None,
) -> None:
    """Draw the report of a finished run anew, or several side by side on one page.

    Nothing is simulated, and no log is needed. With one folder, its report is written again in place. With
    several, --out gets one page that compares errors, parameters, and responses to the same logs.
    """
    from hydroid.api.report import report

    page = report(runs, out, without=without or ())
    show(output, lambda: {"out": str(page)}, [str(page)])
