"""Writing a project, all of its files or none, and the commands that come next."""

import os
import shlex
import tempfile
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydroid.arrays import Limits, record
from hydroid.cad.importer import ImportedArm, import_arm
from hydroid.cad.meshes import MESHES
from hydroid.errors import HydroidError, SettingsError
from hydroid.files import Plain, fill_template, undisturbed, write_atomic, writing
from hydroid.log import Table, open_table
from hydroid.log.mapping import angle_margin
from hydroid.progress import Progress, no_progress
from hydroid.project.boxes import boxes_urdf, moves_as
from hydroid.project.layout import Layout, find_layout
from hydroid.project.logs import UNUSABLE, Others
from hydroid.project.texts import JointSize, arm_text, fit_text, joint_sizes
from hydroid.reporting.figure import arm_picture
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.load import load, validate
from hydroid.words import listed

ARM = "arm.yaml"
MODEL = "arm.xml"
PICTURE = "arm.png"
FIT = "fit.yaml"
STEPS = "next-steps.md"
OLD = "fit.old.yaml"
BEYOND = 0.05
"""part of what logs reach, by which a range that nobody has given goes beyond"""
FILES = (ARM, MODEL, PICTURE, FIT, STEPS, OLD, MESHES)


@record
class Project:
    """A project that was written: its folder, and the names of its files and folders
    there.

    `notes`: what the import assumed; `columns`: what each of the log is taken for;
    `unused`: the others; `missing`: which columns of the log a person must name in the
    settings, empty if none.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...]
    columns: tuple[str, ...]
    unused: tuple[str, ...]
    commands: tuple[str, ...]
    missing: str = ""

    @property
    def unusable(self) -> bool:
        """Whether the first log must be mended before it can be fitted; one of
        `columns` says why."""
        return any(reason.startswith(UNUSABLE) for reason in self.columns)


def write_project(
    folder: Path,
    robot: Path | None,
    logs: Sequence[Path],
    joints: Sequence[str],
    progress: Progress = no_progress,
    **options: Any,
) -> Project:
    """Write a project to a folder, new or with other things in it (`hydroid.init` says
    what is given)."""
    _refuse_replacing(folder, FILES, force=options.pop("force", False))
    lengths = options.pop("lengths", ())
    table = None
    if logs:
        table = open_table(logs[0], progress=progress)
    has_own_file = robot is not None and robot.suffix.lower() in (".yaml", ".yml")
    imported = None
    if robot is not None and not has_own_file:
        imported = import_arm(robot, table.names if table else (), **options)
    elif lengths:
        imported = _arm_of_boxes(joints, lengths, options, {})
    # all is written aside and read back, so that the folder has all of a project or
    # nothing
    with _stage(folder) as stage, _of_the_project(stage, folder, robot):
        if robot is not None and has_own_file:
            reference = _seen_from(folder, robot)
            arm = load_arm(robot)
        else:
            reference = ARM
            arm = _write_arm(stage, imported)
        layout = _layout(table, arm, joints, logs, progress, in_range=not lengths)
        wider = _wider(arm, layout)
        if lengths and wider:
            imported = _arm_of_boxes(joints, lengths, options, wider)
            arm = _write_arm(stage, imported)
            layout = _layout(table, arm, joints, logs, progress, in_range=False)
        sizes = _sizes(arm, layout)
        notes = list[str]()
        if imported is not None:
            # again, with the actuators' sizes by the speeds that the log shows
            arm = _write_arm(stage, imported, arm, sizes)
            notes += [*imported.notes, *_stand_ins(arm)]
        steps = _steps(folder, logs, layout)
        text = fit_text(arm, layout, sizes, str(folder / FIT), reference, steps[0])
        _write_settings(stage, arm, text)
        return _finished(stage, folder, arm.name, layout, notes, steps)


def _layout(
    table: Table | None,
    arm: Arm,
    joints: Sequence[str],
    logs: Sequence[Path],
    progress: Progress,
    *,
    in_range: bool,
) -> Layout:
    """Return what logs hold, the first of which is the table."""
    others = Others(_fitted(logs)[1:], _unseen(logs), in_range)
    return find_layout(table, arm, joints, others=others, progress=progress)


def _wider(arm: Arm, layout: Layout) -> dict[str, Limits]:
    """Return the ranges [rad, m] of joints whose logs leave what is guessed: what the
    logs reach, and a little more."""
    wider = dict[str, Limits]()
    for number, (low, high) in layout.reach.items():
        joint = arm.joint(number)
        least, most = joint.limits
        margin = angle_margin(least, most)
        if low < least - margin or high > most + margin:
            more = BEYOND * (high - low)
            wider[joint.name] = low - more, high + more
    return wider


def _arm_of_boxes(
    joints: Sequence[str],
    lengths: Sequence[float],
    options: Plain,
    wider: Mapping[str, Limits],
) -> ImportedArm:
    """Import an arm of boxes as if a person had drawn it; `wider`: ranges of joints that
    the logs tell [rad, m]."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "boxes.urdf"
        write_atomic(path, boxes_urdf(joints, lengths, wider))
        imported = import_arm(path, **options)
    moves = listed([*map(moves_as, joints, lengths)])
    what = f"the arm is made of boxes of these lengths: {moves}"
    notes = [f"{what}. Its masses and ranges are guesses; mend them in arm.xml"]
    if wider:
        sign = "positive angles lift; if yours lower, set scale: -1 at the angle"
        notes.append(f"{listed([*wider])}: the range is what the logs reach; {sign}")
    return replace(imported, notes=(*notes, *imported.notes))


