"""A study's file: settings of a fit, what of them varies, seeds, and logs."""

from itertools import product
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from hydroid.errors import SettingsError
from hydroid.files import find_config
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import Settings, load

Changes = dict[str, Any]  # settings to replace, by dotted key, as `--set` has them

Axis = Annotated[dict[str, Changes] | tuple[Any, ...], Field(min_length=1)]


class StudySettings(Settings):
    """A study."""

    title: str
    """what it answers"""
    base: str
    """settings of a fit: a shipped name, or a YAML file relative to the study's file"""
    set: Changes = {}
    """settings to replace in every cell, by dotted key"""
    logs: Annotated[tuple[str, ...], Field(min_length=1)]
    """fitted logs, relative to the study's file"""
    axes: dict[str, Axis] = {}
    """what varies: a dotted key with a list of values, or a name with cells: {label: {key: value, ...}}"""
    seeds: Annotated[int, Field(ge=0, le=10_000)] = 10
    """number of seeds, from 1"""

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


def cell_settings(study: StudySettings, path: Path, extra: Changes | None = None) -> dict[str, FitSettings]:
    """Return the settings of a fit of every cell, with `extra` ones replaced, by the cell's name.
    Raises SettingsError: a setting that does not exist or is not allowed, with the study's file.
    """
    config = find_config(study.base, path.parent)
    try:
        return {
            name: load(config, FitSettings, study.set | changes | (extra or {}))
            for name, changes in study.changes().items()
        }
    except SettingsError as error:
        where = error.where.replace("--set", f"{path}:")
        raise SettingsError(error.what, where=where, hint=error.hint) from None
