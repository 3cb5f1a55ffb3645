"""`hydroid export`: a fitted machine for other programs; and draws of what the logs
leave open."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result
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
from hydroid.progress import LOGGER
from hydroid.words import listed

if TYPE_CHECKING:
    from hydroid.arrays import Array
    from hydroid.plant import Plant
    from hydroid.use.draws import Draws

KINDS = ("parameters", "table", "urdf", "mjcf", "linear", "fmu")


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

    parameters: draws of all parameters together within what the logs leave open,
    ranges, and the errors of the model. table: settled speed against command of each
    joint, as CSV for a PLC. urdf: your own file with the masses of the fit. mjcf: a
    model that plain MuJoCo steps. linear: A, B, C, D and delays near a pose and
    opening, as JSON. fmu: FMI 2 for co-simulation.

    Example: hydroid export runs/hyd --to parameters --draws 100

        hydroid.export("runs/a", to="table", out="speeds")

    Args:
        fit (RUN|YAML): A fit: a run folder, or a folder written by Plant.save (Python).
        to (KIND): parameters, table, urdf, mjcf, linear or fmu.
        out (DIR): Folder of the files [default of the command line: runs/export].
        draws (1 to 100000): Number of draws of the parameters.
        robot (URDF): The URDF whose masses are replaced; of urdf.
        pose (NAME): The pose where the plant starts, by its name in the arm's file
            [default: the start pose of the settings].
        at (JOINT=PCT,...): Commands about which the model is linear, such as
            boom=30,arm=-40; of linear.

    Raises:
        SettingsError: another kind, an option that is missing, or a fit of stage 1,
            which has no valves.
        ModelError: the URDF cannot be used.
        RunError: a file cannot be written, pythonfmu is missing, or there is no
            covariance to draw from.
    """
    if to not in KINDS:
        raise SettingsError(
            f"{to!r} is no kind of export", "--to", f"choose {', '.join(KINDS)}"
        )
    if to == "urdf" and robot is None:
        raise SettingsError(
            "needs your robot's file", "--to urdf", "name it: --robot robot.urdf"
        )
    folder = Path("export" if out is None else out)
    model = open_model(fit, overrides=set)
    if to == "parameters":
        from hydroid.use.draws import draw as drawn
        from hydroid.use.tables import parameter_files

        found = drawn(model, draws, seed, getattr(fit, "problem", None))
        return _written(parameter_files(found), folder, write=out is not None)
    from hydroid.plant import Plant

    plant = Plant(model)
    if pose is not None:
        plant.reset(pose)
    if to == "mjcf":
        from hydroid.use.robot_files import write_moving

        files = (
            [] if out is None else [str(file) for file in write_moving(plant, folder)]
        )
        return Result(files, {"files": files}, files)
    return _written(_files(plant, to, robot, at), folder, write=out is not None)


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


def _commands(plant: "Plant", at: str) -> "Array":
    """Return the commands [%] that a text such as boom=30,arm=-40 says, (J,)."""
    import numpy as np

    given = np.zeros(len(plant.names))
    driven = [plant.names[number - 1] for number in plant.joints]
    named = set[str]()
    for part in names(at):
        joint, _, value = part.partition("=")
        if joint not in plant.names:
            raise SettingsError(
                f"no joint {joint!r}", "--at", f"the arm has {', '.join(plant.names)}"
            )
        if joint in named:
            raise SettingsError(f"{joint} has two commands", "--at", "leave one out")
        named.add(joint)
        if joint not in driven:
            what = f"{joint} takes no commands"
            raise SettingsError(what, "--at", f"those of {listed(driven)} count")
        try:
            given[plant.names.index(joint)] = float(value)
        except ValueError:
            raise SettingsError(
                f"{part!r} is no command", "--at", "write boom=30,arm=-40 in %"
            ) from None
    return given


def _written(
    files: Mapping[str, str] | Mapping[str, str | bytes], folder: Path, *, write: bool
) -> Result[list[str]]:
    paths = [str(folder / name) for name in files] if write else []
    for path, content in zip(paths, files.values(), strict=False):
        write_atomic(Path(path), content)
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
    from hydroid.use.draws import draw as drawn

    return drawn(open_model(fit), n, seed, getattr(fit, "problem", None))
