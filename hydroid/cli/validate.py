"""`hydroid validate`: how well fits reproduce logs."""

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Json, Logs, Quiet, Set, overrides, warn


def validate(
    logs: Logs,
    fit: Annotated[list[Path], typer.Option(metavar="DIR", help="Run folder of a fit; repeat for several.")],
    out: Annotated[Path, typer.Option(help="Folder for the table and the figures.")] = Path(
        "runs/validation"
    ),
    setting: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare fits with logs they were not fitted on: error indices (article, table 9) and overlay plots."""
    from hydroid.jobs import validate_fits
    from hydroid.report.page import write_page
    from hydroid.report.validation_report import validation_page

    results = validate_fits(fit, logs, warn, overrides(setting))
    page = validation_page(results)
    write_page(page, out)
    table = page.tables["validation"]
    if json:
        typer.echo(jsonlib.dumps(table.records()))
    elif not quiet:
        table.show()
        typer.echo(str(out / "validation.html"))
