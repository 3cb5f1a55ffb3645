"""A study's file: settings of a fit, what of them varies, seeds, and logs."""

from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from hydroid.errors import SettingsError
from hydroid.files import find_config
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import Settings, load

Changes = dict[str, Any]
"""settings to replace, by dotted key, as `--set` has them"""


class StudySettings(Settings):
    """A study."""

    title: str
    """what it answers"""
    base: str
    """settings of a fit: a shipped name, or a YAML file relative to the study's file"""
    set: Changes = Field(default_factory=dict[str, Any])
    """settings to replace in every cell, by dotted key"""
    logs: tuple[str, ...] = ()
    """fitted logs, relative to the study's file"""
    axes: dict[str, dict[str, Changes] | tuple[Any, ...]] = Field(default_factory=dict[str, Any])
    """what varies: a dotted key with a list of values, or a name with cells: {label: {key: value, ...}}"""
    seeds: Annotated[int, Field(ge=0, le=10_000)] = 10
    """number of seeds, from 1"""

    @model_validator(mode="after")
    def _few_cells(self) -> "StudySettings":
        count = prod(len(axis) for axis in self.axes.values())
        if not 0 < count <= 1000:
            raise ValueError(f"axes give {count} cells; 1 to 1000 are allowed")
        return self

    def changes(self) -> dict[str, Changes]:
        """Return the settings that each cell replaces, by the cell's name."""
        options = [
            axis.items() if isinstance(axis, dict) else [(f"{key} {value}", {key: value}) for value in axis]
            for key, axis in self.axes.items()
        ]
        return {
            ", ".join(label for label, _ in choice) or "all": {
                key: value for _, change in choice for key, value in change.items()
            }
            for choice in product(*options)
        }


def load_study(path: Path) -> StudySettings:
    """Read a study's file.

    Raises:
        SettingsError: a key or value that is not allowed, with file and line; no logs.
    """
    study = load(path, StudySettings)
    if not study.logs:
        raise SettingsError("logs: names no log", where=str(path), hint="for example logs: [a.csv, b.csv]")
    return study


def cell_settings(study: StudySettings, path: Path, extra: Changes | None = None) -> dict[str, FitSettings]:
    """Return the settings of a fit of every cell, with `extra` ones replaced, by the cell's name.

    Raises:
        SettingsError: a setting that does not exist or is not allowed, with the study's file and line.
    """
    config, cells = find_config(study.base, path.parent), dict[str, FitSettings]()
    for name, changes in study.changes().items():
        every = study.set | changes | (extra or {})
        try:
            cells[name] = load(config, FitSettings, every)
        except SettingsError as error:
            key = error.where.removeprefix("--set ")
            if key not in every:
                raise
            # the study's file and line in place of `--set KEY`
            line = next((n for place, n in read_yaml(path)[1].items() if place and place[-1] == key), None)
            where = f"{path}, line {line}" if line else str(path)
            what = error.what if key in error.what else f"{key}: {error.what}"
            raise SettingsError(what, where=where, hint=error.hint) from None
    return cells
