"""A report: sections of text, tables, charts and figures, written as one page and as files.

Every command builds a `Page` and `write_page` writes it: the page itself, `tables/` (CSV, Markdown, LaTeX),
`figures/` (PNG, SVG) and data for scripts. The page is one HTML file that loads nothing from elsewhere: it
carries its charts as data, compressed, with the script of Bokeh that draws them. `read_page` takes the
content out of such a file again, so that it can be drawn anew and compared.
"""

import base64
import gzip
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.resources import files
from itertools import count
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from hydroid.errors import RunError
from hydroid.files import write_atomic
from hydroid.log import Log
from hydroid.reporting.chart import Chart, figure
from hydroid.reporting.style import rendered, style
from hydroid.reporting.table import Table, shown

SCHEMA = 1
"""version of the content that a page carries"""
_LONGEST_NAME = 40
PAGE, FILE = frozenset({"page"}), frozenset({"file"})
"""where a figure is shown"""
_CONTENT = re.compile(rb'<script type="text/plain" id="content">([A-Za-z0-9+/=]*)</script>')
_OWN = ("template.html.j2", "page.css", "charts.js")
_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


@dataclass(frozen=True)
class Plot:
    """A figure: the name of its files, what it shows in words, and the function that draws it.

    A `Chart` is drawn by the page, with buttons to zoom it if `zoom`; a matplotlib figure is an image there.
    `where` says where it is shown: in the page, as a file, or both.
    """

    name: str
    caption: str
    draw: Callable[[], Figure | Chart]
    zoom: bool = False
    where: frozenset[str] = PAGE | FILE


@dataclass(frozen=True)
class Tab:
    """One of several groups of figures of which a reader sees one at a time."""

    name: str
    plots: tuple[Plot, ...]
    note: str = ""


@dataclass(frozen=True)
class Bar:
    """One quantity on a bar from its lower to its upper bound; positions are parts of the bar, 0 to 1.

    Attributes:
        symbol, name: short, and in plain words.
        value, interval: in words, with the unit.
        ends: the bounds in words; empty where there are none.
        note: what is to be known about it.
        state: `known`, `weak`, `unknown` or `fixed`.
        at: position of the value.
        band: ends of its 95 % interval.
        prior: ends of the interval that its prior gives.
        dots: positions of other estimates.
    """

    symbol: str
    name: str
    value: str
    interval: str = ""
    ends: tuple[str, str] = ("", "")
    note: str = ""
    state: str = "known"
    at: float | None = None
    band: tuple[float, float] | None = None
    prior: tuple[float, float] | None = None
    dots: tuple[float, ...] = ()


@dataclass(frozen=True)
class Step:
    """Something to do next, and what it is predicted to bring."""

    what: str
    gain: str


@dataclass(frozen=True)
class Section:
    """A heading with text, points to note, facts, tables by file name, bars and figures.

    `more` are tables that are shown on demand. All of a `folded` section is.
    """

    title: str
    text: str = ""
    points: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    plots: tuple[Plot, ...] = ()
    tabs: tuple[Tab, ...] = ()
    bars: tuple[Bar, ...] = ()
    steps: tuple[Step, ...] = ()
    more: Mapping[str, Table] = field(default_factory=dict[str, Table])
    folded: bool = False

    @property
    def all_plots(self) -> Iterator[Plot]:
        """Its figures, and those of its tabs."""
        yield from self.plots
        for tab in self.tabs:
            yield from tab.plots


@dataclass(frozen=True)
class Light:
    """One question with its answer: `good`, `fair`, `bad`, or `open` where nobody has looked."""

    question: str
    state: str
    answer: str


