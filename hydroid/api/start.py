"""Start with your own arm and log: `init` writes a project."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.errors import SettingsError
from hydroid.files import is_file

if TYPE_CHECKING:
    from hydroid.project import Project


def init(
    folder: str | Path,
    arm: str | Path | None = None,
    logs: Sequence[str | Path] = (),
    *,
    joints: Sequence[str] = (),
    tip: str | None = None,
) -> "Project":
    """Write a project that runs: arm file, model, settings of a fit, a picture of the arm, next steps.

        project = hydroid.init("mine", "robot.urdf", ["a.csv", "b.csv"])
        print(*project.notes, *project.columns, *project.commands, sep="\\n")

    Args:
        folder: where; what is there is not overwritten.
        arm: its URDF or MJCF, or an arm's YAML file; None: a template of boxes to be filled in.
        logs: the columns are guessed from the first. Of several, the next steps keep the last to validate on.
        joints: names of the arm's joints as the log counts them, where its columns have numbers in another
            order than the arm.
        tip: name of the link at which the arm ends, where the file's joints branch; None: the branch that the
            log names, or the longest.

    Raises:
        SettingsError: a file of the project is there already, or no joint has one of the names.
        ModelError, MeshError: the arm's file cannot be used. LogError: the first log cannot.
        RunError: the folder cannot be written.
    """
    for path in (*logs, *([] if arm is None else [arm])):
        if not is_file(Path(path)):
            raise SettingsError("no such file", where=str(path))
    from hydroid.project import Sources, write_project

    robot = None if arm is None else Path(arm)
    return write_project(Path(folder), Sources(robot, tuple(map(Path, logs)), tuple(joints), tip))
