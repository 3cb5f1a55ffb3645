"""A report as files: one page that loads nothing, tables, figures, and data for scripts.

Every command builds a `Page` and `write_page` writes it: the page itself, `tables/` (CSV, Markdown, LaTeX),
`figures/` (PNG, SVG) and data for scripts. The page is one HTML file that loads nothing from elsewhere: it
carries its charts as data, compressed, with the script of Bokeh that draws them. `read_page` takes the
content out of such a file again, so that it can be drawn anew and compared.
"""

import base64
import gzip
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from hydroid.errors import RunError
from hydroid.files import write_atomic
from hydroid.report.chart import Chart, figure
from hydroid.report.moving_arm import MovingArm
from hydroid.report.page import FILE, PAGE, Drawing, Page, Plot, Section
from hydroid.report.style import rendered, style
from hydroid.report.table import Table, shown

SCHEMA = 1
"""version of the content that a page carries"""
_CONTENT = re.compile(rb'<script type="text/plain" id="content">([A-Za-z0-9+/=]*)</script>')
_OWN = ("template.html.j2", "page.css", "moving_arm.js", "charts.js")
_SCRIPTS = ("bokeh.min.js", "bokeh-api.min.js")


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
    images = dict[str, bytes]()
    with style():
        drawn = drawings(page)
        for plot in page.plots:
            drawing = drawn[plot.name]
            if isinstance(drawing, Chart) and plot.where >= FILE:
                drawing = figure(drawing)
            if isinstance(drawing, Figure):
                png, images[plot.name] = rendered(drawing)
                if plot.where >= FILE:
                    content |= {
                        f"figures/{plot.name}.png": png,
                        f"figures/{plot.name}.svg": images[plot.name],
                    }
    content |= {**page.data, f"{page.name}.html": content_html(page_content(page, drawn, images))}
    for name, text in content.items():
        write_atomic(out / name, text)
    return [out / name for name in content]


def drawings(page: Page) -> dict[str, Drawing]:
    """Return all that a page and its files draw, by name."""
    return {plot.name: plot.draw() for plot in page.plots}


def page_content(
    page: Page, drawn: Mapping[str, Drawing], images: Mapping[str, bytes] | None = None
) -> dict[str, Any]:
    """Return all that a page shows as mappings, lists, text and numbers; images are SVG."""
    charts = {name: one.plain() for name, one in drawn.items() if isinstance(one, Chart)}
    moving = {name: one.plain() for name, one in drawn.items() if isinstance(one, MovingArm)}
    place = {name: {"chart": i} for i, name in enumerate(charts)}
    place |= {name: {"moving": i} for i, name in enumerate(moving)}
    shown = {plot.name for plot in page.plots if plot.where >= PAGE} - charts.keys() - moving.keys()

    def plots(some: Sequence[Plot]) -> list[dict[str, Any]]:
        return [
            {"name": p.name, "caption": p.caption, "zoom": p.zoom} | place.get(p.name, {})
            for p in some
            if p.where >= PAGE
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
            "link": one.link,
        }

    return {
        "schema": SCHEMA,
        "name": page.name,
        "title": page.title,
        "lead": page.lead,
        "verdict": None if page.verdict is None else asdict(page.verdict),
        "warnings": list(page.warnings),
        "sections": [section(one) for one in page.sections],
        "charts": list(charts.values()),
        "moving": list(moving.values()),
        "images": {name: svg.decode() for name, svg in (images or {}).items() if name in shown},
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
    own = files("hydroid.report")
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
