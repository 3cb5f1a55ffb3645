"""Findings: what an analysis has to say, in the words of `findings.yaml`, for terminal,
JSON and report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from hydroid.files import read_table
from hydroid.words import filled

Level = Literal["error", "warning", "note"]
"""error: the input or result cannot be used; warning: do not use it unread; note: good
to know"""


@dataclass(frozen=True)
class Finding:
    """One thing that an analysis found; as text it is what it states, and the hint.

    Attributes:
        kind: key of its words in `WORDS`. Decisions are made on it, never on a
            sentence.
        level: how much it matters.
        subjects: names of what it is about: parameters, joints, logs.
        numbers: what the sentence states, by name, in the units that the sentence
            prints.
        details: by subject, what stands in brackets behind it. Apart from `numbers`: a
            user names subjects.
        where: file with line and column, or a setting; empty where there is none.
    """

    kind: str
    level: Level
    subjects: tuple[str, ...] = ()
    numbers: Mapping[str, float | str] = field(default_factory=dict[str, float | str])
    where: str = ""
    details: Mapping[str, str] = field(default_factory=dict[str, str], kw_only=True)

    @property
    def what(self) -> str:
        """The sentence that states it."""
        return self._filled(WORDS[self.kind][0])

    @property
    def hint(self) -> str:
        """The sentence that says what to do about it; empty where nothing is to be
        done."""
        return self._filled(WORDS[self.kind][1])

    def _filled(self, words: str) -> str:
        details = self.details
        names = [
            f"{name} ({details[name]})" if name in details else name
            for name in self.subjects
        ]
        return filled(words, names, self.numbers)

    def __str__(self) -> str:
        return f"{self.what} {self.hint}".strip()


_TABLE: dict[str, list[str]] = read_table("findings.yaml")

WORDS = {
    kind: (statement, " ".join(hint)) for kind, (statement, *hint) in _TABLE.items()
}
"""statement and hint by kind; a hint may be empty"""

OF_ENDING = frozenset(
    ("not refined", "time up", "not converged", "not converged from its start")
)
"""kinds that say why an estimate need not be an optimum"""
OF_OPTIMUM = frozenset(
    (
        "strained prior",
        "at bound",
        "several optima",
        "behind nine numbers",
        "behind nine numbers from its start",
        "error lasts",
    )
)
"""kinds whose advice holds only of an estimate that has converged"""
