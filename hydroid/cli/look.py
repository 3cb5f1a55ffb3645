"""`hydroid check` and `plot-actuator`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import (
    Config,
    Folder,
    Logs,
    NominalEstimate,
    Output,
    Repair,
    Set,
    nominal_model,
    overrides,
)
from hydroid.cli.output import show

if TYPE_CHECKING:
    from hydroid.api.look import Check, LogCheck
    from hydroid.log import LogFinding


def check(
    logs: Logs, output: Output, config: Config = "fit-mech", setting: Set = None, repair: Repair = False
) -> None:
    """List the faults of logs, anything unusual in them, and the commands that none of them has.

    A finding shared by several logs is listed once. The exit status is 2 if a log is unusable.
    """
    from hydroid.api.look import check, load_settings

    result = check(logs, load_settings(config, overrides(setting)), repair=repair)
    plain = {"logs": [_plain(log) for log in result.logs], "findings": [*map(plain_finding, result.findings)]}
    show(output, lambda: plain, check_lines(result))
    if any(log.log is None for log in result.logs):
        raise typer.Exit(2)


def plot_actuator(
    estimate: NominalEstimate,
    output: Output,
    joint: Annotated[int, typer.Option(help="Number of the joint: 1 azimuth, 2 shoulder ...")] = 2,
    out: Folder = Path("runs/actuator"),
) -> None:
    """Draw the curves of an actuator: calibration, current, force, spool, opening, flow and torque."""
    from hydroid.api.look import plot_actuator

    files = plot_actuator(nominal_model(estimate, output), joint, out)
    show(output, lambda: {"files": [str(file) for file in files]}, [str(files[-1])])


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


def plain_finding(finding: "LogFinding") -> dict[str, str]:
    """Return a finding as JSON holds it."""
    names = ("level", "kind", "what", "where", "hint")
    return {name: getattr(finding, name) for name in names}


def _driven(result: "LogCheck") -> list[int]:
    return [] if result.log is None else [j + 1 for j, driven in enumerate(result.log.driven) if driven]
