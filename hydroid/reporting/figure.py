"""A chart as a file: drawn with matplotlib, the same bytes every time.

The panel of a film is such a chart too.
"""

import io
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.table import plain

WIDTH, COLUMN = 6.4, 3.6
"""of a figure with one column, and of one of several columns [in]"""
PIXELS = 80
"""of a panel's height in an inch"""
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
_DASHES: dict[str, Any] = {"": "-", "solid": "-", "dashed": (0, (5, 3)), "dotted": ":"}
_MARKERS = {"": "o", "circle": "o", "diamond": "D", "square": "s", "dash": "|"}
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
    heights = [p.height / PIXELS for p in chart.panels[:: chart.columns]]
    width = WIDTH if chart.columns == 1 else COLUMN * chart.columns
    drawing = Figure((width, sum(heights) + 0.6 * rows + 0.5), layout="constrained")
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    shared = "col" if chart.linked else "none"
    axes = drawing.subplots(rows, chart.columns, squeeze=False, sharex=shared, height_ratios=heights).ravel()
    for one, panel in zip_longest(axes, chart.panels):
        if panel is None:
            one.set_axis_off()
        else:
            _panel(one, panel, chart.bins)
            if chart.apart and one.get_legend_handles_labels()[0]:
                one.legend(fontsize=8, frameon=True, framealpha=0.8, edgecolor="none")
    labels = {h.get_label(): h for one in axes for h in one.get_legend_handles_labels()[0]}
    if len(labels) > 1 and not chart.apart:
        columns = max(1, min(3, int(15 * width / (8 + max(map(len, labels))))))
        drawing.legend(handles=list(labels.values()), loc="outside lower center", ncols=columns)
    return drawing


def _panel(axes: Axes, panel: Panel, bins: int) -> None:
    for mark in panel.marks:
        if not mark.off:
            _draw(axes, mark.thinned(bins))
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
    for log, axis in ((panel.log_x, axes.xaxis), (panel.log_y, axes.yaxis)):
        if log:
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_minor_locator(NullLocator())
            axis.set_major_formatter(FuncFormatter(lambda value, _: plain(float(f"{value:.4g}"))))
    if panel.names:
        axes.set_yticks(range(len(panel.names)), panel.names)
        axes.set_ylim(len(panel.names) - 0.4, -0.6)
    if panel.x_limits:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits:
        axes.set_ylim(*panel.y_limits)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")


def _draw(axes: Axes, mark: Mark) -> None:
    x, y, end = mark.x, mark.y, mark.end
    look: dict[str, Any] = {"color": SHADES[mark.color], "alpha": mark.alpha, "label": mark.label or None}
    line: dict[str, Any] = look | {"lw": mark.width}
    if mark.kind in ("line", "step", "rule"):
        line["linestyle"] = _DASHES[mark.look]
    match mark.kind:
        case "line":
            axes.plot(x, y, **line)
        case "step":
            axes.step(x, y, where="post", **line)
        case "points":
            axes.plot(x, y, _MARKERS[mark.look], ms=mark.width, zorder=3, **look)
        case "band":
            axes.fill_between(x, y, end, lw=0, **look)
        case "bars":
            axes.hlines(y, x, end, **line)
        case "spans":
            _each(axes.axvspan, [*zip(x, end, strict=True)], look | {"lw": 0, "zorder": 0})
        case "rule":
            _each(axes.axhline if len(y) else axes.axvline, [(v,) for v in (y if len(y) else x)], line)
        case "area":
            corners = np.column_stack([x, y])
            parts = np.split(corners, np.flatnonzero(np.isnan(x)))
            _each(axes.fill, [tuple(part[~np.isnan(part[:, 0])].T) for part in parts], look)
        case "text":
            for text, *at in zip(mark.texts, x, y, strict=True):
                drawn = axes.annotate(
                    text, (at[0], at[1]), (3, 3), textcoords="offset points", rotation=30, fontsize=7
                )
                drawn.set_in_layout(False)


def _each(draw: Any, places: Sequence[tuple[Any, ...]], look: dict[str, Any]) -> None:
    """Draw at several places, of which one is in the legend."""
    for i, place in enumerate(places):
        draw(*place, **look | {"label": look["label"] if i == 0 else None})
