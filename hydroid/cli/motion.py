"""`hydroid view`, `render` and `collisions`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import (
    Arm,
    Config,
    Folder,
    NominalEstimate,
    Output,
    Repair,
    Set,
    nominal_model,
    overrides,
)
from hydroid.cli.output import show
from hydroid.cli.progress import Progress

if TYPE_CHECKING:
    from hydroid.arm.collision import Clearance
    from hydroid.identified_model import IdentifiedModel

Source = typer.Argument(
    metavar="RUN|LOG.csv", help="A run folder, whose first log drives the arm; or a log, with --fit."
)


def view(
    estimate: NominalEstimate,
    output: Output,
    source: Annotated[Path | None, Source] = None,
    arm: Arm = None,
    pose: Annotated[
        str | None,
        typer.Option(help="Name of the start pose in the arm's file [default: the first angles of the log]."),
    ] = None,
    repair: Repair = False,
) -> None:
    """Show the moving arm in MuJoCo's viewer, in real time, beside the ghost of the measured one.

    Without a log, the sliders in the panel "Control" on the right set the commands in %. Backspace restarts.
    """
    from hydroid.api.motion import view

    model, log = _model_and_log(source, estimate, output)
    try:
        view(model, log, arm=arm, pose=pose, repair=repair)
    except KeyboardInterrupt:
        return  # as good as closing the window


def render(
    source: Annotated[Path, Source],
    estimate: NominalEstimate,
    output: Output,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="OUT.mp4|gif|png", help="The film or picture to write.")
    ] = Path("runs/arm.mp4"),
    arm: Arm = None,
    span: Annotated[
        str, typer.Option(metavar="FROM:TO", help="Part of the log [s], such as 10:20 [default: all of it].")
    ] = "",
    repair: Repair = False,
) -> None:
    """Render the moving arm beside the ghost of the measured one, with commands, angles and pressures.

    Writes a film (mp4, gif) or several moments (png). Needs no display, but OpenGL by EGL or OSMesa.
    """
    from hydroid.viewer.opengl import choose_platform

    choose_platform()
    from hydroid.api.motion import render

    model, log = _model_and_log(source, estimate, output)
    with Progress(quiet=output.silent) as progress:
        render(model, out, log, arm=arm, span=_span(span), repair=repair, progress=progress)
    show(output, lambda: {"out": str(out)}, [str(out)])


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


def _model_and_log(
    source: Path | None, estimate: NominalEstimate, output: Output
) -> "tuple[IdentifiedModel, Path | None]":
    """Return a run with its first log, or the model of --fit with the log that is named."""
    from hydroid.api.plan import run_logs
    from hydroid.errors import SettingsError

    if source is None or not (source / "run.json").is_file():
        return nominal_model(estimate, output), source
    if estimate.fit is not None:
        hint = f"name a log, or leave out --fit {estimate.fit}"
        raise SettingsError("is a run itself", where=str(source), hint=hint)
    estimate.fit = source
    return nominal_model(estimate, output), run_logs(source)[0]


def _span(text: str) -> tuple[float, float]:
    from hydroid.errors import SettingsError

    begin, _, end = text.partition(":")
    try:
        return float(begin or 0.0), float(end or "inf")
    except ValueError:
        raise SettingsError(f"{text!r} is no span", where="--span", hint="write FROM:TO in seconds") from None


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
