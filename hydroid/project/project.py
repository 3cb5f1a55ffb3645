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
from hydroid.project.fit_files import Names, fit_text
from hydroid.project.layout import find_layout
from hydroid.project.sizes import JointSize, joint_sizes
from hydroid.project.steps import next_steps, steps_page
from hydroid.report.arm_figure import arm_figure
from hydroid.report.style import rendered, style
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import validate

ARM, MODEL, PICTURE = "arm.yaml", "arm.xml", "arm.png"
FIT, STEPS = "fit.yaml", "next-steps.md"
FILES = (ARM, MODEL, PICTURE, FIT, STEPS, MESHES)


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


@dataclass(frozen=True)
class Sources:
    """What a project is made from.

    Attributes:
        robot: URDF, MJCF or YAML file of the arm; None: a template of boxes.
        logs: the first tells the columns; the last of several is kept to validate on.
        joints: names of the arm's joints as the log counts them; by default in the arm's order.
        tip: link at which the arm ends; None: the tip that fits the log, or the longest branch.
    """

    robot: Path | None = None
    logs: tuple[Path, ...] = ()
    joints: tuple[str, ...] = ()
    tip: str | None = None


def write_project(folder: Path, sources: Sources) -> Project:
    """Write a project to a folder, new or with other things in it.

    Raises:
        SettingsError: a file of the project is there already, or no joint has one of the given names.
        ModelError, MeshError, LogError: the robot or the first log cannot be used.
        RunError: the folder cannot be written.
    """
    taken = [name for name in FILES if os.path.lexists(folder / name)]
    if taken:
        raise SettingsError(f"holds {taken[0]} already", where=str(folder), hint="name another folder")
    logs, robot = sources.logs, sources.robot
    table = open_table(logs[0]) if logs else None
    own = robot is not None and robot.suffix.lower() in (".yaml", ".yml")
    imported = None
    if robot is not None and not own:
        imported = import_arm(robot, table.names if table else (), sources.tip)
    with _stage(folder) as stage:
        if imported is not None:
            imported = _write_meshes(imported, stage / MESHES)
        files = _ArmFiles(folder, stage, imported, robot)
        arm = files.write()
        layout = find_layout(table, arm, sources.joints) if table is not None else None
        sizes = joint_sizes(arm, {j: m.speed for j, m in layout.motions.items()} if layout else {})
        arm = files.write(sizes)
        with style():
            write_atomic(stage / PICTURE, rendered(arm_figure(arm))[0])
        write_atomic(stage / FIT, fit_text(arm, layout, sizes, Names(str(folder / FIT), files.reference)))
        # what is written can be read
        validate(read_yaml(stage / FIT)[0] | {"arm": arm}, FitSettings, FIT)
        steps = next_steps(folder, logs)
        notes, reasons = imported.notes if imported else (), layout.reasons if layout else ()
        write_atomic(stage / STEPS, steps_page(arm.name, folder, steps, notes, reasons))
        written = _move(stage, folder)
    return Project(folder, written, notes, reasons, layout.unused if layout else (), steps)


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


@dataclass(frozen=True)
class _ArmFiles:
    """The arm's file and model: written to the stage, or those that the user has."""

    folder: Path
    stage: Path
    imported: ImportedArm | None
    robot: Path | None

    @property
    def reference(self) -> str:
        """The arm's file, seen from the project."""
        if self.imported is not None or self.robot is None:
            return ARM
        return Path(os.path.relpath(self.robot.resolve(), self.folder.resolve())).as_posix()

    def write(self, sizes: Sequence[JointSize] = ()) -> Arm:
        """Write both, actuators of the given sizes included, and return the arm."""
        file = str(self.folder / ARM)
        if self.robot is None:
            text = template_text(file)
        elif self.imported is not None:
            text = arm_text(self.imported, sizes, f"{self.imported.name}, from {self.robot.name}", file)
        else:
            return load_arm(self.robot)
        write_atomic(self.stage / ARM, text)
        arm = load_arm(self.stage / ARM)
        write_model(arm, self.stage / MODEL)
        return arm


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
