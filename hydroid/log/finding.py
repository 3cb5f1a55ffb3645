"""One thing that a reader noticed in a log."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from hydroid.errors import LogError


@dataclass(frozen=True)
class Finding:
    """What is wrong or worth knowing, where, and what to do.

    Attributes:
        level: `error`: the log cannot be used; `warning`: look at it; `note`: what the reader did.
        what: a clause without a full stop.
        source: the file.
        hint: what to do.
        line: [1-based] of the first place, where there is one.
        column: its name in the header, where there is one.
    """

    level: Literal["error", "warning", "note"]
    what: str
    source: str
    hint: str = ""
    line: int | None = None
    column: str = ""

    @property
    def where(self) -> str:
        """The file, and the line and column where known."""
        line = f", line {self.line}" if self.line else ""
        return self.source + line + (f", column {self.column}" if self.column else "")

    def error(self) -> LogError:
        """Return the finding as the error that ends a command."""
        return LogError(self.what, where=self.where, hint=self.hint)

    def __str__(self) -> str:
        return str(self.error())


Warn = Callable[[Finding], None]
"""receives warnings and notes about a log"""


def numbered(joints: Sequence[int]) -> str:
    """Return "joint 2" or "joints 2, 3"."""
    return f"joint{'' if len(joints) == 1 else 's'} {', '.join(map(str, joints))}"
