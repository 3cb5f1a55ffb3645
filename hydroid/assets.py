"""The folder of the shipped models, meshes and configs: in the wheel, or at the top of a checkout."""

from pathlib import Path
from typing import Literal

from hydroid.errors import SettingsError
from hydroid.files import is_file

_PACKAGE = Path(__file__).parent


def assets() -> Path:
    """Return the folder that holds `models/`, `meshes/` and `configs/`."""
    inside = _PACKAGE / "assets"
    return inside if inside.is_dir() else _PACKAGE.parent


def find_config(
    name: str | Path, beside: Path | None = None, *, kind: Literal["config", "arm"] = "config"
) -> Path:
    """Find a config file.

    Args:
        name: a path, or the name of a shipped config with or without `.yaml`.
        beside: folder in which a relative path is looked up first.
        kind: config of a fit, or file of an arm; decides which names the error lists.

    Raises:
        SettingsError: no such file, with the names of the shipped configs.
    """
    shipped = assets() / "configs"
    folders = [Path(), shipped] if beside is None else [beside, Path(), shipped]
    for folder in folders:
        for candidate in (folder / name, folder / f"{name}.yaml"):
            if is_file(candidate):
                return candidate
    known = sorted(p.stem for p in shipped.glob("*.yaml") if (p.stem == "hydrolek") == (kind == "arm"))
    raise SettingsError(
        f"no such {kind}", where=str(name), hint=f"give a YAML file or one of: {', '.join(known)}"
    )
