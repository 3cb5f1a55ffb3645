"""`hydroid sensitivity`: what each parameter does to each output against time."""

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.line import Line
from hydroid.cli.options import Estimate, FitDir, Json, Logs, Quiet, Set, StudyConfig, overrides, warn


def sensitivity(
    logs: Logs,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for figures and CSV.")],
    fit: FitDir = None,
    params: Estimate = None,
    config: StudyConfig = None,
    setting: Set = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw how every output depends on every free parameter against time (article, figure 10).

    For each channel: its change per 1 % of each parameter at the estimate, and the response for 20 values of
    each parameter within its bounds (PNG, SVG, CSV).
    """
    from hydroid.studies import load_subject, study_sensitivity

    subject = load_subject(config, fit, params, overrides(setting))
    with Line(quiet=quiet or json) as line:
        table = study_sensitivity(subject, logs, out, warn, line)
    if json:
        typer.echo(jsonlib.dumps(table.records()))
    elif not quiet:
        table.show()
        typer.echo(str(out))
