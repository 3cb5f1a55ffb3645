"""`hydroid plot-actuator`: what the parameters of an actuator mean, as curves."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import ActuatorConfig, Params, Quiet, Set, overrides


def plot_actuator(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures.")],
    params: Params = None,
    config: ActuatorConfig = None,
    joint: Annotated[int, typer.Option(help="Joint, 1 = azimuth, 2 = shoulder ...")] = 2,
    setting: Set = None,
    quiet: Quiet = False,
) -> None:
    """Draw an actuator's calibration, current, force, spool, opening, flow and torque; a page and files."""
    from hydroid.identified import load_identified
    from hydroid.simulating import plot_actuator

    chosen = load_identified(params, config, overrides(setting), default="fit-hyd", nominal=True)
    files = plot_actuator(chosen, joint, out)
    if not quiet:
        typer.echo(str(files[-1]))
