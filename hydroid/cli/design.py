"""`hydroid design`: the next experiment."""

import json as jsonlib
from pathlib import Path
from typing import Annotated, Any

import typer

from hydroid.cli.line import Line
from hydroid.cli.options import Estimate, FitDir, Json, Quiet, Set, StudyConfig, overrides, warn


def design(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for commands.csv, table and figures.")],
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[LOG.csv...]", help="Logs that are there already: what they tell counts."),
    ] = None,
    fit: FitDir = None,
    params: Estimate = None,
    config: StudyConfig = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Length of the experiment.")] = None,
    joints: Annotated[
        str | None, typer.Option(metavar="2,3", help="Joints that may be driven [default: the outputs].")
    ] = None,
    criterion: Annotated[
        str | None, typer.Option(metavar="E|D", help="E: the weakest direction; D: all on average.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same experiment.")] = 1,
    setting: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Choose start pose, joints and commands that tell most about what is known least.

    The limits (design.speed_deg_s, design.margin_deg, design.command_pct) are checked on the simulated
    response only. The machine moves otherwise as far as it differs from the model, and collisions are not
    looked for: watch the first run with a hand on the stop. What the outputs are, and which parameters are
    free, says the config; its section `design` has the rest.
    """
    from hydroid.studies import load_subject, study_design

    changes = overrides(setting)
    flags: dict[str, Any] = {"duration_s": duration, "criterion": criterion, "joints": _numbers(joints)}
    changes |= {f"design.{key}": value for key, value in flags.items() if value is not None}
    subject = load_subject(config, fit, params, changes)
    with Line(quiet=quiet or json) as line:
        table = study_design(subject, logs or [], out, seed, warn, line)
    if json:
        typer.echo(jsonlib.dumps(table.records()))
    elif not quiet:
        table.show()
        typer.echo(str(out / "commands.csv"))


def _numbers(text: str | None) -> list[int | str] | None:
    """Joints as numbers; what is none is left for the settings to refuse."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    return [int(part) if part.isdigit() else part for part in parts]
