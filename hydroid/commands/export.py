"""`hydroid export`: a fitted machine for other programs; and draws of what the logs
leave open."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import (
    ModelSource,
    SettingChanges,
    Source,
    command,
    names,
    open_model,
)
from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.identified_model import IdentifiedModel
from hydroid.log.conditions import at_references
from hydroid.progress import LOGGER, NOTE
from hydroid.words import listed

if TYPE_CHECKING:
    from hydroid.arrays import Array
    from hydroid.plant import Plant
    from hydroid.use.draws import Draws

MACHINES = 40  # drawn for the bands of a linear model's page
KINDS = ("parameters", "table", "urdf", "mjcf", "linear", "fmu")
SUFFIXES = (".csv", ".urdf", ".xml", ".json", ".fmu")
"""of what is written"""


@command
def export(
    fit: "ModelSource",
    *,
    to: str,
    out: "Source | None" = None,
    draws: int = 100,
    seed: int = 0,
    robot: "Source | None" = None,
    pose: str | None = None,
    at: str = "",
    set: "SettingChanges" = None,
) -> Result[list[str]]:
    """Write a fitted machine for other programs.

    --to says in which form. --to parameters: draws (random sets of all parameters that
    agree with the logs about as well as the fit), the range of each parameter, and errors
    of the model. --to table: steady speed of each joint against its command, as CSV for a
    PLC. --to urdf: your own file with the masses of the fit. --to mjcf: a model that
    MuJoCo simulates alone. --to linear: A, B, C, D and delays near one pose and command,
    as JSON, and a page with step response and Bode plot. --to fmu: FMI 2 for
    co-simulation.

    Example: hydroid export runs/hyd --to parameters --draws 100

        hydroid.export("runs/a", to="table", out="speeds")

    Args:
        fit (RUN|YAML): A fit: its run folder, or a folder that Plant.save wrote in Python.
        to (KIND): parameters, table, urdf, mjcf, linear or fmu.
        out (DIR): Folder of the files [default: runs/export; in Python nothing is
            written].
        draws (1 to 100000): Number of draws of the parameters.
        robot (URDF): With --to urdf: your robot's URDF, whose masses are replaced.
        pose (NAME): The pose where the plant starts, by its name in the arm's file
            [default: the start pose of the settings].
        at (JOINT=PCT,...): With --to linear: the commands [%] near which the model
            holds, such as boom=30,arm=-40. Joints that are not named stand still.

    Raises:
        SettingsError: another kind, an option that is missing, or a fit of stage 1,
            which has no valves.
        ModelError: the URDF cannot be used.
        RunError: a file cannot be written, pythonfmu is missing, or there is no
            covariance to draw from.
    """
    if to not in KINDS:
        hint = f"choose {', '.join(KINDS)}"
        raise SettingsError(f"{to!r} is no kind of export", "--to", hint)
    if to == "urdf" and robot is None:
        hint = "name it: --robot robot.urdf"
        raise SettingsError("needs your robot's file", "--to urdf", hint)
    folder = Path("export" if out is None else out)
    if out is not None:
        _refuse_file(folder, robot)
    model = open_model(fit, overrides=set)
    if to == "parameters":
        from hydroid.use.tables import parameter_files

        machines = _drawn(fit, model, draws, seed)
        return _written(parameter_files(machines), folder, write=out is not None)
    from hydroid.plant import Plant

    if known := at_references(model.settings.log):
        LOGGER.log(NOTE, "note: %s", known)
    plant = Plant(model)
    if pose is not None:
        plant.reset(pose)
    if to == "mjcf":
        from hydroid.use.robot_files import write_moving

        files = list[str]()
        if out is not None:
            files += map(str, write_moving(plant, folder))
        return Result(files, {"files": files}, files)
    result = _written(_files(plant, to, robot, at), folder, write=out is not None)
    if to == "linear":
        return _with_page(result, plant, at, out)
    return result


def _refuse_file(folder: Path, robot: "Source | None") -> None:
    """Refuse a folder that has the name of a file, or in which the user's own robot
    would be overwritten."""
    if folder.suffix in SUFFIXES and not folder.is_dir():
        hint = f"name the folder: --out {folder.parent / 'export'}"
        raise SettingsError("is a file's name, and files go to a folder", folder, hint)
    own = Path(robot or "")
    if robot is not None and (folder / own.name).resolve() == own.resolve():
        hint = "name another folder"
        raise SettingsError("would overwrite your robot's file", folder, hint)


def _files(
    plant: "Plant", to: str, robot: "Source | None", at: str
) -> "dict[str, str | bytes]":
    """Return the files of an export by name."""
    if to == "table":
        from hydroid.use.tables import speed_tables

        return {**speed_tables(plant)}
    if to == "urdf":
        from hydroid.use.robot_files import fitted_urdf

        path = Path(robot or "")
        text, without = fitted_urdf(plant, path)
        if without:
            what = "warning: %s: states no mass of %s: the fit's is not in the export"
            LOGGER.warning(what, path, listed(without))
        return {path.name: text}
    if to == "linear":
        from hydroid.use.linear import linearise

        return {"linear.json": linearise(plant, _commands(plant, at)).text()}
    from hydroid.use.fmu import fmu_bytes

    return {f"{plant.identified.settings.arm.name}.fmu": fmu_bytes(plant)}


def _with_page(
    result: Result[list[str]], plant: "Plant", at: str, out: "Source | None"
) -> Result[list[str]]:
    """Return the result of a linear model with its page: step response and Bode plot,
    with bands where the logs leave something open."""
    from hydroid.posterior.posterior import stored_posterior
    from hydroid.reporting.linear_page import linear_page
    from hydroid.use.draws import draw as drawn
    from hydroid.use.linear import LinearArm, linearise

    command = _commands(plant, at)
    others = list[LinearArm]()
    if stored_posterior(plant.identified) is not None:
        for other in drawn(plant.identified, MACHINES).plants(joints=plant.joints):
            other.reset(plant.angle)
            others.append(linearise(other, command))
    arm = plant.identified.settings.arm
    page = linear_page(linearise(plant, command), others, arm)
    files = [*result.result, *written(page, out)]
    return Result(files, {"files": files}, files, page)


def _commands(plant: "Plant", at: str) -> "Array":
    """Return the commands [%] that a text such as boom=30,arm=-40 says, (J,)."""
    import numpy as np

    commands = np.zeros(len(plant.names))
    driven = [plant.names[number - 1] for number in plant.joints]
    named = set[str]()
    for part in names(at):
        joint, _, value = part.partition("=")
        if joint not in plant.names:
            hint = f"the arm has {', '.join(plant.names)}"
            raise SettingsError(f"no joint {joint!r}", "--at", hint)
        if joint in named:
            raise SettingsError(f"{joint} has two commands", "--at", "leave one out")
        named.add(joint)
        if joint not in driven:
            what = f"{joint} takes no commands"
            raise SettingsError(what, "--at", f"those of {listed(driven)} count")
        try:
            commands[plant.names.index(joint)] = float(value)
        except ValueError:
            hint = "write boom=30,arm=-40 in %"
            raise SettingsError(f"{part!r} is no command", "--at", hint) from None
    return commands


def _written(
    files: Mapping[str, str] | Mapping[str, str | bytes], folder: Path, *, write: bool
) -> Result[list[str]]:
    """Write files by name, where they are to be written; return their paths."""
    paths = list[str]()
    if write:
        for name, content in files.items():
            write_atomic(folder / name, content)
            paths.append(str(folder / name))
    return Result(paths, {"files": paths}, paths)


def draw(fit: ModelSource, n: int, seed: int = 0) -> "Draws":
    """Draw machines that the logs of a fit do not rule out: all parameters together.

        for plant in hydroid.draw("runs/a", 20).plants():
            plant.step({"boom": 50})

    Args:
        fit: a run folder, or the result of a fit.
        n: number of draws.
        seed: of the random numbers. The same seed gives the same draws.

    Raises:
        RunError: the fit holds no covariance of its parameters.
        SettingsError: n is below 1.
    """
    return _drawn(fit, open_model(fit), n, seed)


def _drawn(fit: ModelSource, model: IdentifiedModel, n: int, seed: int) -> "Draws":
    """Return n machines drawn from the model of a fit."""
    from hydroid.use.draws import draw as draw_machines

    # the result of a fit has its problem with it; a run folder's is made from its logs
    return draw_machines(model, n, seed, getattr(fit, "problem", None))
