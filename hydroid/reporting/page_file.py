"""A report as files: one page that loads nothing, tables, and data; and its charts as figures.

The page is one HTML file: it carries its charts as data, with the script of Bokeh that draws them.
"""

import base64
import gzip
import json
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from hydroid.files import write_atomic
from hydroid.reporting.chart import Chart
from hydroid.reporting.page import Page, Plot, Section
from hydroid.reporting.table import Table, shown

_TEMPLATE, _OWN = "template.html.j2", ("page.css", "moving_arm.js", "charts.js")
_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


def write_page(page: Page, out: Path) -> list[Path]:
    """Write a report to the folder `out`: the page, its tables as CSV, Markdown and LaTeX, and its data.

    Raises:
        RunError: the folder cannot be written.
    """
    content: dict[str, str] = {}
    for name, table in page.tables.items():
        written = {"csv": table.csv(), "md": table.markdown(), "tex": table.latex()}
        content |= {f"tables/{name}.{ending}": text for ending, text in written.items()}
    content |= {**page.data, f"{page.name}.html": content_html(page_content(page))}
    for name, text in content.items():
        write_atomic(out / name, text)
    return [out / name for name in content]


def write_figures(page: Page, out: Path) -> list[Path]:
    """Write every chart of a page to the folder `out` as PNG and SVG; return the files.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.reporting.figure import rendered

    written: list[Path] = []
    for plot in page.plots:
        if isinstance(drawing := plot.draw(), Chart):
            for ending, image in zip(("png", "svg"), rendered(drawing), strict=True):
                written.append(out / f"{plot.name}.{ending}")
                write_atomic(written[-1], image)
    return written


def page_content(page: Page) -> dict[str, Any]:
    """Return all that a page shows as mappings, lists, text and numbers."""
    charts, moving = list[Any](), list[Any]()

    def plot(one: Plot) -> dict[str, Any]:
        drawing = one.draw()
        kind, drawn = ("chart", charts) if isinstance(drawing, Chart) else ("moving", moving)
        drawn.append(drawing.plain())
        return {"name": one.name, "caption": one.caption, "zoom": one.zoom, kind: len(drawn) - 1}

    def section(one: Section) -> dict[str, Any]:
        return {
            "title": one.title,
            "text": one.text,
            "points": list(one.points),
            "facts": [list(fact) for fact in one.facts],
            "tables": [_table(table) for table in one.tables.values()],
            "more": [_table(table) for table in one.more.values()],
            "plots": [plot(p) for p in one.plots],
            "tabs": [{"name": t.name, "note": t.note, "plots": [plot(p) for p in t.plots]} for t in one.tabs],
            "bars": [asdict(bar) for bar in one.bars],
            "steps": [asdict(step) for step in one.steps],
            "folded": one.folded,
            "link": one.link,
        }

    sections = [section(one) for one in page.sections]
    return {
        "name": page.name,
        "title": page.title,
        "lead": page.lead,
        "verdict": None if page.verdict is None else asdict(page.verdict),
        "warnings": list(page.warnings),
        "sections": sections,
        "charts": charts,
        "moving": moving,
        "versions": dict(page.versions),
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
    given = {name.replace(".", "_"): Markup(own.joinpath(name).read_text(encoding="utf-8")) for name in _OWN}
    template = environment.from_string(own.joinpath(_TEMPLATE).read_text(encoding="utf-8"))
    packed = _packed(json.dumps(content, ensure_ascii=False, separators=(",", ":")))
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
