"""A report as files: one page that loads nothing, tables, and data for scripts; and its charts as figures.

The page is one HTML file: it carries its charts as data, compressed, with the script of Bokeh that draws them.
`read_page` takes the content out of such a file again, so that it can be drawn anew, compared, or written as
figures.
"""

import base64
import gzip
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from hydroid.errors import RunError
from hydroid.files import write_atomic
from hydroid.report.chart import Chart
from hydroid.report.moving_arm import MovingArm
from hydroid.report.page import Page, Plot, Section
from hydroid.report.table import Table, shown

SCHEMA = 2
"""version of the content that a page carries"""
_CONTENT = re.compile(rb'<script type="text/plain" id="content">([A-Za-z0-9+/=]*)</script>')
_TEMPLATE, _OWN = "template.html.j2", ("page.css", "moving_arm.js", "charts.js")
_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


def write_page(page: Page, out: Path) -> list[Path]:
    """Write a report to the folder `out`: the page, its tables as CSV, Markdown and LaTeX, and its data.

    Raises:
        RunError: the folder cannot be written.
    """
    content = {f"{page.name}.html": content_html(page_content(page)), **page.data}
    for name, table in page.tables.items():
        written = {"csv": table.csv(), "md": table.markdown(), "tex": table.latex()}
        content |= {f"tables/{name}.{ending}": text for ending, text in written.items()}
    for name, text in content.items():
        write_atomic(out / name, text)
    return [out / name for name in content]


def write_figures(content: Mapping[str, Any], out: Path) -> list[Path]:
    """Write every chart of a page's content to the folder `out` as PNG and SVG; return the files.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.report.figure import rendered

    written: list[Path] = []
    for plot in _plots(content):
        if "chart" in plot:
            images = rendered(Chart.of(content["charts"][plot["chart"]]))
            for ending, image in zip(("png", "svg"), images, strict=True):
                written.append(out / f"{plot['name']}.{ending}")
                write_atomic(written[-1], image)
    return written


def _plots(content: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for section in content["sections"]:
        for some in (section, *section["tabs"]):
            yield from some["plots"]


def page_content(page: Page) -> dict[str, Any]:
    """Return all that a page shows as mappings, lists, text and numbers."""
    kinds: dict[str, list[Any]] = {"chart": [], "moving": [], "image": []}

    def plot(one: Plot) -> dict[str, Any]:
        drawing = one.draw()
        kind = {Chart: "chart", MovingArm: "moving"}.get(type(drawing), "image")
        kinds[kind].append(_image(drawing) if kind == "image" else drawing.plain())
        return {"name": one.name, "caption": one.caption, "zoom": one.zoom, kind: len(kinds[kind]) - 1}

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
        "schema": SCHEMA,
        "name": page.name,
        "title": page.title,
        "lead": page.lead,
        "verdict": None if page.verdict is None else asdict(page.verdict),
        "warnings": list(page.warnings),
        "sections": sections,
        "charts": kinds["chart"],
        "moving": kinds["moving"],
        "images": kinds["image"],
        "versions": dict(page.versions),
        "numbers": dict(page.numbers),
    }
