"""A study's file: settings of a fit, what of them varies, seeds, data, and what is shown and claimed."""

import re
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import NotNegative, Positive, Settings, load

MOST_CELLS = 1000
"""cells of a study at most"""

Changes = dict[str, Any]
"""settings to replace, by dotted key, as `--set` has them"""


class SimulatedData(Settings):
    """Data simulated at the true parameters under pseudo-random commands, as in the article's figure 17."""

    pose: str = "study"
    """name of the arm's pose at the start"""
    joints: Annotated[tuple[int, ...], Field(min_length=1)] = (2,)
    """joints that are driven, numbered from 1"""
    duration_s: Positive = 75.0
    """length [s]"""
    seed: Annotated[int, Field(ge=0)] = 0
    """of the commands and of the noise"""
    range_deg: tuple[float, float] | None = None
    """a level that would move a compared joint out of this range is turned round or reduced [deg]"""
    noise_deg: NotNegative = 0.0
    """standard deviation of white noise on the simulated angles [deg]"""


class CheckLog(Settings):
    """A log that is only predicted."""

    log: str
    """CSV file, relative to the study's file"""
    set: Changes = Field(default_factory=dict[str, Any])
    """settings of its own, by dotted key, such as columns that it is read with"""


class DataSettings(Settings):
    """What the runs are fitted to: simulated data or logs; and what is known of the truth."""

    truth: dict[str, float] = Field(default_factory=dict[str, float])
    """true parameters by name: needed by simulated data and by errors of parameters"""
    simulated: SimulatedData | None = None
    """simulate the data"""
    logs: tuple[str, ...] = ()
    """CSV files, relative to the study's file"""
    checks: dict[str, CheckLog] = Field(default_factory=dict[str, CheckLog])
    """further logs, by name, that every estimate predicts"""
    determined_at_deg: Positive = 0.1
    """noise of the angle for which a direction counts as identifiable (docs/studies.md) [deg]"""

    @model_validator(mode="after")
    def _one(self) -> "DataSettings":
        if (self.simulated is None) == (not self.logs):
            raise ValueError("give either simulated: {...} or logs: [...]")
        if self.simulated is not None and not self.truth:
            raise ValueError("simulated data need a truth: {parameter: value}")
        return self


def item_of(title: str) -> str:
    """Return `table 6` of a title such as "Table 6: errors"; empty where it has no such beginning."""
    found = re.match(r"(table|figure) \d+(?=[:,])", title.lower())
    return found[0] if found else ""


class StudyTable(Settings):
    """A table: a row for each cell of the study, a column for each measure."""

    title: str
    """above the table"""
    columns: Annotated[tuple[str, ...], Field(min_length=1)]
    """measures, by name (docs/studies.md)"""
    article: dict[str, tuple[float | None, ...]] = Field(default_factory=dict[str, Any])
    """printed values by cell, in the order of the columns; null where the article prints none"""
    cells: tuple[str, ...] = ()
    """cells in the table; none: all"""
    note: str = ""
    """below the table"""


class StudyFigure(Settings):
    """A figure."""

    title: str
    """above the figure"""
    kind: Literal[
        "convergence", "spread", "responses", "commands", "segments", "segment bests",
        "sensitivity", "surface", "arm", "flow chart",
    ]  # fmt: skip
    """convergence: best objective by generation; spread: a measure of every run; responses: of the median
    run of each cell; segment bests: the best candidate of each segment, and the estimate; sensitivity and
    surface are drawn at the true parameters; flow chart: of the simple GA"""
    says: str = ""
    """a statement that the figure is judged by (docs/studies.md); none: it is only drawn"""
    cells: tuple[str, ...] = ()
    """cells that are drawn; none: all"""
    column: str = "parameter error"
    """spread: the measure"""
    normalized: bool = False
    """convergence: scale every curve to 0 to 1"""
    parameters: tuple[str, ...] = ()
    """sensitivity and surface: parameters drawn"""
    orders: dict[str, tuple[tuple[str, ...], ...]] = Field(default_factory=dict[str, Any])
    """sensitivity: statements in place of `says`, each with groups of parameters, the largest effect first"""
    window_s: tuple[NotNegative, Positive] | None = None
    """sensitivity: part of the record that is drawn [s]; null: all of it"""
    points: Annotated[int, Field(ge=3, le=101)] = 31
    """surface: values of each parameter"""
    actuators: dict[Literal["linear", "rotary"], int] = Field(default_factory=dict[Any, int])
    """arm: how many of each kind it is said to have"""

    @property
    def item(self) -> str:
        """The article's item that the figure is, as its title says; empty where it is none."""
        return item_of(self.title)

    @model_validator(mode="after")
    def _judged(self) -> "StudyFigure":
        if self.says and self.kind in ("convergence", "spread", "sensitivity"):
            other = "under orders" if self.kind == "sensitivity" else "as a claim"
            raise ValueError(f"a figure of kind {self.kind} judges no statement; give it {other}")
        return self


class Claim(Settings):
    """A statement that is tested over the seeds: one cell has the lower measure than another."""

    says: str
    """the statement"""
    item: str = ""
    """the article's table or figure that says so, one of the study's `items`"""
    column: str = ""
    """the measure"""
    lower: str = ""
    """cell that has the lower value if the statement is true"""
    than: str = ""
    """cell that it is compared with"""
    ours: bool = False
    """the statement is not the article's"""
    untested: str = ""
    """why no run can tell, in place of column, lower and than"""

    @model_validator(mode="after")
    def _testable(self) -> "Claim":
        if bool(self.untested) == all((self.column, self.lower, self.than)):
            raise ValueError("give column, lower and than; or untested: REASON")
        return self


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
        known = self.changes()
        named = [(f"tables.{i}.article", c) for i, t in enumerate(self.tables) for c in t.article]
        named += [(f"figures.{i}.cells", c) for i, f in enumerate(self.figures) for c in f.cells]
        named += [
            (f"claims.{i}", c)
            for i, claim in enumerate(self.claims)
            for c in (claim.lower, claim.than)
            if not claim.untested
        ]
        named += [(f"tables.{i}.cells", c) for i, t in enumerate(self.tables) for c in t.cells]
        for where, cell in named:
            if cell not in known:
                raise ValueError(f"{where}: no cell {cell!r}; the cells: {', '.join(known)}")
        for i, claim in enumerate(self.claims):
            if claim.item and claim.item not in self.items:
                raise ValueError(f"claims.{i}: {claim.item!r} is none of the items {', '.join(self.items)}")
        for i, table in enumerate(self.tables):
            for cell, values in table.article.items():
                if len(values) != len(table.columns):
                    wanted = f"{len(table.columns)} values, one for each column"
                    raise ValueError(f"tables.{i}.article.{cell}: needs {wanted}, not {len(values)}")
        return self

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
