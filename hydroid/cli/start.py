"""`hydroid init`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Output, names
from hydroid.cli.output import show


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the project, new or not.")],
    output: Output,
    arm: Annotated[
        Path | None,
        typer.Option(
            metavar="robot.urdf",
            help="URDF or MJCF of the arm, or an arm's YAML file [default: a template of boxes].",
        ),
    ] = None,
    log: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG", help="A log; its columns are guessed. Repeat it for several logs."),
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Names of the arm's joints in the order of the log's numbers (u1, u2, ...) [default: the "
            "order in the arm's file].",
        ),
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            metavar="LINK",
            help="Last link of the arm, if the robot has several branches [default: the end of the "
            "branch whose joints the log names, or else of the longest branch].",
        ),
    ] = None,
) -> None:
    """Write a project that runs, from your arm's CAD and your log.

    It has the arm's file and model, settings of a fit with starts and priors from the arm's size, a
    picture to check the arm by, and the commands to run next. Nothing is overwritten.
    """
    from hydroid.api.start import init

    project = init(folder, arm, log or [], joints=names(joints or ""), tip=tip)
    lines = [f"{project.folder}: {', '.join(project.files)}"]
    guessed = "The log's columns, guessed. Check them, and correct them in fit.yaml:"
    for heading, group in (("The arm:", project.notes), (guessed, project.columns)):
        lines += ["", heading, *(f"  {line}" for line in group)] if group else []
    if project.unused:
        lines.append(f"  not used: {', '.join(project.unused)}")
    lines += ["", f"Next: look at {project.folder / 'arm.png'}, then", *(f"  {c}" for c in project.commands)]
    content = {"out": str(folder), "files": project.files, "notes": project.notes}
    more = {"columns": project.columns, "unused": project.unused, "commands": project.commands}
    show(output, lambda: content | more, lines)
