"""A chart: panels of curves, bands, points and bars, described once for the page and for files.

The page draws it with Bokeh (`charts.js`); `figure` draws it with matplotlib, for papers. Colours are named
after Okabe and Ito's, which colour-blind readers tell apart; each look of the page has its own shade of them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.parameters import Array
from hydroid.report import style

Color = str
"""a name of _SHADES"""
SERIES: tuple[Color, ...] = ("orange", "blue", "green", "pink", "yellow", "sky")
"""colours of several models, the first of the most important"""
_SHADES: dict[Color, str] = {
    "ink": style.MEASURED,
    "grey": style.GREY,
    "pale": style.PALE,
    "blue": style.SEARCH,
    "orange": style.REFINED,
    "green": "#009E73",
    "pink": "#CC79A7",
    "yellow": "#E69F00",
    "sky": "#56B4E9",
}
_DASHES = {"solid": "-", "dashed": (0, (5, 3)), "dotted": ":"}
_MARKERS = {"circle": "o", "diamond": "D", "square": "s", "dash": "|"}
_DIGITS = 5
"""significant digits that the page gets"""


@dataclass(frozen=True, eq=False)
class Mark:
    """One thing drawn in a panel.

    Attributes:
        kind: `line` or `step` through (x, y); `points`; `band` from y to `end`; `bars` from x to `end` at the
            height y; `spans`, from x to `end` over the whole height; `rule` at a value y, or at a
            value x where y is empty.
        x, y, end: as the kind says, shapes (n,).
        color: its name.
        label: in the legend; marks with one label are shown and hidden together. Empty: not in the legend.
        width: of a line, or the size of a point [px].
        look: dash of a line, or shape of a point.
        off: it is hidden until the reader asks for it. Files leave it out.
        alpha: opacity.
    """

    kind: Literal["line", "step", "points", "band", "bars", "spans", "rule"]
    x: Array = field(default_factory=lambda: np.empty(0))
    y: Array = field(default_factory=lambda: np.empty(0))
    end: Array = field(default_factory=lambda: np.empty(0))
    color: Color = "blue"
    label: str = ""
    width: float = 1.6
    look: str = ""
    off: bool = False
    alpha: float = 1.0

    def plain(self) -> dict[str, Any]:
        """Return the mark as JSON has it."""
        looks = {k: getattr(self, k) for k in ("kind", "color", "label", "width", "look", "off", "alpha")}
        arrays = {name: getattr(self, name) for name in ("x", "y", "end")}
        return looks | {name: _rounded(values) for name, values in arrays.items() if len(values)}


@dataclass(frozen=True, eq=False)
class Panel:
    """A pair of axes.

    Attributes:
        x, y: labels of the axes.
        marks: in the order in which they are drawn.
        title: above the panel.
        height: in the page [px].
        x_limits, y_limits: of the axes; None: around all that is drawn.
        log_x, log_y: whether an axis is logarithmic.
        names: of the heights 0, 1, … of the y axis, from the top.
    """

    x: str
    y: str
    marks: tuple[Mark, ...]
    title: str = ""
    height: int = 220
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    log_x: bool = False
    log_y: bool = False
    names: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        """Return the panel as JSON has it."""
        keys = "x", "y", "title", "height", "x_limits", "y_limits", "log_x", "log_y", "names"
        return {k: getattr(self, k) for k in keys} | {"marks": [mark.plain() for mark in self.marks]}


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels that belong together.

    Attributes:
        panels: row by row.
        columns: on a wide screen and in files.
        linked: whether all panels share their x axis: zooming one zooms all.
    """

    panels: tuple[Panel, ...]
    columns: int = 1
    linked: bool = False

    @property
    def legends_apart(self) -> bool:
        """Whether each panel needs a legend of its own, because their labels differ."""
        labels = [{m.label for m in p.marks if m.label} for p in self.panels]
        return not self.linked and any(a and b and a != b for a in labels for b in labels)

    def plain(self) -> dict[str, Any]:
        """Return the chart as JSON has it."""
        panels = [panel.plain() for panel in self.panels]
        how = {"columns": self.columns, "linked": self.linked, "apart": self.legends_apart}
        return {"panels": panels} | how


