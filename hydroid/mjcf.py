"""MuJoCo's XML of an arm: read, held to what hydroid simulates, copied;
MuJoCo's errors as one line."""

import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from hydroid.errors import ModelError, RunError
from hydroid.files import is_file, write_atomic
from hydroid.robot_xml import read_robot


def read_mjcf(path: Path) -> mujoco.MjSpec:
    """Read an MJCF whose joints turn or slide, each alone on its body,
    and whose numbers are finite.

    Raises ModelError: it is another one, or has what hydroid does not simulate.
    """
    if not is_file(path):
        raise ModelError("no such model", path)
    # MuJoCo takes a NaN for what it likes
    read_robot(path)
    with mujoco_errors(path):
        spec = mujoco.MjSpec.from_file(str(path))
    if not spec.joints:
        raise ModelError("has no joint", path)
    _refuse_joints(spec, path)
    _refuse_forces(spec, path)
    for joint in spec.joints:
        # both ends are infinite then, or `read_robot` refuses the file
        if not np.isfinite(joint.range).all():
            joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
            joint.range = [0.0, 0.0]
    return spec


def _refuse_joints(spec: mujoco.MjSpec, path: Path) -> None:
    """Refuse joints without a name, of another kind, or several of one body."""
    kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    for joint in spec.joints:
        body = joint.parent
        if not joint.name or not body.name:
            what = f"joint {joint.name!r} of body {body.name!r}: both need a name"
            raise ModelError(what, path)
        if joint.type not in kinds or len(body.joints) > 1:
            what = f"joint {joint.name!r} must be a hinge or a slide, alone on its body"
            raise ModelError(what, path)


def _refuse_forces(spec: mujoco.MjSpec, path: Path) -> None:
    """Refuse forces that hydroid does not simulate."""
    if spec.equalities:
        raise ModelError(
            "has equality constraints, which hydroid does not simulate", path
        )
    for body in spec.bodies:
        if body.gravcomp:
            why = "hydroid does not simulate what takes its weight away"
            raise ModelError(
                f"body {body.name!r} has gravcomp: {why}", path, "take gravcomp out"
            )
    if spec.option.density or spec.option.viscosity:
        what = "has a density or viscosity of the air, which hydroid does not simulate"
        raise ModelError(what, path)


def copy_models(models: Mapping[str, Path], folder: Path) -> None:
    """Write MJCFs by their new names, with their meshes, to a folder that stands alone.

    Raises RunError: a mesh cannot be read, or the folder cannot be written.
    """
    # of the meshes, by their new names
    contents: dict[str, bytes] = {}
    for name, path in models.items():
        spec = read_mjcf(path)
        home = path.resolve().parent
        for mesh in spec.meshes:
            # a mesh without a file has its vertices in the MJCF
            if mesh.file:
                mesh.file = _copied(home / spec.meshdir / mesh.file, folder, contents)
        for pictures, place in (
            (spec.textures, spec.texturedir),
            (spec.hfields, spec.meshdir),
        ):
            for picture in pictures:
                # these stay where they are
                picture.file = picture.file and str(home / place / picture.file)
        spec.modelfiledir = str(folder.resolve())
        spec.meshdir = "meshes"
        write_atomic(folder / name, mjcf_text(spec))


def _copied(source: Path, folder: Path, contents: dict[str, bytes]) -> str:
    """Copy a mesh to a folder, and return its name there: meshes of different folders
    may have one name."""
    try:
        content = source.read_bytes()
    except OSError as error:
        raise RunError(f"mesh cannot be read ({error.strerror})", source) from None
    name = source.name
    if contents.get(name, content) != content:
        name = f"{len(contents)}_{name}"
    contents[name] = content
    write_atomic(folder / "meshes" / name, content)
    return name


def mjcf_text(spec: mujoco.MjSpec) -> str:
    """Return a spec as XML to the last bit, as it is written and not as it compiles."""
    # MuJoCo's canonical form has six digits
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    return spec.to_xml()


@contextmanager
def mujoco_errors(where: object) -> Generator[None]:
    """Turn MuJoCo's errors into one line; `quiet_mujoco` beside."""
    try:
        with quiet_mujoco():
            yield
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(
            f"MuJoCo refuses it ({' '.join(str(error).split())})", where
        ) from None


@contextmanager
def quiet_mujoco() -> Generator[None]:
    """Keep MuJoCo from printing a warning for every diverged candidate,
    and from writing MUJOCO_LOG.TXT."""
    before = mujoco.MjLogConfig.get()
    silent = mujoco.MjLogConfig.get()
    silent.logto_console = silent.logto_file = False
    mujoco.MjLogConfig.set(silent)
    try:
        with warnings.catch_warnings():
            # MuJoCo warns in Python of the same things
            warnings.simplefilter("ignore", UserWarning)
            yield
    finally:
        mujoco.MjLogConfig.set(before)