def _sizes(arm: Arm, layout: Layout) -> tuple[JointSize, ...]:
    """Return the sizes of what moves the joints, by the speeds that the logs show."""
    return joint_sizes(
        arm, {joint: motion.speed for joint, motion in layout.motions.items()}
    )


def _stand_ins(arm: Arm) -> Iterator[str]:
    """Yield which joints have a stand-in for a cylinder that nobody has named."""
    names = [
        joint.name for joint in arm.joints if isinstance(joint.actuator, RotaryActuator)
    ]
    if names:
        what = "no cylinder is known. A stand-in predicts angles"
        yield f"{listed(names)}: {what}; its pressures and forces mean nothing"


def go_on(
    folder: Path | None,
    config: Path,
    logs: Sequence[Path],
    progress: Progress = no_progress,
    *,
    force: bool,
) -> Project:
    """Write the settings anew, with starts from the logs,
    whose columns a person has named in `config`.

    Its arm stays as it is. Settings that are replaced are kept as OLD.
    """
    values, _ = read_yaml(config)
    if not values.get("log"):
        hint = "name the log's columns there: take the comment signs of its lines away"
        raise SettingsError("has no log section", config, hint)
    if not logs:
        raise SettingsError("needs the log", "--config", "give --log LOG")
    settings = load(config, FitSettings)
    arm = settings.arm
    folder = folder or config.parent
    replaces_config = config.resolve() == (folder / FIT).resolve()
    _refuse_replacing(folder, (FIT, STEPS, PICTURE), force=force or replaces_config)
    table = open_table(logs[0], settings.log, progress)
    others = Others(_fitted(logs)[1:], _unseen(logs))
    layout = find_layout(
        table, arm, given=settings.log, others=others, progress=progress
    )
    steps = _steps(folder, logs, layout)
    reference = _seen_from(folder, Path(arm.where))
    text = fit_text(
        arm, layout, _sizes(arm, layout), str(folder / FIT), reference, steps[0]
    )
    with _stage(folder) as stage, _of_the_project(stage, folder, config):
        if replaces_config:
            write_atomic(stage / OLD, config.read_bytes())
        _write_settings(stage, arm, text)
        return _finished(stage, folder, arm.name, layout, (), steps)


def _refuse_replacing(folder: Path, names: Sequence[str], *, force: bool) -> None:
    taken = [name for name in names if os.path.lexists(folder / name)]
    if taken and not force:
        hint = "name another folder, or replace the project's files with --force"
        raise SettingsError(f"holds {taken[0]} already", folder, hint)


def _seen_from(folder: Path, file: Path) -> str:
    return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()


def _fitted(logs: Sequence[Path]) -> Sequence[Path]:
    """Return the logs that are fitted: of several the last is kept to validate on."""
    return logs[:-1] or logs


def _unseen(logs: Sequence[Path]) -> Path | None:
    """Return the log that is kept to validate on; None: there is one log only."""
    if len(logs) > 1:
        return logs[-1]
    return None


