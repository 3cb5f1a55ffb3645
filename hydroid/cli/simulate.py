"""`hydroid simulate`: what the model does under given commands."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Quiet, Set, overrides, warn


def simulate(
    commands: Annotated[
        Path, typer.Argument(metavar="COMMANDS.csv", help="Commands; angles give the start pose.")
    ],
    params: Annotated[
        Path, typer.Option(metavar="P.yaml", help="Parameter values, or a fit's estimate.yaml.")
    ],
    out: Annotated[Path, typer.Option(metavar="LOG.csv", help="The log to write.")],
    config: Annotated[
        str | None, typer.Option(help="Settings [default: those beside estimate.yaml, or fit-mech].")
    ] = None,
    pose: Annotated[
        str | None, typer.Option(help="Start pose of the arm's file, for commands without angles.")
    ] = None,
    noise_deg: Annotated[
        float, typer.Option(min=0, max=90, help="Gaussian noise added to the angles.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    trace: Annotated[
        Path | None,
        typer.Option(metavar="CSV", help="Write pressures, flows, spool and force too (stage hyd)."),
    ] = None,
    setting: Set = None,
    quiet: Quiet = False,
) -> None:
    """Simulate commands with given parameters and write a log: a prediction, or data to test a fit with."""
    from hydroid.identified import load_identified
    from hydroid.simulating import simulate_file

    model = load_identified(params, config, overrides(setting))
    simulate_file(
        model.settings,
        commands,
        model.values,
        model.source,
        out,
        warn,
        pose=pose,
        noise_deg=noise_deg,
        seed=seed,
        trace=trace,
    )
    if not quiet:
        typer.echo(str(out))
