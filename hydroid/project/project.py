"""Writing a project, all of its files or none, and the commands that come next."""

import os
import shlex
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydroid.arrays import record
from hydroid.cad.importer import ImportedArm, import_arm
from hydroid.cad.meshes import MESHES
from hydroid.errors import HydroidError, SettingsError
from hydroid.files import Plain, fill_template, undisturbed, write_atomic, writing
from hydroid.log import open_table
from hydroid.project.boxes import boxes_urdf
from hydroid.project.layout import Layout, find_layout
from hydroid.project.texts import JointSize, arm_text, fit_text, joint_sizes
from hydroid.reporting.figure import arm_picture
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.load import load, validate
from hydroid.words import listed

ARM, MODEL, PICTURE = "arm.yaml", "arm.xml", "arm.png"
FIT, STEPS, OLD = "fit.yaml", "next-steps.md", "fit.old.yaml"
FILES = (ARM, MODEL, PICTURE, FIT, STEPS, OLD, MESHES)


@record
class Project:
    """A project that was written: its folder, and the names of its files and folders there.

    `notes`: what the import assumed; `columns`: what each of the log is taken for; `unused`: the others;
    `missing`: which columns of the log a person must name in the settings, empty if none.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...]
    columns: tuple[str, ...]
    unused: tuple[str, ...]
    commands: tuple[str, ...]
    missing: str = ""


def write_project(
    folder: Path, robot: Path | None, logs: Sequence[Path], joints: Sequence[str], **options: Any
) -> Project:
    """Write a project to a folder, new or with other things in it (`hydroid.init` says what is given)."""
    _refuse_replacing(folder, FILES, force=options.pop("force", False))
    boxes = boxes_urdf(joints, lengths) if (lengths := options.pop("lengths", ())) else ""
    table = open_table(logs[0]) if logs else None
    imported, reference, own = None, ARM, None
    if robot is not None and robot.suffix.lower() in (".yaml", ".yml"):
        own, reference = robot, _seen_from(folder, robot)
    elif robot is not None:
        imported = import_arm(robot, table.names if table else (), **options)
    elif boxes:
        imported = _arm_of_boxes(boxes, options)
    with _stage(folder) as stage, _of_the_project(stage, folder, robot):
        arm = load_arm(own) if own else _write_arm(stage, imported)
        layout = find_layout(table, arm, joints, others=_fitted(logs)[1:])
        sizes = joint_sizes(arm, {j: m.speed for j, m in layout.motions.items()})
        if imported is not None:
            arm = _write_arm(stage, imported, arm, sizes)
        notes = [*imported.notes] if imported else []
        guessed = [joint.name for joint in arm.joints if isinstance(joint.actuator, RotaryActuator)]
        if imported and guessed:
            what = "no cylinder is known. A stand-in predicts angles; its pressures and forces mean nothing"
            notes.append(f"{listed(guessed)}: {what}")
        steps = _steps(folder, logs, layout)
        text = fit_text(arm, layout, sizes, str(folder / FIT), reference, steps[0])
        _write_settings(stage, arm, text)
        return _finished(stage, folder, arm.name, layout, notes, steps)


def _arm_of_boxes(urdf: str, options: Plain) -> ImportedArm:
    """Import an arm of boxes as if a person had drawn it."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "boxes.urdf"
        write_atomic(path, urdf)
        imported = import_arm(path, **options)
    guessed = (
        "the arm is made of boxes of these lengths: its masses and ranges are guesses; mend them in arm.xml"
    )
    return replace(imported, notes=(guessed, *imported.notes))


def go_on(folder: Path | None, config: Path, logs: Sequence[Path], *, force: bool) -> Project:
    """Write the settings anew, with starts from the logs, whose columns a person has named in `config`.

    Its arm stays as it is. Settings that are replaced are kept as OLD.
    """
    values, _ = read_yaml(config)
    if not values.get("log"):
        hint = "name the log's columns there: take the comment signs of its lines away"
        raise SettingsError("has no log section", config, hint)
    if not logs:
        raise SettingsError("needs the log", "--config", "give --log LOG")
    settings, folder = load(config, FitSettings), folder or config.parent
    arm, home = settings.arm, config.resolve() == (folder / FIT).resolve()
    _refuse_replacing(folder, (FIT, STEPS, PICTURE), force=force or home)
    table = open_table(logs[0], settings.log)
    layout = find_layout(table, arm, given=settings.log, others=_fitted(logs)[1:])
    sizes = joint_sizes(arm, {j: m.speed for j, m in layout.motions.items()})
    steps = _steps(folder, logs, layout)
    text = fit_text(arm, layout, sizes, str(folder / FIT), _seen_from(folder, Path(arm.where)), steps[0])
    with _stage(folder) as stage, _of_the_project(stage, folder, config):
        if home:
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