def _steps(folder: Path, logs: Sequence[Path], layout: Layout) -> tuple[str, ...]:
    """Return the commands that come next, of logs that can be read."""
    logs = [log for log in logs if log not in layout.left_out]
    names = [shlex.quote(str(log)) for log in logs or ("LOG.csv", "OTHER.csv")]
    home = shlex.quote(str(folder))
    config = f"--config {home}/fit.yaml"
    if layout.missing:
        given = [f"--log {name}" for name in names]
        return (" ".join([f"hydroid init {config}", *given]),)
    *fitted, other = names
    # a single log is fitted, and another one is still to be recorded
    if not fitted:
        fitted = names
        other = "OTHER.csv"
    fitted_logs = " ".join(fitted)
    run = f"{home}/runs/fit"
    return (
        f"hydroid check {' '.join(names)} {config}",
        f"hydroid fit-hyd {fitted_logs} {config} --out {run}",
        f"hydroid validate {other} --fit {run} --out {home}/runs/validation",
        f"hydroid suggest {fitted_logs} --fit {run} --out {home}/runs/suggestions",
    )


def _write_settings(stage: Path, arm: Arm, text: str) -> None:
    """Write the settings of a fit, which can be read, and the picture of the arm."""
    write_atomic(stage / FIT, text)
    values, _ = read_yaml(stage / FIT)
    validate(values | {"arm": arm}, FitSettings, FIT)
    caption = f"{arm.name}, all joints at or near 0: does it look and turn like yours?"
    write_atomic(stage / PICTURE, arm_picture(arm, caption))


def _finished(
    stage: Path,
    folder: Path,
    name: str,
    layout: Layout,
    notes: Sequence[str],
    steps: tuple[str, ...],
) -> Project:
    """Write the next steps, and move all to the folder."""
    text = fill_template(
        "project/next-steps.md.j2",
        name=name,
        steps=steps,
        notes=notes,
        reasons=layout.reasons,
        missing=layout.missing,
    )
    write_atomic(stage / STEPS, text)
    written = _move(stage, folder)
    return Project(
        folder=folder,
        files=written,
        notes=tuple(notes),
        columns=layout.reasons,
        unused=layout.unused,
        commands=steps,
        missing=layout.missing,
    )


@contextmanager
def _of_the_project(stage: Path, folder: Path, source: Path | None) -> Generator[None]:
    """Let errors name the source in place of a file that was to be written and is
    gone."""
    try:
        yield
    except HydroidError as error:
        if str(stage) not in str(error):
            raise
        what = error.what.replace(str(stage), str(folder))
        hint = error.hint.replace(str(stage), str(folder))
        raise type(error)(what, source or folder, hint) from None


def _write_arm(
    stage: Path,
    imported: ImportedArm | None,
    arm: Arm | None = None,
    sizes: Sequence[JointSize] = (),
) -> Arm:
    files: dict[str, Any]
    if imported is None:
        files = {
            MODEL: fill_template("project/boxes.xml.j2"),
            ARM: fill_template("project/boxes.yaml"),
        }
    else:
        files = {
            MODEL: imported.mjcf,
            ARM: arm_text(imported, arm, sizes),
            **imported.meshes,
        }
    for name, content in files.items():
        write_atomic(stage / name, content)
    return load_arm(stage / ARM)


@contextmanager
def _stage(folder: Path) -> Generator[Path]:
    """Make a folder beside the project, or in it where it exists, that disappears."""
    home = next(filter(Path.is_dir, (folder.absolute(), *folder.absolute().parents)))
    with writing(folder):
        stage = tempfile.TemporaryDirectory(
            prefix=".hydroid-init-", dir=home, ignore_cleanup_errors=True
        )
    with stage as name:
        yield Path(name)


def _move(stage: Path, folder: Path) -> tuple[str, ...]:
    """Move all files of a project to its folder, or none; return their names."""
    names = tuple(name for name in FILES if (stage / name).exists())
    old = stage / "old"
    old.mkdir()
    with undisturbed(), writing(folder):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name in names:
                # a file of an earlier project
                if os.path.lexists(folder / name):
                    os.rename(folder / name, old / name)
                os.rename(stage / name, folder / name)
        except OSError:
            for name in names:
                _move_back(folder / name, stage / name)
                _move_back(old / name, folder / name)
            raise
    return names


def _move_back(now: Path, before: Path) -> None:
    """Move a file to where it was, if it has moved."""
    if os.path.lexists(now) and not os.path.lexists(before):
        os.rename(now, before)
