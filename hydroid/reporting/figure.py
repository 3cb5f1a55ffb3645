"""Charts as files: drawn with matplotlib, the same bytes every time."""

import io
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from itertools import zip_longest
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.reporting.chart import Chart, Mark, Panel

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
_STYLE: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same glyphs on every machine
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E8E8E8",
    "legend.frameon": False,
    "text.parse_math": False,  # a log may be called a$b$.csv
    "svg.hashsalt": "hydroid",
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


def saved(drawing: Figure, title: str = "") -> tuple[bytes, bytes]:
    """Return a figure as PNG of 150 dpi and as SVG that needs no font; within `style`."""
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    png, svg = io.BytesIO(), io.BytesIO()
    drawing.savefig(png, format="png", dpi=150, metadata={"Software": None})
    drawing.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png.getvalue(), svg.getvalue()


def figure(chart: Chart) -> Figure:
    """Draw a chart without what is off; within `style`."""
    rows = -(-len(chart.panels) // chart.columns)
    heights = [p.height / 80 for p in chart.panels[:: chart.columns]]  # [in], of 80 px
    width = 6.4 if chart.columns == 1 else 3.6 * chart.columns
    drawing = Figure((width, sum(heights) + 0.6 * rows + 0.5), layout="constrained")
    shared = "col" if chart.linked else "none"
    axes = drawing.subplots(rows, chart.columns, squeeze=False, sharex=shared, height_ratios=heights).ravel()
    for one, panel in zip_longest(axes, chart.thinned().panels):
        if panel is None:
            one.set_axis_off()
        else:
            _panel(one, panel)
    legend(drawing)
    return drawing


def legend(drawing: Figure) -> None:
    """Explain every label of a figure once, below it."""
    labels = {h.get_label(): h for one in drawing.axes for h in one.get_legend_handles_labels()[0]}
    if len(labels) > 1:
        columns = int(15 * drawing.get_figwidth() / (8 + max(len(str(label)) for label in labels)))
        where: Any = "outside lower center"
        drawing.legend(handles=list(labels.values()), loc=where, ncols=max(1, min(3, columns)))


def _panel(axes: Axes, panel: Panel) -> None:
    for mark in panel.marks:
        if not mark.off:
            _draw(axes, mark)
    axes.set(title=panel.title, xlabel=panel.x, ylabel=panel.y, ylim=panel.y_limits)
    axes.set_yscale("log" if panel.log_y else "linear")


def _draw(axes: Axes, mark: Mark) -> None:
    x, y, end = mark.x, mark.y, mark.end
    look: dict[str, Any] = {"color": SHADES[mark.color], "alpha": mark.alpha, "label": mark.label or None}
    match mark.kind:
        case "line":
            axes.plot(x, y, lw=mark.width, **look)
        case "step":
            axes.step(x, y, where="post", lw=mark.width, **look)
        case "points":
            axes.plot(x, y, "o", ms=mark.width, zorder=3, **look)
        case "band":
            axes.fill_between(x, y, end, lw=0, **look)
        case "spans":
            for low, high in zip(x, end, strict=True):
                axes.axvspan(low, high, lw=0, zorder=0, **look)
        case "rule":
            for value in y:
                axes.axhline(value, lw=mark.width, **look)
