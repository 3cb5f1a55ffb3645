"""A report as files: one page that loads nothing, tables, and data; and its charts as
figures.

The page is one HTML file: it carries its charts as data, with the script of Bokeh that
draws them.
"""

import base64
import gzip
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from hydroid.arrays import Array
from hydroid.files import fill_template, write_atomic
from hydroid.reporting.chart import Chart
from hydroid.reporting.page import Page, Table, short_name
from hydroid.words import distinct, with_minus

_QUOTED = re.compile("“([^”]+)”")


def write_page(page: Page, out: Path) -> Path:
    """Write a report to the folder `out`: its tables as CSV, its data, and last the
    page."""
    return write_tables(
        page.tables, out, **page.data, **{f"{page.name}.html": html(page)}
    )


def write_tables(tables: Mapping[str, Table], out: Path, **more: str) -> Path:
    """Write tables as CSV, to tables/ in the folder `out`, and more files by name;
    return the last.

    A table's name, which may hold a joint's, leads nowhere else: what is no letter or
    digit becomes `_`.
    """
    content = dict[str, str]()
    taken = set[str]()
    for name, table in tables.items():
        file = distinct(re.sub(r"[^\w.-]", "_", short_name(name)), taken)
        content[f"tables/{file}.csv"] = table.csv()
    content |= more
    for name, text in content.items():
        write_atomic(out / name, text)
    return out / [*content][-1]


def write_figures(page: Page, out: Path) -> list[Path]:
    """Write every chart of a page to the folder `out` as PNG and SVG; return the
    files."""
    from hydroid.reporting.figure import figure, saved, style

    written = list[Path]()
    for plot in page.plots:
        drawing = plot.make()
        # an arm in motion is for the page alone
        if not isinstance(drawing, Chart):
            continue
        with style():
            images = saved(figure(drawing))
        for ending, image in zip(("png", "svg"), images, strict=True):
            file = out / f"{plot.name}.{ending}"
            write_atomic(file, image)
            written.append(file)
    return written


def plain(drawn: Any) -> Any:
    """Return what JSON has of a drawing or a part of it: numbers have five digits.

    Null is not finite.
    """
    match drawn:
        case Chart():
            return vars(drawn.thinned())
        case np.ndarray() if drawn.ndim == 1:
            return _five_digits(drawn)
        case np.ndarray():
            return list(drawn)
        case _:
            return {name: _labelled(value) for name, value in vars(drawn).items()}


def _labelled(value: Any) -> Any:
    """Return a title or label as a reader is shown it, and what is none unchanged."""
    return with_minus(value) if isinstance(value, str) else value


def _five_digits(values: Array) -> list[float | None]:
    """Return numbers, (n,), that print with five digits; None for what is not finite."""
    # all are printed at once: a page holds hundreds of thousands
    printed = ("%.5g " * len(values)) % tuple(values.tolist())
    numbers = map(float, printed.split())
    return [one if math.isfinite(one) else None for one in numbers]


def html(page: Page) -> str:
    """Return the page as one file."""
    drawings = {plot.name: plot.make() for plot in page.plots}
    charts = {name for name, drawing in drawings.items() if isinstance(drawing, Chart)}
    short = (",", ":")
    text = json.dumps(drawings, default=plain, ensure_ascii=False, separators=short)
    scripts = [_script()]
    packed_library = ""
    # Bokeh is large: a page without charts does without it
    if charts:
        scripts.append(_library())
        packed_library = _packed_library()
    titles = [section.title for section in page.sections]
    return fill_template(
        "reporting/template.html.j2",
        page=page,
        minus=with_minus,
        charts=charts,
        content=_packed(text),
        linked=partial(_linked, titles),
        script=_script(),
        packed_library=packed_library,
        policy=_policy(*scripts),
    )


def _linked(titles: Sequence[str], text: str) -> Markup:
    """Return a text as HTML in which a quoted title of a section, or its beginning,
    leads to the section."""
    parts = _QUOTED.split(text)
    linked = Markup()
    for place, part in enumerate(parts):
        # the pattern's group stands at every second place
        if place % 2 == 0:
            linked += escape(part)
            continue
        quoted = escape(f"“{part}”")
        for number, title in enumerate(titles, 1):
            if title.startswith(part):
                link = Markup('<a href="#section-{}">{}</a>')
                quoted = link.format(number, quoted)
                break
        linked += quoted
    return linked


def _policy(*scripts: str) -> str:
    """Return what a browser may run and load: these scripts, to the last letter, and
    nothing else.

    A name that got into the page as HTML in spite of all care could then do nothing.
    """
    sources = list[str]()
    for script in scripts:
        digest = hashlib.sha256(script.encode()).digest()
        sources.append(f"'sha256-{base64.b64encode(digest).decode()}'")
    allowed = " ".join(sources)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


@cache
def _script() -> str:
    """Return the page's own script."""
    folder = files("hydroid").joinpath("reporting")
    names = ("moving_arm.js", "charts.js")
    return "\n".join(folder.joinpath(name).read_text("utf-8") for name in names)


@cache
def _library() -> str:
    """Bokeh's scripts, from the installed package."""
    folder = files("bokeh").joinpath("server", "static", "js")
    names = ("bokeh.min.js", "bokeh-api.min.js")
    # a script may end without the semicolon that parts it from the next
    return ";\n".join(folder.joinpath(name).read_text("utf-8") for name in names)


@cache
def _packed_library() -> str:
    return _packed(_library())


def _packed(text: str) -> str:
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()
