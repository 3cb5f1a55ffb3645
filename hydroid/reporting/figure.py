"""A chart as a file: drawn with matplotlib, the same bytes every time.

The panel of a film is such a chart too.
"""

import io
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from itertools import zip_longest
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.words import plain

SHADES = {
    "ink": "#222222",
    "grey": "#8C8C8C",
    "pale": "#D9D9D9",
    "blue": "#0072B2",
    "orange": "#D55E00",
    "green": "#009E73",
    "pink": "#CC79A7",
    "yellow": "#E69F00",
    "sky": "#56B4E9",
}
_LOOKS: dict[str, Any] = {
    "dashed": (0, (5, 3)),
    "diamond": "D",
}
_STYLE: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same glyphs on every machine
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E8E8E8",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "text.parse_math": False,  # a log may be called a$b$.csv
    "svg.hashsalt": "hydroid",
    "path.simplify_threshold": 0.2,
}


@contextmanager
def style() -> Generator[None]:
    """Draw in this style, whatever matplotlib's settings are; they come back afterwards."""
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE.items())  # pyright: ignore[reportArgumentType, reportCallIssue]  # names are typed as literals
        # a log's name may hold letters that the font lacks: a box is drawn instead
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        yield


def rendered(chart: Chart, title: str = "") -> tuple[bytes, bytes]:
    """Return a chart as PNG of 150 dpi and as SVG that needs no font."""
    with style():
        drawing = figure(chart, title)
        png, svg = io.BytesIO(), io.BytesIO()
        drawing.savefig(png, format="png", dpi=150, metadata={"Software": None})
        drawing.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png.getvalue(), svg.getvalue()


def figure(chart: Chart, title: str = "") -> Figure:
    """Draw a chart without what is off; within `style`."""
    rows = -(-len(chart.panels) // chart.columns)
    heights = [p.height / 80 for p in chart.panels[:: chart.columns]]  # [in], of 80 px
    width = 6.4 if chart.columns == 1 else 3.6 * chart.columns
    drawing = Figure((width, sum(heights) + 0.6 * rows + 0.5), layout="constrained")
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    shared = "col" if chart.linked else "none"
    axes = drawing.subplots(rows, chart.columns, squeeze=False, sharex=shared, height_ratios=heights).ravel()
    for one, panel in zip_longest(axes, chart.thinned().panels):
        if panel is None:
            one.set_axis_off()
        else:
            _panel(one, panel)
            if chart.apart and one.get_legend_handles_labels()[0]:
                one.legend(fontsize=8, frameon=True, framealpha=0.8, edgecolor="none")
    labels = {h.get_label(): h for one in axes for h in one.get_legend_handles_labels()[0]}
    if len(labels) > 1 and not chart.apart:
        columns = max(1, min(3, int(15 * width / (8 + max(map(len, labels))))))
        drawing.legend(handles=list(labels.values()), loc="outside lower center", ncols=columns)
    return drawing


def _panel(axes: Axes, panel: Panel) -> None:
    for mark in panel.marks:
        if not mark.off:
            _draw(axes, mark)
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    if panel.log_y:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: plain(float(f"{value:.4g}"))))
    if panel.x_limits:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits:
        axes.set_ylim(*panel.y_limits)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")


def _draw(axes: Axes, mark: Mark) -> None:
    x, y, end = mark.x, mark.y, mark.end
    look: dict[str, Any] = {"color": SHADES[mark.color], "alpha": mark.alpha, "label": mark.label or None}
    line: dict[str, Any] = look | {"lw": mark.width, "linestyle": _LOOKS.get(mark.look, "-")}
    match mark.kind:
        case "line":
            axes.plot(x, y, **line)
        case "step":
            axes.step(x, y, where="post", **line)
        case "points":
            axes.plot(x, y, _LOOKS.get(mark.look, "o"), ms=mark.width, zorder=3, **look)
        case "band":
            axes.fill_between(x, y, end, lw=0, **look)
        case "spans":
            for low, high in zip(x, end, strict=True):
                axes.axvspan(low, high, lw=0, zorder=0, **look)
        case "rule":
            for rule, values in ((axes.axhline, y), (axes.axvline, x)):
                for value in values:
                    rule(value, **line)
        case "area":
            parts = np.split(np.array([x, y]), np.flatnonzero(np.isnan(x)), axis=1)
            axes.fill(*(one for part in parts for one in part[:, ~np.isnan(part[0])]), **look)
        case "text":
            for text, *at in zip(mark.texts, x, y, strict=True):
                drawn = axes.annotate(
                    text, (at[0], at[1]), (3, 3), textcoords="offset points", rotation=30, fontsize=7
                )
                drawn.set_in_layout(False)
