"""`hydroid surface`: the error over two parameters."""

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.line import Line
from hydroid.cli.options import Estimate, FitDir, Json, Logs, Quiet, Set, StudyConfig, overrides, warn


def surface(
    logs: Logs,
    over: Annotated[list[str], typer.Option(metavar="K,D", help="Two parameters; repeat for several pairs.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for figures and CSV.")],
    fit: FitDir = None,
    params: Estimate = None,
    config: StudyConfig = None,
    points: Annotated[int, typer.Option(min=3, max=301, help="Points of the grid, each way.")] = 31,
    around: Annotated[
        float | None,
        typer.Option(
            min=0.001, max=1000, metavar="PCT", help="Grid ±PCT % around the estimate [default: the bounds]."
        ),
    ] = None,
    setting: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw the error over two parameters, all others held at the estimate (article, figure 11).

    The error is the settings' norm over the whole record; --set objective.norm=2 draws the rms error.
    """
    from hydroid.studies import load_subject, study_surface

    subject = load_subject(config, fit, params, overrides(setting))
    reach = None if around is None else around / 100
    with Line(quiet=quiet or json) as line:
        table = study_surface(subject, logs, out, over, points, reach, warn, line)
    if json:
        typer.echo(jsonlib.dumps(table.records()))
    elif not quiet:
        table.show()
        typer.echo(str(out))
