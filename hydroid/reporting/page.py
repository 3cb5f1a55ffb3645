"""A report as data: sections of text, tables, charts and steps; `page_file` writes it."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from hydroid.findings import Finding
from hydroid.log import Log
from hydroid.reporting.table import Table


@dataclass(frozen=True)
class Plot:
    """A figure: its name on the page, what it shows in words, and the function that makes it.

    That returns a `Chart`, which the page shows with buttons to zoom it if `zoom`, or a `MovingArm`.
    """

    name: str
    caption: str
    draw: Callable[[], Any]
    zoom: bool = False


@dataclass(frozen=True)
class Tab:
    """One of several figures of which a reader sees one at a time.

    Its button stands in a `row` and a `column`, where these are given; its `state` (`good`, `fair`, `bad`)
    gives the colour.
    """

    name: str
    plot: Plot
    row: str = ""
    column: str = ""
    state: str = ""


@dataclass(frozen=True)
class Section:
    """A heading with text, points to note, tables by file name, and figures; folded sections open on demand.

    `steps` are findings that say what to do and what it would bring; their number `command` does it. `cards`
    are small tables side by side.
    """

    title: str
    text: str = ""
    points: tuple[str, ...] = ()
    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    cards: Mapping[str, Table] = field(default_factory=dict[str, Table])
    plots: tuple[Plot, ...] = ()
    tabs: tuple[Tab, ...] = ()
    steps: tuple[Finding, ...] = ()
    folded: bool = False


@dataclass(frozen=True)
class Page:
    """A report.

    Attributes:
        name: of the page's file, without ending.
        title: of the page.
        lead: the answer in a sentence.
        sections: in order.
        warnings: what a reader must know before using the answer; stand behind the first section.
        versions: of the software, printed at the foot.
        data: further files by name, such as CSV for scripts.
    """

    name: str
    title: str
    lead: str
    sections: tuple[Section, ...]
    warnings: tuple[str, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict[str, str])
    data: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def plots(self) -> Iterator[Plot]:
        """All figures."""
        for section in self.sections:
            yield from (*section.plots, *(tab.plot for tab in section.tabs))

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by file name."""
        return {name: table for s in self.sections for name, table in {**s.tables, **s.cards}.items()}


def log_names(logs: Sequence[Log]) -> list[str]:
    """Return short names of logs, all different."""
    names: list[str] = []
    for log in logs:
        names.append(unique(short_name(Path(log.source).name or log.source), names))
    return names


def unique(name: str, taken: Collection[str]) -> str:
    """Return the name, numbered where it is taken."""
    candidates = (f"{name} ({n})" if n > 1 else name for n in count(1))
    return next(candidate for candidate in candidates if candidate not in taken)


def short_name(name: str) -> str:
    """Return a name with unprintable characters replaced and the middle of one over 40 letters left out."""
    text = "".join(c if c.isprintable() else "?" for c in name)
    return text if len(text) <= 40 else f"{text[:19]}…{text[-20:]}"
