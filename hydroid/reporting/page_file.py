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

from hydroid.errors import RunError
from hydroid.files import write_atomic
from hydroid.reporting.chart import Chart, figure
from hydroid.reporting.page import FILE, PAGE, Page, Plot, Section
from hydroid.reporting.style import rendered, style
from hydroid.reporting.table import Table, shown

SCHEMA = 1
"""version of the content that a page carries"""
_CONTENT = re.compile(rb'<script type="text/plain" id="content">([A-Za-z0-9+/=]*)</script>')
_OWN = ("template.html.j2", "page.css", "charts.js")
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
