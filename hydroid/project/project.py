"""Writing a project, all of its files or none, and the commands that come next."""

import os
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydroid.arrays import record
from hydroid.cad.importer import ImportedArm, import_arm
from hydroid.cad.meshes import MESHES
from hydroid.errors import SettingsError
from hydroid.files import fill_template, undisturbed, write_atomic, writing
from hydroid.log import open_table
from hydroid.project.layout import find_layout
from hydroid.project.texts import JointSize, arm_text, fit_text, joint_sizes
from hydroid.reporting.figure import arm_picture
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.linkage import RotaryActuator
from hydroid.settings.load import validate
from hydroid.words import listed

ARM, MODEL, PICTURE = "arm.yaml", "arm.xml", "arm.png"
FIT, STEPS = "fit.yaml", "next-steps.md"
FILES = (ARM, MODEL, PICTURE, FIT, STEPS, MESHES)


@record
class Project:
    """A project that was written: its folder, and the names of its files and folders there.

    `notes`: what the import assumed; `columns`: what each of the log is taken for; `unused`: the others.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...]
    columns: tuple[str, ...]
    unused: tuple[str, ...]
    commands: tuple[str, ...]


def write_project(
    folder: Path, robot: Path | None, logs: Sequence[Path], joints: Sequence[str], **options: Any
) -> Project:
    """Write a project to a folder, new or with other things in it (`hydroid.init` says what is given)."""
    taken = [name for name in FILES if os.path.lexists(folder / name)]
    if not options.pop("force", False) and taken:
        hint = "name another folder, or replace the project's files with --force"
        raise SettingsError(f"holds {taken[0]} already", folder, hint)
    table = open_table(logs[0]) if logs else None
    imported, reference, own = None, ARM, None
    if robot is not None and robot.suffix.lower() in (".yaml", ".yml"):
        own, reference = robot, Path(os.path.relpath(robot.resolve(), folder.resolve())).as_posix()
    elif robot is not None:
        imported = import_arm(robot, table.names if table else (), **options)
    with _stage(folder) as hidden:
        stage = Path(hidden)
        arm = load_arm(own) if own else _write_arm(stage, imported)
        layout = find_layout(table, arm, joints)
        sizes = joint_sizes(arm, {j: m.speed for j, m in layout.motions.items()})
        if imported is not None:
            arm = _write_arm(stage, imported, arm, sizes)
        caption = f"{arm.name}, all joints at or near 0: does it look and turn like yours?"
        write_atomic(stage / PICTURE, arm_picture(arm, caption)[0])
        write_atomic(stage / FIT, fit_text(arm, layout, sizes, str(folder / FIT), reference))
        # what is written can be read
        validate(read_yaml(stage / FIT)[0] | {"arm": arm}, FitSettings, FIT)
        # of several logs the last is kept to validate on, of one none is
        names = [shlex.quote(str(log)) for log in logs or ("LOG.csv", "OTHER.csv")]
        fitted, other = " ".join(names[:-1] or names), names[-1] if names[1:] else "OTHER.csv"
        home = shlex.quote(str(folder))
        config, run = f"--config {home}/fit.yaml", f"{home}/runs/fit"
        steps = (
            f"hydroid check {' '.join(names)} {config}",
            f"hydroid fit-hyd {fitted} {config} --out {run}",
            f"hydroid validate {other} --fit {run} --out {home}/runs/validation",
            f"hydroid suggest {fitted} --fit {run} --out {home}/runs/suggestions",
        )
        notes = [*imported.notes] if imported else []
        guessed = [joint.name for joint in arm.joints if isinstance(joint.actuator, RotaryActuator)]
        if imported and guessed:
            what = "no cylinder is known. A stand-in predicts angles; its pressures and forces mean nothing"
            notes.append(f"{listed(guessed)}: {what}")
        told = {"steps": steps, "notes": notes, "reasons": layout.reasons}
        write_atomic(stage / STEPS, fill_template("project/next-steps.md.j2", name=arm.name, **told))
        written = _move(stage, folder)
    return Project(folder, written, tuple(notes), layout.reasons, layout.unused, steps)


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


def _stage(folder: Path) -> tempfile.TemporaryDirectory[str]:
    """A folder beside the project, or in it where it exists, that disappears."""
    home = next(filter(Path.is_dir, (folder.absolute(), *folder.absolute().parents)))
    with writing(folder):
        return tempfile.TemporaryDirectory(prefix=".hydroid-init-", dir=home, ignore_cleanup_errors=True)


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
