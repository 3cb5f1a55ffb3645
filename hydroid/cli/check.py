"""`hydroid check`: what is odd about a log, before anything is fitted to it."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Config, Repair, Set, overrides


def check(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG.csv...", help="Logs to look at.")],
    config: Config = "fit-mech",
    setting: Set = None,
    repair: Repair = False,
) -> None:
    """List everything that is wrong or odd about logs; exit 2 where one cannot be used."""
    from hydroid.jobs import check_logs, load_settings

    settings = load_settings(config, overrides(setting))
    broken = False
    for path, log, findings in check_logs(logs, settings, repair=repair):
        for finding in findings:
            typer.echo(f"{finding.level}: {finding}")
        if log is None:
            broken = True
        else:
            driven = ", ".join(str(j + 1) for j in range(log.joints) if log.driven[j]) or "none"
            typer.echo(f"{path}: {len(log.time)} samples, {log.duration:.2f} s, driven joints: {driven}")
    if broken:
        raise typer.Exit(2)
