"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

Logs = Annotated[
    list[Path], typer.Argument(metavar="LOG.csv...", help="Logs: commands [%] and joint angles.")
]
Config = Annotated[str, typer.Option(help="Settings: a YAML file, or the name of a shipped one.")]
ActuatorConfig = Annotated[
    str | None, typer.Option("--config", help="Settings [default: those beside the parameters, or fit-hyd].")
]
Params = Annotated[
    Path | None,
    typer.Option(
        "--params",
        "--fit",
        metavar="P",
        help="Run folder of fit-hyd, its estimate.yaml, or values by name [default: nominal values].",
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace one setting, such as search.ga.generations=80."),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="local[:N]|slurm|ADDRESS",
        help="Simulate in N processes of this machine, in Slurm jobs (settings: cluster), or on the workers "
        "of a Dask scheduler (address or scheduler file). The result is the same.",
    ),
]
DaskInsecure = Annotated[
    bool,
    typer.Option(
        "--dask-insecure",
        help="Accept a --dask address without TLS: anyone who reaches its port can run code as you.",
    ),
]


def _renamed(value: str | None) -> None:
    if value is not None:
        raise typer.BadParameter(f"is now --dask local:{value}")


Workers = Annotated[str | None, typer.Option("--workers", hidden=True, callback=_renamed)]
FitDir = Annotated[
    Path | None, typer.Option("--fit", metavar="DIR", help="Run folder of a fit: its estimate and settings.")
]
Estimate = Annotated[
    Path | None, typer.Option("--params", metavar="P.yaml", help="Values by name, instead of --fit.")
]
StudyConfig = Annotated[
    str | None,
    typer.Option("--config", help="Settings [default: the fit's, those beside the values, or fit-mech]."),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, for scripts.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Print nothing but errors.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Show the lines of run.log as they come.")]
Repair = Annotated[bool, typer.Option(help="Fill short gaps of the logs, and say how many.")]


def overrides(texts: list[str] | None) -> dict[str, Any]:
    """Read the `--set` options, by key."""
    from hydroid.settings.load import parse_override

    return dict(parse_override(text) for text in texts or [])


def warn(finding: object) -> None:
    """Print a finding about a log."""
    typer.echo(f"hydroid: {getattr(finding, 'level', 'note')}: {finding}", err=True)
