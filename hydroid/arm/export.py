"""The files of `model/`: the arm as it came, and the fitted arm for programs other than hydroid."""

from pathlib import Path
from typing import Any

import mujoco
import yaml

from hydroid.errors import RunError
from hydroid.files import write_atomic

FITTED, MECHANICS, ACTUATORS, README = "fitted.xml", "mechanics.xml", "actuators.yaml", "README.txt"

_MECHANICAL_README = """\
fitted.xml is the fitted arm for MuJoCo alone. Set ctrl to the commands [%] and call mj_step once per
{timestep:g} s: it moves as the fit does, within 1e-6 rad.
It holds for one start pose, the keyframe `start`, and moves {joints}. Other joints are fused in that
pose, springs are slack there, and each motor adds the constant torque that balances gravity there.
For another pose use hydroid:

    plant = hydroid.load_plant(FOLDER)      # the folder that holds model/
    plant.reset(pose)                       # plant.save(OTHER) writes fitted.xml for this pose
    q = plant.step(command)

arm.xml is the arm before the fit.
"""
_HYDRAULIC_README = """\
MuJoCo alone cannot step this arm: the fit has hydraulics, and MuJoCo has none. Use hydroid:

    plant = hydroid.load_plant(FOLDER)      # the folder that holds model/
    plant.reset(pose)
    q = plant.step(command)                 # plant.model and plant.data are MuJoCo's

mechanics.xml is the fitted arm without its hydraulics: masses, dampers and springs, and no motors. Its
moving joints are {joints}; the others are fused in the start pose, which is the keyframe `start`.
actuators.yaml lists the hydraulic parameters of each joint. arm.xml is the arm before the fit.
"""


def copy_model(spec: mujoco.MjSpec, folder: Path) -> None:
    """Write `arm.xml` and its meshes, so that a folder can be read where the original is gone.

    Args:
        spec: the arm's MJCF, which then names the copied meshes.
        folder: receives the files.

    Raises:
        RunError: a mesh cannot be read, or the folder cannot be written.
    """
    home, kept = Path(spec.modelfiledir).resolve(), dict[str, bytes]()
    for number, mesh in enumerate(spec.meshes):
        if not mesh.file:
            continue  # its vertices stand in the MJCF
        source = home / spec.meshdir / mesh.file
        try:
            content = source.read_bytes()
        except OSError as error:
            raise RunError(f"mesh cannot be read ({error.strerror})", where=str(source)) from None
        # meshes of different folders may have one name
        taken = kept.get(source.name, content) != content
        mesh.file = f"{number}_{source.name}" if taken else source.name
        kept[mesh.file] = content
    for name, content in kept.items():
        write_atomic(folder / "meshes" / name, content)
    for pictures, place in ((spec.textures, spec.texturedir), (spec.hfields, spec.meshdir)):
        for picture in pictures:
            picture.file = picture.file and str(home / place / picture.file)  # these stay where they are
    spec.modelfiledir, spec.meshdir = str(folder.resolve()), "meshes"
    spec.compiler.savecompiled = spec.compiler.savecanonical = False  # canonical is six digits
    write_atomic(folder / "arm.xml", spec.to_xml())


def write_fitted(
    folder: Path, mjcf: str, timestep: float, joints: str, actuators: dict[str, Any] | None
) -> None:
    """Write the fitted arm beside `arm.xml`, and a README that says what it is good for.

    Args:
        folder: `model/`.
        mjcf: the fitted arm.
        timestep: MuJoCo's [s].
        joints: names of the joints that take commands.
        actuators: hydraulic parameters by joint (stage 2); None: the MJCF has motors (stage 1).

    Raises:
        RunError: the folder cannot be written.
    """
    write_atomic(folder / (FITTED if actuators is None else MECHANICS), mjcf)
    if actuators is not None:
        text = yaml.safe_dump(actuators, sort_keys=False, allow_unicode=True)
        write_atomic(folder / ACTUATORS, text)
    words = _MECHANICAL_README if actuators is None else _HYDRAULIC_README
    write_atomic(folder / README, words.format(timestep=timestep, joints=joints))
