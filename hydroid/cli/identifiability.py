"""`hydroid identifiability`: what logs determine, and how well."""

import json as jsonlib
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.line import Line
from hydroid.cli.options import Json, Logs, Quiet, Set, overrides, warn


class Stage(Enum):
    """The two stages."""

    MECH = "mech"
    HYD = "hyd"


def identifiability(
    logs: Logs,
    stage: Annotated[
        Stage, typer.Option(help="mech or hyd: which shipped settings, without --config.")
    ] = Stage.MECH,
    fit: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Look at this fit's estimate, with its settings.")
    ] = None,
    config: Annotated[
        str | None, typer.Option(help="Settings: a YAML file, or a shipped one's name.")
    ] = None,
    params: Annotated[
        Path | None, typer.Option(metavar="P.yaml", help="Look at these values [default: mid of the bounds].")
    ] = None,
    profile: Annotated[
        str,
        typer.Option(
            metavar="K,D", help="Profile likelihood of these parameters; costs a refinement a point."
        ),
    ] = "",
    bootstrap: Annotated[int, typer.Option(min=0, max=100_000, help="Refits with redrawn residuals.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder for the page, tables and figures.")] = Path(
        "runs/identifiability"
    ),
    setting: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say which combinations of parameters logs determine, at an estimate or at given values.

    Singular values in units of the noise, each direction that the data leave open in words, standard
    deviations and 95 % intervals. Writes a page with tables and figures.
    """
    from hydroid.identified import middle_of_bounds
    from hydroid.jobs import load_settings
    from hydroid.studies import load_subject, study_identifiability

    if fit is None and params is None:
        subject = middle_of_bounds(load_settings(config or f"fit-{stage.value}", overrides(setting)))
    else:
        subject = load_subject(
            config or (None if fit else f"fit-{stage.value}"), fit, params, overrides(setting)
        )
    names = [name.strip() for name in profile.split(",") if name.strip()]
    with Line(quiet=quiet or json) as line:
        told = study_identifiability(subject, logs, out, names, bootstrap, seed, warn, line)
    from hydroid.report.phrases import direction_phrases, profile_warnings
    from hydroid.report.uncertainty_report import interval_table

    table = interval_table(told)
    phrases = direction_phrases(told.problem, told.identifiability)
    if json:
        found = {
            "at": told.source,
            "rank": told.identifiability.rank,
            "open": phrases,
            "parameters": table.records(),
        }
        typer.echo(jsonlib.dumps(found))
    elif not quiet:
        table.show()
        for phrase in phrases:
            typer.echo(f"- {phrase}")
        for warning in profile_warnings(told.profiles):
            typer.echo(warning)
        typer.echo(str(out / "identifiability.html"))
