"""`hydroid init`: a project for your own arm and log."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result
from hydroid.commands.inputs import Source, as_list, command, names
from hydroid.commands.progress import Progress
from hydroid.errors import SettingsError
from hydroid.files import Plain, is_file

if TYPE_CHECKING:
    from hydroid.project.project import Project


@command
def init(
    folder: "Source | None" = None,
    *,
    arm: "Source | None" = None,
    log: "Source | Sequence[Source] | None" = None,
    config: "Source | None" = None,
    joints: str | list[str] | None = None,
    lengths: str | list[str] | None = None,
    tip: str | None = None,
    total_mass: float | None = None,
    force: bool = False,
) -> "Result[Project]":
    """Write a project for your arm and your log: all files that a fit needs.

    The project holds the arm's file and model, the settings of a fit, a picture in which
    you can check the arm, and the commands to run next. Start values of the parameters, and
    priors (their likely values and standard deviations), come from the arm's size.

    If it does not recognise the columns of a log, it lists them in the project's
    fit.yaml, and the exit status is 2. Write there what each column is. Then run init
    again with --config. The status is 2, too, if the first log cannot be used as it is:
    a line says what to mend.

    Example: hydroid init mine --arm robot.urdf --log a.csv

        project = hydroid.init("mine", arm="robot.urdf", log=["a.csv", "b.csv"]).result
        print(*project.notes, *project.columns, *project.commands, sep="\\n")

    Args:
        folder (DIR): Folder of the project, new or not [default: the folder
            of the file --config].
        arm (robot.urdf): URDF or MJCF of the arm, or an arm's YAML file [default: a
            template of boxes].
        log (LOG): A log; its columns are guessed. Repeat the option for several logs.
            The commands that init prints fit all of them but the
            last, and then test the fit on the last.
        config (YAML): The fit.yaml of an earlier init, whose `log` section you have
            completed. Its columns and its arm stay; all other settings are written
            anew.
        joints (NAME,NAME): The joints of the commands u1, u2, ... in the log, in this order, by
            name or number from 1 [default: the order in the arm's file].
        lengths (M,M): Lengths [m] of the links that these joints move, if you have no file
            for --arm: hydroid makes an arm of boxes. Example: --joints
            swing,boom,arm,bucket --lengths 0,3.7,1.6,0.9. The length is 0 for a joint that slews.
        total_mass (KG): Mass of all moving links together [kg]. The masses of the arm's
            file are scaled to it.
        force: Replace the files of an earlier project in the folder.
        tip (LINK): Last link of the arm, if the robot has several branches [default:
            the end of the branch with the log's joints, or else of the longest branch].

    Raises:
        SettingsError: a file of the project is there already, or no joint has one of
            the names.
        ModelError, MeshError: the arm's file cannot be used.
        LogError: the first log cannot, or no joint is driven and moves in the logs.
        RunError: the folder cannot be written.
    """
    logs = [_existing(path) for path in as_list(log)]
    robot = None if arm is None else _existing(arm)
    kept_config = None if config is None else _existing(config)
    from hydroid.project.project import go_on, write_project

    with Progress() as progress:
        if kept_config is not None:
            if any((robot, joints, lengths, tip, total_mass is not None)):
                hint = "leave --arm, --joints, --lengths, --tip and --total-mass out"
                raise SettingsError(
                    "names its arm, which stays as it is", kept_config, hint
                )
            where = Path(folder) if folder else None
            project = go_on(where, kept_config, logs, progress, force=force)
        else:
            _refuse_two_arms(robot, lengths)
            project = write_project(
                _required(folder),
                robot,
                logs,
                names(joints),
                progress,
                tip=tip,
                total_mass=total_mass,
                force=force,
                lengths=_numbers(names(lengths)),
            )
    content: Plain = {"out": str(project.folder), "missing": project.missing or None}
    for key in ("files", "notes", "columns", "unused", "commands"):
        content[key] = [*getattr(project, key)]
    lines = _lines(project, guessed=kept_config is None)
    is_ready = not (project.missing or project.unusable)
    return Result(lines, content, project, exit_status=0 if is_ready else 2)


def _refuse_two_arms(robot: Path | None, lengths: str | list[str] | None) -> None:
    if robot is not None and lengths:
        what = "are those of the arm's file"
        raise SettingsError(what, "--lengths", "leave it out, or --arm")


def _required(folder: "Source | None") -> Path:
    if folder is None:
        what = "which folder shall the project have?"
        raise SettingsError(what, hint="hydroid init DIR")
    return Path(folder)


def _existing(given: "Source") -> Path:
    """Return a path that is a file, or a ROS 2 bag, which is a folder."""
    path = Path(given)
    if is_file(path) or is_file(path / "metadata.yaml"):
        return path
    raise SettingsError("no such file", path)


def _lines(project: "Project", *, guessed: bool) -> list[str]:
    """Return what was written, what was found, and the commands to run next.

    `guessed`: nobody has named the log's columns.
    """
    if project.missing:
        columns = "Of the log's columns:"
        settings = project.folder / "fit.yaml"
        look = (
            f"The log cannot be fitted yet: {project.missing}. "
            f"Complete the log section of {settings}, which lists the columns, then:"
        )
    else:
        columns = "Of the log, by the columns that you gave:"
        if guessed:
            columns = (
                "The log's columns, guessed. Check them, and correct them in fit.yaml:"
            )
        picture = project.folder / "arm.png"
        mend = ""
        if project.unusable:
            # no range, start or sign is known of a log that cannot be read
            mend = "mend the log, as it says above, repeat init with --force, and "
        look = (
            f"Next: {mend}look at {picture}, then (--budget 5min stops a fit at its best model "
            "after 5 min on the clock; --resume gives it 5 more):"
        )
    lines = [f"{project.folder}: {', '.join(project.files)}"]
    sections = {
        "The arm:": project.notes,
        columns: project.columns,
        look: project.commands,
    }
    for heading, section in sections.items():
        if section:
            lines += ["", heading]
            lines += [f"  {line}" for line in section]
    return lines


def _numbers(texts: Sequence[str]) -> tuple[float, ...]:
    """Return the numbers in texts."""
    try:
        return tuple(float(text) for text in texts)
    except ValueError:
        what = f"{','.join(texts)!r} holds something else than numbers"
        raise SettingsError(what, "--lengths", "such as 0,3.7,1.6,0.9") from None
