"""How figures look, and how they become the same bytes every time.

Figures are made from matplotlib's objects, without pyplot and its global state. Margins are given in inches:
matplotlib's automatic layouts measure every text several times and took half of a report's time. Colours are
those of Okabe and Ito, which colour-blind readers tell apart; each comes with its own marker or line.
"""

import io
import math
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.words import plain

WIDTH = 6.4  # [in]; at half a page's width the smallest text is still 5 pt
MEASURED = "#222222"
SEARCH = "#0072B2"
REFINED = "#D55E00"
OTHERS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
OTHER_LOOKS: tuple[tuple[str, str], ...] = tuple(zip(OTHERS, ("s", "^", "v", "P"), strict=True))
GREY = "#8C8C8C"
PALE = "#D9D9D9"
MAX_BINS = 1000
"""parts of a curve of which the lowest and the highest sample are drawn: one per pixel of the PNG"""

_LEGEND_ROW = 0.2  # [in]
_LETTER = 0.085  # [in] of a letter at 10 pt, on average
_STYLE: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same glyphs on every machine
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E8E8E8",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.4,
    "text.parse_math": False,  # a log may be called a$b$.csv
    "axes.unicode_minus": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "hydroid",
    "path.simplify": True,
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


def rendered(drawing: Figure) -> tuple[bytes, bytes]:
    """Return a figure as PNG of 150 dpi and as SVG that needs no font; within `style`."""
    png, svg = io.BytesIO(), io.BytesIO()
    drawing.savefig(png, format="png", dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 1})
    drawing.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png.getvalue(), svg.getvalue()


def figure(height: float, width: float = WIDTH, **margins: float) -> Figure:
    """Return an empty figure of a size [in], its margins as in `set_margins`."""
    drawing = Figure(figsize=(width, height))
    set_margins(drawing, **({"left": 0.75, "right": 0.15, "top": 0.35, "bottom": 0.55} | margins))
    return drawing


def set_margins(drawing: Figure, **margins: float) -> None:
    """Set the room [in] beside all axes of a figure: left, right, top, bottom."""
    width, height = drawing.get_size_inches()
    share = {side: room / (width if side in ("left", "right") else height) for side, room in margins.items()}
    drawing.subplots_adjust(**{s: 1 - v if s in ("right", "top") else v for s, v in share.items()})


def headline(drawing: Figure, title: str) -> None:
    """Write a title above all axes of a figure."""
    at = {"x": 0.02, "y": 1 - 0.1 / drawing.get_figheight(), "ha": "left", "va": "top"}
    drawing.suptitle(title, **at, fontsize=11, fontweight="bold")


def room_for(names: Sequence[str], size: float = 10.0) -> float:
    """Return the width [in] of the longest of some labels beside an axis, about."""
    return _LETTER * size / 10 * max(map(len, names), default=0) + 0.2


def legend_below(
    drawing: Figure, axes: Axes, columns: int = 3, axis: float = 0.55, extra: Sequence[Artist] = ()
) -> None:
    """Put what has a label in `axes`, and `extra`, in a legend under all axes of a figure.

    It has at most `columns` columns, fewer where labels are long. `axis` is the room [in] between the axes
    and the legend, for ticks and a label.
    """
    handles = [*axes.get_legend_handles_labels()[0], *extra]
    if not handles:
        return
    longest = max(len(str(handle.get_label())) for handle in handles)
    fitting = max(1, min(columns, len(handles), int(15 * drawing.get_figwidth() / (8 + longest))))
    rows = math.ceil(len(handles) / fitting)
    set_margins(drawing, bottom=axis + _LEGEND_ROW * rows + 0.05)
    drawing.legend(
        handles=handles, loc="lower center", ncols=fitting, bbox_to_anchor=(0.5, 0.0), borderaxespad=0.1
    )


def estimates_by_importance(fit: Fit) -> list[str]:
    """Return the names of a fit's estimates: the final one, the search's own, the others."""
    first = dict.fromkeys((fit.final, fit.searched.name))
    return [*first, *(name for name in fit.estimates if name not in first)]


def estimate_looks(fit: Fit) -> dict[str, tuple[str, str]]:
    """Return colour and marker of each estimate, the most important first."""
    looks = ((REFINED, "D"), (SEARCH, "o"), *OTHER_LOOKS)
    return dict(zip(estimates_by_importance(fit), looks, strict=False))


def finite(values: Array) -> Array:
    """Return values with NaN for infinite ones, which a line leaves out."""
    return np.where(np.isfinite(values), values, np.nan)


def decimated(time: Array, values: Array, bins: int = MAX_BINS) -> tuple[Array, Array]:
    """Return a curve of shape (T,) by the lowest and the highest sample of each of at most `bins` parts.

    It is drawn as the whole curve would be; a short curve stays as it is.
    """
    size = -(-len(values) // bins)
    if size <= 2:
        return time, values
    ends = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    low, high = (
        np.argmin(np.where(np.isfinite(part), part, np.inf), axis=1) + size * np.arange(len(ends))
        for part in (ends, -ends)
    )
    keep = np.unique(np.minimum(np.concatenate([[0], low, high, [len(values) - 1]]), len(values) - 1))
    return time[keep], values[keep]


def value_axis(axis: Axis, values: Array) -> None:
    """Scale an axis: logarithmic where positive values span more than a decade, else from 0."""
    known = values[np.isfinite(values)]
    if known.size and known.min() > 0 and known.max() > 10 * known.min():
        logarithmic(axis, (1, 2, 5) if known.max() < 1000 * known.min() else (1,))
    elif known.size:
        top = 1.05 * float(known.max()) if known.max() > 0 else 1.0
        set_limits = axis.axes.set_ylim if isinstance(axis, YAxis) else axis.axes.set_xlim
        set_limits(min(0.0, 1.05 * float(known.min())), top)


def logarithmic(axis: Axis, subs: tuple[int, ...] = (1, 2, 5)) -> None:
    """Make an axis logarithmic, with ticks at these multiples of the powers of ten."""
    (axis.axes.set_yscale if isinstance(axis, YAxis) else axis.axes.set_xscale)("log")
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(tick))


def tick(value: float, _: int | None) -> str:
    """Write a number at an axis."""
    return plain(float(f"{value:.4g}"))