@dataclass(frozen=True)
class Verdict:
    """The answer in a sentence on the prediction and one on the parameters, lights, and a picture (SVG)."""

    prediction: str
    parameters: str = ""
    lights: tuple[Light, ...] = ()
    picture: str = ""


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
        verdict: stands above all sections.
        numbers: values by name for comparisons (`comparison`).
    """

    name: str
    title: str
    lead: str
    sections: tuple[Section, ...]
    warnings: tuple[str, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict[str, str])
    data: Mapping[str, str] = field(default_factory=dict[str, str])
    verdict: Verdict | None = None
    numbers: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by file name."""
        return {n: table for s in self.sections for n, table in {**s.tables, **s.more}.items()}


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
    images, charts = dict[str, bytes](), dict[str, Chart]()
    with style():
        for plot in (plot for section in page.sections for plot in section.all_plots):
            drawn = plot.draw()
            if isinstance(drawn, Chart):
                charts[plot.name] = drawn
                if not plot.where >= FILE:
                    continue
                drawn = figure(drawn)
            png, svg = rendered(drawn)
            content |= {f"figures/{plot.name}.png": png, f"figures/{plot.name}.svg": svg}
            if plot.name not in charts and plot.where >= PAGE:
                images[plot.name] = svg
    html = content_html(page_content(page, charts, images))
    content |= {**page.data, f"{page.name}.html": html}
    for name, text in content.items():
        write_atomic(out / name, text)
    return [out / name for name in content]


def page_content(page: Page, charts: Mapping[str, Chart], images: Mapping[str, bytes]) -> dict[str, Any]:
    """Return all that a page shows as mappings, lists, text and numbers; images are SVG."""
    order = list(charts)

    def plots(some: Sequence[Plot]) -> list[dict[str, Any]]:
        return [
            {"name": p.name, "caption": p.caption, "zoom": p.zoom}
            | ({"chart": order.index(p.name)} if p.name in charts else {})
            for p in some
            if p.name in charts or p.name in images
        ]

    def section(one: Section) -> dict[str, Any]:
        return {
            "title": one.title,
            "text": one.text,
            "points": list(one.points),
            "facts": [list(fact) for fact in one.facts],
            "tables": [_table(table) for table in one.tables.values()],
            "more": [_table(table) for table in one.more.values()],
            "plots": plots(one.plots),
            "tabs": [{"name": t.name, "note": t.note, "plots": plots(t.plots)} for t in one.tabs],
            "bars": [asdict(bar) for bar in one.bars],
            "steps": [asdict(step) for step in one.steps],
            "folded": one.folded,
        }

    return {
        "schema": SCHEMA,
        "name": page.name,
        "title": page.title,
        "lead": page.lead,
        "verdict": None if page.verdict is None else asdict(page.verdict),
        "warnings": list(page.warnings),
        "sections": [section(one) for one in page.sections],
        "charts": [chart.plain() for chart in charts.values()],
        "images": {name: svg.decode() for name, svg in images.items()},
        "versions": dict(page.versions),
        "numbers": dict(page.numbers),
    }


def _table(table: Table) -> dict[str, Any]:
    rows = [[shown(cell) for cell in row] for row in table.rows]
    parts = {"title": table.title, "header": list(table.header), "note": table.note}
    return parts | {"numeric": list(table.numeric), "rows": rows}


def content_html(content: Mapping[str, Any]) -> str:
    """Return the page of a content as HTML."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    own = files("hydroid.reporting")
    read = {name: own.joinpath(name).read_text(encoding="utf-8") for name in _OWN}
    given = {name.replace(".", "_"): Markup(text) for name, text in read.items() if name != _OWN[0]}
    packed = _packed(json.dumps(content, ensure_ascii=False, separators=(",", ":")))
    template = environment.from_string(read[_OWN[0]])
    return template.render(
        page=content, content=packed, library=_library() if content["charts"] else "", **given
    )


@cache
def _library() -> str:
    """Bokeh's scripts, from the installed package."""
    folder = files("bokeh").joinpath("server", "static", "js")
    return _packed(";\n".join(folder.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS))


def _packed(text: str) -> str:
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def read_page(file: Path) -> dict[str, Any]:
    """Return the content of a page that `write_page` has written.

    Raises:
        RunError: the file is no such page, or is of another version.
    """
    try:
        found = _CONTENT.search(file.read_bytes())
        content = json.loads(gzip.decompress(base64.b64decode(found[1]))) if found else {}
    except (OSError, ValueError, EOFError) as error:
        raise RunError(f"cannot be read ({error})", where=str(file)) from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise RunError(
            "is no report of this version of hydroid", where=str(file), hint="run the command again"
        )
    return content


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
