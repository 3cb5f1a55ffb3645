"""`hydroid check`, `view` and `plot-actuator`."""

import os
import sys
from ctypes.util import find_library
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import Arm, Config, Folder, Logs, NominalEstimate, Output, Repair, Set, overrides
from hydroid.cli.output import show

if TYPE_CHECKING:
    from hydroid.api.look import Check, LogCheck
    from hydroid.arm.collision import Clearance
    from hydroid.identified import IdentifiedModel
    from hydroid.log import Finding


def check(
    logs: Logs, output: Output, config: Config = "fit-mech", setting: Set = None, repair: Repair = False
) -> None:
    """List the faults of logs, anything unusual in them, and what they lack, once for all logs that have it.

    The exit status is 2 if a log is unusable.
    """
    from hydroid.api.look import check, load_settings

    result = check(logs, load_settings(config, overrides(setting)), repair=repair)
    plain = {"logs": [_plain(log) for log in result.logs], "findings": [*map(plain_finding, result.findings)]}
    show(output, lambda: plain, check_lines(result))
    if any(log.log is None for log in result.logs):
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


def collisions(
    trajectory: Annotated[
        Path, typer.Argument(metavar="TRAJECTORY.csv", help="Joint angles over time, such as a log.")
    ],
    output: Output,
    config: Config = "fit-mech",
    setting: Set = None,
    arm: Arm = None,
    out: Folder = Path("runs/collisions"),
    repair: Repair = False,
) -> None:
    """Find which bodies meet along a trajectory, when and how deep, and how near they come otherwise.

    Checks the arm against itself, its base and the floor; with --arm also against the carrier and the other
    arm. The exit status is 0 if nothing meets, 1 if bodies meet, and 2 if the input cannot be used.
    """
    from hydroid.api.arms import collisions
    from hydroid.api.look import load_settings

    settings = load_settings(config, overrides(setting))
    study = collisions(trajectory, settings, out, arm=arm, repair=repair)
    result, lines = study.result, [*study.page.tables.values(), study.page.lead]
    show(output, lambda: _clearance(result), [*lines, str(out / "collisions.html")])
    if result.meetings:
        raise typer.Exit(1)


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


def check_lines(result: "Check") -> list[str]:
    """Return what `check` prints, a line each: findings by level, then the usable logs."""
    from hydroid.log import grouped, in_one_line

    every = [finding for log in result.logs for finding in log.findings]
    findings = sorted([*every, *result.findings], key=lambda f: ("error", "warning", "note").index(f.level))
    lines = [f"{finding.level}: {in_one_line(finding, others)}" for finding, others in grouped(findings)]
    return lines + [_summary(log) for log in result.logs if log.log is not None]


def _summary(result: "LogCheck") -> str:
    assert result.log is not None
    samples, seconds = len(result.log.time), result.log.duration
    driven = ", ".join(map(str, _driven(result))) or "none"
    moved = ", ".join(f"joint {joint} by {deg:.3g} deg" for joint, deg in result.moved_deg.items())
    text = f"{result.path}: {samples} samples, {seconds:.2f} s, driven joints: {driven}"
    return f"{text}; moved: {moved}" if moved else text


def _plain(result: "LogCheck") -> dict[str, Any]:
    return {
        "log": str(result.path),
        "usable": result.log is not None,
        "samples": len(result.log.time) if result.log else None,
        "duration_s": float(result.log.duration) if result.log else None,
        "driven_joints": _driven(result),
        "moved_deg": {str(joint): deg for joint, deg in result.moved_deg.items()},
        "findings": [*map(plain_finding, result.findings)],
    }


def plain_finding(finding: "Finding") -> dict[str, str]:
    """Return a finding as JSON holds it."""
    names = ("level", "kind", "what", "where", "hint")
    return {name: getattr(finding, name) for name in names}


def _clearance(result: "Clearance") -> dict[str, Any]:
    nearest = result.smallest
    return {
        "free": not result.meetings,
        "clearance_m": float(result.distance[nearest]),
        "clearance_at_s": float(result.time[nearest]),
        "clearance_between": list(result.nearest[nearest]),
        "collisions": [
            {
                "bodies": [meeting.first, meeting.second],
                "from_s": meeting.begins,
                "to_s": meeting.ends,
                "depth_m": meeting.depth,
                "deepest_at_s": meeting.deepest,
            }
            for meeting in result.meetings
        ],
        "checked_pairs": result.checked,
        "excluded": [list(pair) for pair in result.excluded],
    }


def _driven(result: "LogCheck") -> list[int]:
    return [] if result.log is None else [j + 1 for j, driven in enumerate(result.log.driven) if driven]


def _render_without_display() -> None:
    """Choose a way to render that needs no window; MuJoCo asks for it when it is imported."""
    for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if sys.platform == "linux" and find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)
