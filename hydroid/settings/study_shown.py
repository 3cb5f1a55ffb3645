"""What a study shows and claims: tables and figures, the article's numbers, and statements to be judged."""

import re
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from hydroid.settings.load import NotNegative, Positive, Settings


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
