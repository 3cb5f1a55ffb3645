"""A chart: panels of marks, described once.

The page draws it (`charts.js`), and `figure` as a file.

Colours are named after Okabe and Ito's, which colour-blind readers tell apart; each
look of the page has its own shade of them.
"""

from dataclasses import field, replace
from functools import partial
from typing import Literal

import numpy as np

from hydroid.arrays import Array, Limits, record

Color = str  # ink, grey, pale or one of SERIES
SERIES = ("orange", "blue", "green", "pink", "yellow", "sky")
"""colours of several models, the first of the most important"""
_none = partial(np.empty, 0)


@record
class Mark:
    """One thing drawn in a panel.

    Attributes:
        kind: `line` or `step` through (x, y), with gaps at NaN; `points`; `band` from y
            to `end`; `spans`, from x to `end` over the whole height; `rule` at a value
            y; `bars` from x to `end` in row y; `cells` in column x and row y, whose
            `end`, -1 to 1, is how strongly they are coloured: blue above 0, orange
            below.
        x, y, end: as the kind says, shapes (n,).
        color: its name.
        label: in the legend; marks with one label are shown and hidden together. Empty:
            not in the legend.
        width: of a line, or the size of a point [px].
        off: it is hidden until the reader asks for it. Files leave it out.
        alpha: opacity.
    """

    kind: Literal["line", "step", "points", "band", "spans", "rule", "bars", "cells"]
    x: Array = field(default_factory=_none)
    y: Array = field(default_factory=_none)
    end: Array = field(default_factory=_none)
    color: Color = "blue"
    label: str = ""
    width: float = 1.6
    off: bool = False
    alpha: float = 1.0

    def thinned(self, bins: int) -> "Mark":
        """Return a curve by the lowest and the highest sample of each of at most `bins`
        parts.

        It is drawn as the whole curve would be. A short curve and what is no curve stay
        as they are.
        """
        size = -(-len(self.y) // bins)
        curve = self.kind in ("line", "step", "band")
        if not curve or size <= 2 or not np.all(np.diff(self.x) > 0):
            return self
        last = len(self.y) - 1
        keep = [np.array([0, last])]
        for values in (self.y, -self.y, self.end, -self.end):
            if len(values):
                padded = np.pad(values, (0, -len(values) % size), mode="edge")
                parts = padded.reshape(-1, size)
                lowest = np.where(np.isfinite(parts), parts, np.inf).argmin(axis=1)
                keep.append(lowest + size * np.arange(len(parts)))
        at = np.unique(np.minimum(np.concatenate(keep), last))
        end = self.end[at] if len(self.end) else self.end
        return replace(self, x=self.x[at], y=self.y[at], end=end)


@record
class Panel:
    """A pair of axes, with marks in the order in which they are drawn, and its height
    in the page [px].

    `x`, `y` label the axes; `y_limits` None: around all that is drawn. Where there are
    `rows`, these are the names of y = 0, 1, ..., from the top down; `columns` are those
    of x.
    """

    x: str
    y: str
    marks: tuple[Mark, ...]
    title: str = ""
    height: int = 220
    y_limits: Limits | None = None
    log_x: bool = False
    log_y: bool = False
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()


@record
class Chart:
    """Panels that belong together, with one legend, one below the other.

    Where `linked`, all share their x axis. Of a curve the lowest and the highest sample
    of `bins` parts is drawn.
    """

    panels: tuple[Panel, ...]
    linked: bool = False
    bins: int = 1000

    def thinned(self) -> "Chart":
        """Return the chart with what is drawn of its curves."""
        panels = list[Panel]()
        for panel in self.panels:
            marks = tuple(mark.thinned(self.bins) for mark in panel.marks)
            panels.append(replace(panel, marks=marks))
        return replace(self, panels=tuple(panels))


def reference(time: Array, values: Array, label: str, width: float = 5) -> Mark:
    """Draw what was measured or wished, so that a model's line is seen on top of it."""
    return Mark("line", time, values, color="ink", label=label, width=width, alpha=0.35)


def zero_line() -> Mark:
    """Draw the line at 0, about which errors lie."""
    return Mark("rule", y=np.zeros(1), color="grey", width=1)


def command_panel(*marks: Mark, height: int = 130) -> Panel:
    """Return the panel of commands [%] over time, which ends a chart of responses."""
    # a full command is seen inside the panel, not on its edge
    limits = (-108, 108)
    return Panel("time [s]", "command [%]", marks, height=height, y_limits=limits)


def finite(values: Array) -> Array:
    """Return values with NaN for infinite ones, which a line leaves out."""
    return np.where(np.isfinite(values), values, np.nan)
