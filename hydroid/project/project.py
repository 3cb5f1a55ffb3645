"""Writing a project: all of its files, or none."""

import os
import shutil
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from hydroid.arm.build import write_model
from hydroid.cad import ImportedArm, ImportedLink, import_arm
from hydroid.cad.shapes import showable, stl
from hydroid.errors import RunError, SettingsError
from hydroid.files import undisturbed, write_atomic
from hydroid.log import open_table
from hydroid.project.arm_file import MESHES, arm_text, template_text
from hydroid.project.fit_files import hyd_text, mech_text
from hydroid.project.layout import find_layout
from hydroid.project.sizes import JointSize, joint_sizes
from hydroid.project.steps import next_steps, steps_page
from hydroid.report.arm_figure import arm_figure
from hydroid.report.style import rendered, style
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load

ARM, MODEL, PICTURE = "arm.yaml", "arm.xml", "arm.png"
MECH, HYD, STEPS = "fit-mech.yaml", "fit-hyd.yaml", "next-steps.md"
FILES = (ARM, MODEL, PICTURE, MECH, HYD, STEPS, MESHES)


@dataclass(frozen=True)
class Project:
    """A project that was written.

    Attributes:
        folder: where.
        files: names of its files and folders there.
        notes: what the import of the arm assumed, left out or mended.
        columns: what each column of the log is taken for, and why.
        unused: names of the log's other columns.
        commands: what to run next, in this order.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...]
    columns: tuple[str, ...]
    unused: tuple[str, ...]
    commands: tuple[str, ...]


def write_project(
    folder: Path, robot: Path | None = None, logs: Sequence[Path] = (), tip: str | None = None
) -> Project:
    """Write a project to a folder, new or with other things in it.

    Args:
        folder: where.
        robot: URDF or MJCF of the arm; None: a template of boxes.
        logs: the first tells the columns; the last of several is kept to validate on.
        tip: link at which the arm ends; None: the tip that fits the log, or the longest branch.

    Raises:
        SettingsError: a file of the project is there already.
        ModelError, MeshError, LogError: the robot or the first log cannot be used.
        RunError: the folder cannot be written.
    """
    taken = [name for name in FILES if os.path.lexists(folder / name)]
    if taken:
        raise SettingsError(f"holds {taken[0]} already", where=str(folder), hint="name another folder")
    table = open_table(logs[0]) if logs else None
    imported = import_arm(robot, table.names if table else (), tip) if robot is not None else None
    with _stage(folder) as stage:
        if imported is not None:
            imported = _write_meshes(imported, stage / MESHES)
        arm = _write_arm(stage, folder, imported, robot)
        layout = find_layout(table, arm) if table is not None else None
        sizes = joint_sizes(arm, layout.speeds if layout else {})
        arm = _write_arm(stage, folder, imported, robot, sizes)
        write_model(arm, stage / MODEL)
        with style():
            write_atomic(stage / PICTURE, rendered(arm_figure(arm))[0])
        write_atomic(stage / MECH, mech_text(arm, layout, sizes, str(folder / MECH)))
        write_atomic(stage / HYD, hyd_text(arm, layout, sizes, str(folder / HYD)))
        for name in (MECH, HYD):
            load(stage / name, FitSettings)  # what is written can be read
        steps = next_steps(folder, logs)
        notes, reasons = imported.notes if imported else (), layout.reasons if layout else ()
        write_atomic(stage / STEPS, steps_page(arm.name, folder, steps, notes, reasons))
        files = _move(stage, folder)
    return Project(folder, files, notes, reasons, layout.unused if layout else (), steps)


@contextmanager
def _stage(folder: Path) -> Generator[Path]:
    """A folder beside the project, or in it where it exists, that disappears."""
    home = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())
    try:
        stage = Path(tempfile.mkdtemp(prefix=".hydroid-init-", dir=home))
    except OSError as error:
        raise RunError(f"cannot be written ({error.strerror})", where=str(folder)) from None
    try:
        yield stage
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _write_meshes(imported: ImportedArm, folder: Path) -> ImportedArm:
    """Write the meshes that MuJoCo can show, and return the arm with those."""
    notes, links = [*imported.notes], list[ImportedLink]()
    for link in imported.links:
        mesh = None if link.mesh is None else showable(link.mesh, f"link {link.name}", notes)
        if mesh is not None:
            write_atomic(folder / f"{link.name}.stl", stl(mesh))
        links.append(replace(link, mesh=mesh))
    base = None if imported.base is None else showable(imported.base, "the base", notes)
    if base is not None:
        write_atomic(folder / "base.stl", stl(base))
    return replace(imported, base=base, links=tuple(links), notes=tuple(notes))


def _write_arm(
    stage: Path,
    folder: Path,
    imported: ImportedArm | None,
    robot: Path | None,
    sizes: Sequence[JointSize] = (),
) -> Arm:
    if imported is None or robot is None:
        text = template_text(str(folder / ARM))
    else:
        text = arm_text(imported, sizes, f"{imported.name}, from {robot.name}", str(folder / ARM))
    write_atomic(stage / ARM, text)
    return load_arm(stage / ARM)


def _move(stage: Path, folder: Path) -> tuple[str, ...]:
    """Move all files to the project, or none."""
    names = tuple(name for name in FILES if (stage / name).exists())
    moved = list[Path]()
    with undisturbed():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name in names:
                os.rename(stage / name, folder / name)
                moved.append(folder / name)
        except OSError as error:
            for path in moved:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            raise RunError(f"cannot be written ({error.strerror})", where=str(folder)) from None
    return names
