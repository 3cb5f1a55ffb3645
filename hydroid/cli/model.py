"""`hydroid build-model`: from meshes and the arm's file to MJCF."""

from pathlib import Path
from typing import Annotated

import typer


def build_model(
    arm: Annotated[
        str, typer.Option(help="The arm: a YAML file, or the name of a shipped one.")
    ] = "hydrolek",
    meshes: Annotated[
        Path | None, typer.Option(help="Folder of the meshes [default: as the arm says].")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="MODEL.xml", help="MJCF to write [default: as it says].")
    ] = None,
) -> None:
    """Compute every link's centre of mass and inertia from its mesh and write the arm's MJCF model."""
    from hydroid.arm.model import write_model
    from hydroid.settings.arm import load_arm

    settings = load_arm(arm)
    if meshes is not None:
        settings = settings.model_copy(update={"meshes": meshes.resolve()})
    target = out or settings.model
    write_model(settings, target)
    typer.echo(str(target))