def _steps(folder: Path, logs: Sequence[Path], layout: Layout) -> tuple[str, ...]:
    """Return the commands that come next."""
    names = [shlex.quote(str(log)) for log in logs or ("LOG.csv", "OTHER.csv")]
    fitted, other = " ".join(names[:-1] or names), names[-1] if names[1:] else "OTHER.csv"
    home = shlex.quote(str(folder))
    config, run = f"--config {home}/fit.yaml", f"{home}/runs/fit"
    if layout.missing:
        return (" ".join([f"hydroid init {config}", *(f"--log {name}" for name in names)]),)
    return (
        f"hydroid check {' '.join(names)} {config}",
        f"hydroid fit-hyd {fitted} {config} --out {run}",
        f"hydroid validate {other} --fit {run} --out {home}/runs/validation",
        f"hydroid suggest {fitted} --fit {run} --out {home}/runs/suggestions",
    )


def _write_settings(stage: Path, arm: Arm, text: str) -> None:
    """Write the settings of a fit, which can be read, and the picture of the arm."""
    write_atomic(stage / FIT, text)
    validate(read_yaml(stage / FIT)[0] | {"arm": arm}, FitSettings, FIT)
    caption = f"{arm.name}, all joints at or near 0: does it look and turn like yours?"
    write_atomic(stage / PICTURE, arm_picture(arm, caption)[0])


def _finished(
    stage: Path, folder: Path, name: str, layout: Layout, notes: Sequence[str], steps: tuple[str, ...]
) -> Project:
    """Write the next steps, and move all to the folder."""
    told = {"steps": steps, "notes": notes, "reasons": layout.reasons, "missing": layout.missing}
    write_atomic(stage / STEPS, fill_template("project/next-steps.md.j2", name=name, **told))
    written = _move(stage, folder)
    return Project(
        folder, written, tuple(notes), layout.reasons, layout.unused, steps, missing=layout.missing
    )


@contextmanager
def _of_the_project(stage: Path, folder: Path, source: Path | None) -> Generator[None]:
    """Let errors name the source in place of a file that was to be written and is gone."""
    try:
        yield
    except HydroidError as error:
        if str(stage) not in str(error):
            raise
        what, hint = (text.replace(str(stage), str(folder)) for text in (error.what, error.hint))
        raise type(error)(what, source or folder, hint) from None


def _write_arm(
    stage: Path, imported: ImportedArm | None, arm: Arm | None = None, sizes: Sequence[JointSize] = ()
) -> Arm:
    if imported is None:
        files: dict[str, Any] = {MODEL: fill_template("project/boxes.xml.j2")}
        files[ARM] = fill_template("project/boxes.yaml")
    else:
        files = {MODEL: imported.mjcf, ARM: arm_text(imported, arm, sizes), **imported.meshes}
    for name, content in files.items():
        write_atomic(stage / name, content)
    return load_arm(stage / ARM)


@contextmanager
def _stage(folder: Path) -> Generator[Path]:
    """A folder beside the project, or in it where it exists, that disappears."""
    home = next(filter(Path.is_dir, (folder.absolute(), *folder.absolute().parents)))
    with writing(folder):
        stage = tempfile.TemporaryDirectory(prefix=".hydroid-init-", dir=home, ignore_cleanup_errors=True)
    with stage as name:
        yield Path(name)


def _move(stage: Path, folder: Path) -> tuple[str, ...]:
    names, old = tuple(name for name in FILES if (stage / name).exists()), stage / "old"
    old.mkdir()
    with undisturbed(), writing(folder):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name in names:
                if os.path.lexists(folder / name):  # of an earlier project
                    os.rename(folder / name, old / name)
                os.rename(stage / name, folder / name)
        except OSError:
            for name in names:
                for place, back in ((folder, stage), (old, folder)):
                    if os.path.lexists(place / name) and not os.path.lexists(back / name):
                        os.rename(place / name, back / name)
            raise
    return names
