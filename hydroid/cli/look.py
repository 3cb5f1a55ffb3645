"""`hydroid check`, `view` and `plot-actuator`."""

import os
import sys
from ctypes.util import find_library
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import Config, Folder, Logs, NominalEstimate, Output, Repair, Set, overrides
from hydroid.cli.output import show

if TYPE_CHECKING:
    from hydroid.api.look import LogCheck
    from hydroid.identified import IdentifiedModel


def check(
    logs: Logs, output: Output, config: Config = "fit-mech", setting: Set = None, repair: Repair = False
) -> None:
    """List the faults of logs and anything unusual in them. The exit status is 2 if a log is unusable."""
    from hydroid.api.look import check, load_settings

    results = check(logs, load_settings(config, overrides(setting)), repair=repair)
    lines = [line for result in results for line in _lines(result)]
    show(output, lambda: {"logs": [_plain(result) for result in results]}, lines)
    if any(result.log is None for result in results):
        raise typer.Exit(2)


def view(
    estimate: NominalEstimate,
    output: Output,
    log: Annotated[
        Path | None,
        typer.Argument(metavar="LOG.csv", help="Log whose commands drive the arm [default: the sliders]."),
    ] = None,
    pose: Annotated[
        str | None, typer.Option(help="Name of the start pose in the arm's file [default: start of the log].")
    ] = None,
    gif: Annotated[
        Path | None, typer.Option(metavar="OUT.gif", help="Write the motion to a GIF instead of a window.")
    ] = None,
    repair: Repair = False,
) -> None:
    """Show the moving arm in MuJoCo's viewer, in real time.

    Without a log, the sliders in the panel "Control" on the right set the commands in %. Backspace restarts.
    """
    if gif is not None:
        _render_without_display()
    from hydroid.api.look import view

    try:
        view(_model(estimate, output), log, pose=pose, gif=gif, repair=repair)
    except KeyboardInterrupt:
        if gif is not None:
            raise
        return  # as good as closing the window
    if gif is not None:
        show(output, lambda: {"out": str(gif)}, [str(gif)])


def plot_actuator(
    estimate: NominalEstimate,
    output: Output,
    joint: Annotated[int, typer.Option(help="Number of the joint: 1 azimuth, 2 shoulder ...")] = 2,
    out: Folder = Path("runs/actuator"),
) -> None:
    """Draw the curves of an actuator: calibration, current, force, spool, opening, flow and torque."""
    from hydroid.api.look import plot_actuator

    files = plot_actuator(_model(estimate, output), joint, out)
    show(output, lambda: {"files": [str(file) for file in files]}, [str(files[-1])])


def _model(estimate: NominalEstimate, output: Output) -> "IdentifiedModel":
    from hydroid.identified import load_identified

    changes = overrides(estimate.setting)
    model = load_identified(estimate.fit, estimate.config, changes, default="fit-hyd", nominal=True)
    if model.nominal and not output.silent:
        which = ", ".join(model.nominal) if estimate.fit else "all parameters"
        typer.echo(f"hydroid: note: nominal values for {which}", err=True)
    return model


def _lines(result: "LogCheck") -> list[str]:
    lines = [f"{finding.level}: {finding}" for finding in result.findings]
    if result.log is not None:
        samples, seconds = len(result.log.time), result.log.duration
        driven = ", ".join(map(str, _driven(result))) or "none"
        lines.append(f"{result.path}: {samples} samples, {seconds:.2f} s, driven joints: {driven}")
    return lines


def _plain(result: "LogCheck") -> dict[str, Any]:
    findings = [{"level": f.level, "what": f.what, "where": f.where, "hint": f.hint} for f in result.findings]
    used = result.log is not None
    return {
        "log": str(result.path),
        "usable": used,
        "samples": len(result.log.time) if result.log else None,
        "duration_s": float(result.log.duration) if result.log else None,
        "driven_joints": _driven(result),
        "findings": findings,
    }


def _driven(result: "LogCheck") -> list[int]:
    return [] if result.log is None else [j + 1 for j, driven in enumerate(result.log.driven) if driven]


def _render_without_display() -> None:
    """Choose a way to render that needs no window; MuJoCo asks for it when it is imported."""
    for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if sys.platform == "linux" and find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)
