"""A study's file: settings of a fit, what of them varies, seeds, data, and what is shown and claimed."""

from collections.abc import Collection
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import Positive, Settings, load
from hydroid.settings.study_data import Changes, DataSettings
from hydroid.settings.study_shown import Claim, StudyFigure, StudyTable

MOST_CELLS = 1000
"""cells of a study at most"""


class QuickSettings(Settings):
    """The short form, which shows that a study runs, not what is true."""

    seeds: Annotated[int, Field(ge=0, le=10_000)] = 2
    """number of seeds"""
    duration_s: Positive = 15.0
    """length of the data at most [s]"""
    set: Changes = Field(default_factory=dict[str, Any])
    """settings to replace in every cell, by dotted key"""
    points: Annotated[int, Field(ge=3, le=101)] = 7
    """values of each parameter of a surface"""


class StudySettings(Settings):
    """A study."""

    title: str
    """what it answers"""
    about: str = ""
    """a few sentences for its page: what is compared, and what was chosen where the article is silent"""
    items: tuple[str, ...] = ()
    """tables and figures of the article that it makes, such as table 6"""
    base: str
    """settings of a fit: a shipped name, or a YAML file relative to the study's file"""
    set: Changes = Field(default_factory=dict[str, Any])
    """settings to replace in every cell, by dotted key"""
    data: DataSettings
    axes: dict[str, dict[str, Changes] | tuple[Any, ...]] = Field(default_factory=dict[str, Any])
    """what varies: a dotted key with a list of values, or a name with cells: {label: {key: value, ...}}"""
    seeds: Annotated[int, Field(ge=0, le=10_000)] = 10
    """number of seeds, from 1; 0: nothing is fitted"""
    tables: tuple[StudyTable, ...] = ()
    figures: tuple[StudyFigure, ...] = ()
    claims: tuple[Claim, ...] = ()
    quick: QuickSettings = QuickSettings()

    @model_validator(mode="after")
    def _consistent(self) -> "StudySettings":
        count = prod(len(axis) for axis in self.axes.values())
        if not 0 < count <= MOST_CELLS:
            raise ValueError(f"axes give {count} cells; 1 to {MOST_CELLS} are allowed")
        self._name_cells(self.changes())
        for i, claim in enumerate(self.claims):
            if claim.item and claim.item not in self.items:
                raise ValueError(f"claims.{i}: {claim.item!r} is none of the items {', '.join(self.items)}")
        for i, table in enumerate(self.tables):
            for cell, values in table.article.items():
                if len(values) != len(table.columns):
                    wanted = f"{len(table.columns)} values, one for each column"
                    raise ValueError(f"tables.{i}.article.{cell}: needs {wanted}, not {len(values)}")
        return self

    def _name_cells(self, known: Collection[str]) -> None:
        """Refuse a cell that does not exist."""
        named = [(f"tables.{i}.article", c) for i, t in enumerate(self.tables) for c in t.article]
        named += [(f"tables.{i}.cells", c) for i, t in enumerate(self.tables) for c in t.cells]
        named += [(f"figures.{i}.cells", c) for i, f in enumerate(self.figures) for c in f.cells]
        tested = [(i, claim) for i, claim in enumerate(self.claims) if not claim.untested]
        named += [(f"claims.{i}", c) for i, claim in tested for c in (claim.lower, claim.than)]
        for where, cell in named:
            if cell not in known:
                raise ValueError(f"{where}: no cell {cell!r}; the cells: {', '.join(known)}")

    def changes(self) -> dict[str, Changes]:
        """Return the settings that each cell replaces, by the cell's name."""
        options = [
            axis.items() if isinstance(axis, dict) else [(f"{key} {value}", {key: value}) for value in axis]
            for key, axis in self.axes.items()
        ]
        cells: dict[str, Changes] = {}
        for choice in product(*options):
            merged: Changes = {}
            for _, each in choice:
                merged |= each
            cells[", ".join(label for label, _ in choice) or "all"] = merged
        return cells


def load_study(path: Path) -> StudySettings:
    """Read a study's file.

    Raises:
        SettingsError: a key or value that is not allowed, with file and line.
    """
    return load(path, StudySettings)


def cell_settings(
    study: StudySettings, path: Path, *, quick: bool, extra: Changes | None = None
) -> dict[str, FitSettings]:
    """Return the settings of a fit of every cell, with `extra` ones replaced, by the cell's name.

    Raises:
        SettingsError: a setting that does not exist or is not allowed, with the study's file and line.
    """
    config, cells = find_config(study.base, path.parent), dict[str, FitSettings]()
    for name, changes in study.changes().items():
        every = study.set | changes | (study.quick.set if quick else {}) | (extra or {})
        try:
            cells[name] = load(config, FitSettings, every)
        except SettingsError as error:
            raise _in_study(error, path, every) from None
    return cells


def _in_study(error: SettingsError, path: Path, changes: Changes) -> SettingsError:
    """Return an error of a replaced setting with the study's file and line in place of `--set KEY`."""
    key = error.where.removeprefix("--set ")
    if key not in changes:
        return error
    _, lines = read_yaml(path)
    line = next((number for place, number in lines.items() if place and place[-1] == key), None)
    where = f"{path}, line {line}" if line else str(path)
    what = error.what if key in error.what else f"{key}: {error.what}"
    return SettingsError(what, where=where, hint=error.hint)