def figure(chart: Chart, title: str = "") -> Figure:
    """Draw a chart with matplotlib, without what is off."""
    rows = -(-len(chart.panels) // chart.columns)
    heights = [
        max(p.height for p in chart.panels[r * chart.columns : (r + 1) * chart.columns]) / 80
        for r in range(rows)
    ]
    names = [name for panel in chart.panels for name in panel.names]
    width = style.WIDTH if chart.columns == 1 else 3.6 * chart.columns
    gap = 0.25 if chart.linked else 0.75
    drawing = style.figure(
        sum(heights) + gap * (rows - 1) + 1.0 + (0.3 if title else 0.0),
        width,
        left=style.room_for(names) if names else 0.75,
        top=0.65 if title else 0.35,
    )
    if title:
        style.headline(drawing, title)
    grid = {"height_ratios": heights, "hspace": gap / (sum(heights) / rows), "wspace": 0.3}
    axes = drawing.subplots(
        rows, chart.columns, squeeze=False, sharex="col" if chart.linked else False, gridspec_kw=grid
    )
    for one in axes.flat[len(chart.panels) :]:
        one.set_axis_off()
    for i, (one, panel) in enumerate(zip(axes.flat, chart.panels, strict=False)):
        last = i + chart.columns >= len(chart.panels)
        _panel(one, panel, width, label_x=last or not chart.linked)
    if chart.legends_apart:
        for one in axes.flat[: len(chart.panels)]:
            if one.get_legend_handles_labels()[0]:
                one.legend(fontsize=8, frameon=True, framealpha=0.8, edgecolor="none")
    else:
        _legend(drawing, list(axes.flat[: len(chart.panels)]))
    return drawing


def _panel(axes: Axes, panel: Panel, width: float, *, label_x: bool) -> None:
    """Draw one panel of a figure of this width [in]."""
    for mark in panel.marks:
        if not mark.off:
            _DRAW[mark.kind](axes, mark, {"color": _SHADES[mark.color], "alpha": mark.alpha})
    if panel.log_x:
        style.logarithmic(axes.xaxis)
    if panel.log_y:
        style.logarithmic(axes.yaxis)
    if panel.x_limits:
        axes.set_xlim(*panel.x_limits)
    if panel.y_limits:
        axes.set_ylim(*panel.y_limits)
    if panel.names:
        axes.set_yticks(range(len(panel.names)), panel.names)
        axes.set_ylim(len(panel.names) - 0.4, -0.6)
    axes.set_title(panel.title, fontsize=10)
    axes.set_ylabel(panel.y)
    if label_x:
        axes.set_xlabel(panel.x)
    if not panel.names:
        axes.yaxis.set_label_coords(-0.52 / (axes.get_position().width * width), 0.5)


def _line(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    draw = axes.step if mark.kind == "step" else axes.plot
    more: dict[str, Any] = {"where": "post"} if mark.kind == "step" else {}
    dash: Any = _DASHES[mark.look or "solid"]
    draw(mark.x, mark.y, lw=mark.width, linestyle=dash, label=mark.label or None, **more, **look)


def _points(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    shape = _MARKERS[mark.look or "circle"]
    axes.plot(mark.x, mark.y, shape, ms=mark.width, label=mark.label or None, zorder=3, **look)


def _band(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    axes.fill_between(mark.x, mark.y, mark.end, lw=0, label=mark.label or None, **look)


def _bars(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    axes.hlines(mark.y, mark.x, mark.end, lw=mark.width, label=mark.label, **look)


def _spans(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    for i, (low, high) in enumerate(zip(mark.x, mark.end, strict=True)):
        axes.axvspan(low, high, lw=0, zorder=0, label=mark.label if i == 0 else None, **look)


def _rule(axes: Axes, mark: Mark, look: dict[str, Any]) -> None:
    draw, values = (axes.axhline, mark.y) if len(mark.y) else (axes.axvline, mark.x)
    dash: Any = _DASHES[mark.look or "solid"]
    for i, value in enumerate(values):
        draw(value, lw=mark.width, linestyle=dash, zorder=0.5, label=mark.label if i == 0 else None, **look)


_DRAW = {
    "line": _line,
    "step": _line,
    "points": _points,
    "band": _band,
    "bars": _bars,
    "spans": _spans,
    "rule": _rule,
}


def _legend(drawing: Figure, panels: Sequence[Axes]) -> None:
    """Put one legend with each label once under all panels."""
    handles = {h.get_label(): h for axes in panels for h in axes.get_legend_handles_labels()[0]}
    if len(handles) > 1:
        style.legend_below(drawing, panels[-1], extra=list(handles.values()))


def _rounded(values: Array) -> list[float | None]:
    """Return values with _DIGITS significant digits, None where they are not finite."""
    return [
        float(f"{v:.{_DIGITS}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()
    ]
