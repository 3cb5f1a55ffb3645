"""A finding of a log: what is wrong or worth knowing, and its place in the file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hydroid.errors import LogError
from hydroid.findings import Finding, Level
from hydroid.words import hint, statement

MAX_NAMED = 3
"""logs by name in a line"""


@dataclass(frozen=True)
class LogFinding(Finding):
    """A finding of one log.

    An error: the log cannot be used; a warning: look at it; a note: what the reader did. `line` [1-based] is
    that of the first place, or a row of a binary format, and `column` its name in the header.
    """

    source: str = ""
    line: int | None = None
    column: str = ""

    @property
    def what(self) -> str:
        """What is wrong or worth knowing."""
        return statement(self)

    @property
    def hint(self) -> str:
        """What to do about it."""
        return hint(self)

    def error(self) -> LogError:
        """Return the finding as the error that ends a command."""
        return LogError(self.what, where=self.where, hint=self.hint)

    def __str__(self) -> str:
        return str(self.error())


@dataclass(frozen=True)
class Place:
    """Where findings stand: in a file, and in its line or row [1-based] and column where these are known."""

    source: str
    line: int | None = None
    column: str = ""
    name: str = "line"

    def finding(
        self, level: Level, kind: str, subjects: Sequence[object] = (), **numbers: float | str
    ) -> LogFinding:
        """Make a finding at this place; joints among its subjects have numbers from 1."""
        line = f", {self.name} {self.line}" if self.line else ""
        where = self.source + line + (f", column {self.column}" if self.column else "")
        names = tuple(map(str, subjects))
        return LogFinding(kind, level, names, numbers, where, self.source, self.line, self.column)


def unreadable(source: str, error: LogError) -> LogFinding:
    """Return the error that ended the reading of a log as a finding."""
    numbers: dict[str, float | str] = {"what": error.what, "hint": error.hint}
    return LogFinding("unreadable", "error", (), numbers, error.where, source)


def grouped(findings: Sequence[LogFinding]) -> list[tuple[LogFinding, list[str]]]:
    """Return the first finding of each kind, in order, with the other logs that have it too."""
    groups: dict[tuple[str, ...], list[LogFinding]] = {}
    for finding in findings:
        key = (finding.level, finding.kind, finding.column, str(finding.numbers.get("what", "")))
        groups.setdefault(key, []).append(finding)
    first = [(group[0], dict.fromkeys(f.source for f in group)) for group in groups.values()]
    return [(finding, [log for log in logs if log != finding.source]) for finding, logs in first]


def in_one_line(finding: LogFinding, others: Sequence[str]) -> str:
    """Return a finding and how many `others` logs have it too, as `grouped` gives them."""
    if not others:
        return str(finding)
    names = ", ".join(Path(log).name for log in others[:MAX_NAMED])
    names += ", ..." if len(others) > MAX_NAMED else ""
    return f"{finding} (and in {len(others)} more log{'s' if len(others) > 1 else ''}: {names})"
