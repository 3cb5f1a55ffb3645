"""What a study returns: its numbers and its report."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from hydroid.report.page import Page
    from hydroid.report.table import Table

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Study(Generic[T]):
    """What a study found.

    Attributes:
        result: the numbers.
        page: the report, with its tables by name in `page.tables`.
    """

    result: T
    page: "Page"

    @property
    def table(self) -> "Table":
        """The first table of the report."""
        return next(iter(self.page.tables.values()))

    def write(self, out: str | Path | None) -> "Study[T]":
        """Write the report to a folder, or nothing where it is None; return the study.

        Raises:
            RunError: the folder cannot be written.
        """
        if out is not None:
            from hydroid.report.page_file import write_page

            write_page(self.page, Path(out))
        return self
