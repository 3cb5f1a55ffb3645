"""`hydroid view`: the arm in motion under its hydraulics."""

import os
import sys
from ctypes.util import find_library
from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import ActuatorConfig, Params, Quiet, Set, overrides, warn


def view(
    log: Annotated[
        Path | None, typer.Argument(metavar="LOG.csv", help="Commands; without one, the viewer's sliders.")
    ] = None,
    params: Params = None,
    config: ActuatorConfig = None,
    pose: Annotated[
        str | None, typer.Option(help="Start pose of the arm's file [default: the log's first angles].")
    ] = None,
    gif: Annotated[
        Path | None, typer.Option(metavar="OUT.gif", help="Write the motion to a file; needs no display.")
    ] = None,
    setting: Set = None,
    quiet: Quiet = False,
) -> None:
    """Show the arm under its hydraulics in MuJoCo's viewer, in real time.

    The motor sliders of the right panel ("Control") are the commands in %; Backspace starts again.
    """
    from hydroid.errors import SettingsError

    if gif is not None:
        if log is None:
            raise SettingsError("needs a LOG.csv: a file has no sliders", where="--gif")
        _render_without_display()
    from hydroid.identified import load_identified
    from hydroid.viewer.show import animate, view

    chosen = load_identified(params, config, overrides(setting), default="fit-hyd", nominal=True)
    if chosen.nominal and not quiet:
        which = ", ".join(chosen.nominal) if params else "all parameters"
        typer.echo(f"hydroid: note: nominal values for {which}", err=True)
    if gif is None or log is None:
        try:
            view(chosen, log, pose, warn)
        except KeyboardInterrupt:
            return  # as good as closing the window
    else:
        animate(chosen, log, pose, gif, warn)
        if not quiet:
            typer.echo(str(gif))


def _render_without_display() -> None:
    """Choose a way to render that needs no window; MuJoCo asks for it when it is imported."""
    for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if sys.platform == "linux" and find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)
