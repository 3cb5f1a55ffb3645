"""A finding of a log: what is wrong or worth knowing, and its place in the file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hydroid.errors import LogError
from hydroid.findings import WORDS, Finding, Level


@dataclass(frozen=True)
class LogFinding(Finding):
    """A finding of one log.

    An error: the log cannot be used; a warning: look at it; a note: what the reader did. `line` [1-based] is
    that of the first place, or a row of a binary format, and `column` its name in the header.
    """

    source: str = ""
    line: int | None = None
    column: str = ""

    def error(self) -> LogError:
        """Return the finding as the error that ends a command."""
        return LogError(self.what, where=self.where, hint=self.hint)

    def __str__(self) -> str:
        return str(self.error())


def log_finding(
    level: Level,
    kind: str,
    source: str,
    subjects: Sequence[object] = (),
    place: tuple[str, int | None, str] = ("line", None, ""),
    **numbers: float | str,
) -> LogFinding:
    """Make a finding about a file.

    `place` is what its rows are called, the number of one [1-based] and a column's name. Joints among the
    subjects have numbers from 1.
    """
    rows, line, column = place
    where = source + (f", {rows} {line}" if line else "") + (f", column {column}" if column else "")
    return LogFinding(kind, level, tuple(map(str, subjects)), numbers, where, source, line, column)


def grouped(findings: Sequence[LogFinding]) -> list[tuple[Level, str]]:
    """Return findings as lines with their levels: what several joints or logs share stands once."""
    groups: dict[tuple[str, ...], list[LogFinding]] = {}
    for finding in findings:
        listed = "{names}" in WORDS[finding.kind][0]  # its sentence has room for several subjects
        about = finding.hint if listed else f"{finding.column} {finding.numbers.get('what', '')}"
        groups.setdefault((finding.level, finding.kind, about), []).append(finding)
    lines = list[tuple[Level, str]]()
    for group in groups.values():
        subjects = tuple(dict.fromkeys(subject for finding in group for subject in finding.subjects))
        first = replace(group[0], subjects=subjects)
        logs = [Path(log).name for log in dict.fromkeys(f.source for f in group) if log != first.source]
        names = ", ".join(logs[:3]) + (", ..." if len(logs) > 3 else "")
        also = f" (and in {len(logs)} more log{'s' * (len(logs) > 1)}: {names})" if logs else ""
        lines.append((first.level, f"{first}{also}"))
    return lines
