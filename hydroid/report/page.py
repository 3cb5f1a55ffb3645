"""A report: sections of text, tables and figures, written as one page and as files.

Every command builds a `Page` and `write_page` writes it: the page itself, `tables/` (CSV, Markdown, LaTeX),
`figures/` (PNG, SVG) and data for scripts. The page holds its figures inside and loads nothing from
elsewhere, so that it can be mailed and printed. Figures are drawn one after another while they are written.
"""

import base64
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import count
from pathlib import Path

from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from hydroid.files import write_atomic
from hydroid.log import Log
from hydroid.report.style import rendered, style
from hydroid.report.table import Table, shown

_LONGEST_NAME = 40


@dataclass(frozen=True)
class Plot:
    """A figure: the name of its files, what it shows in words, and the function that draws it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Section:
    """A heading with text, points to note, facts, tables by file name, and figures."""

    title: str
    text: str = ""
    points: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    plots: tuple[Plot, ...] = ()


@dataclass(frozen=True)
class Page:
    """A report.

    Attributes:
        name: of the page's file, without ending.
        title: of the page.
        lead: the answer in a sentence.
        sections: in order.
        warnings: what a reader must know before using the answer; stands at the top.
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
    def tables(self) -> dict[str, Table]:
        """All tables by file name."""
        return {name: table for section in self.sections for name, table in section.tables.items()}


def write_page(page: Page, out: Path) -> list[Path]:
    """Write a report to the folder `out`; return the files.

    Raises:
        RunError: the folder cannot be written.
    """
    content: dict[str, str | bytes] = {}
    for name, table in page.tables.items():
        content |= {
            f"tables/{name}.csv": table.csv(),
            f"tables/{name}.md": table.markdown(),
            f"tables/{name}.tex": table.latex(),
        }
    vector: dict[str, bytes] = {}
    with style():
        for plot in (plot for section in page.sections for plot in section.plots):
            png, vector[plot.name] = rendered(plot.draw())
            content |= {f"figures/{plot.name}.png": png, f"figures/{plot.name}.svg": vector[plot.name]}
    content |= {**page.data, f"{page.name}.html": page_html(page, vector)}
    for name, text in content.items():
        write_atomic(out / name, text)
    return [out / name for name in content]


def page_html(page: Page, figures: Mapping[str, bytes]) -> str:
    """Return the page as HTML, with its figures as SVG by name."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    # inside an image, the ids of two figures cannot clash
    address = {
        name: f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}" for name, svg in figures.items()
    }
    environment.filters["shown"] = shown
    source = files("hydroid.report").joinpath("template.html.j2").read_text(encoding="utf-8")
    return environment.from_string(source).render(page=page, address=address)


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


def file_name(text: str, taken: set[str]) -> str:
    """Return a name of letters, digits, dot, dash and underscore, and add it to `taken`.

    It is numbered where a name that differs only in case is taken.
    """
    safe = re.sub(r"[^A-Za-z0-9._-]+", "_", text)
    candidates = (f"{safe}_{n}" if n > 1 else safe for n in count(1))
    name = next(candidate for candidate in candidates if candidate.lower() not in taken)
    taken.add(name.lower())
    return name


def short_name(name: str) -> str:
    """Return a name with unprintable characters replaced and the middle of a long one left out."""
    text = "".join(c if c.isprintable() else "?" for c in name)
    half = _LONGEST_NAME // 2
    return text if len(text) <= _LONGEST_NAME else f"{text[: half - 1]}…{text[-half:]}"
