"""How figures look, and how they become the same bytes every time.

Figures are made through matplotlib's objects, without pyplot and its global list of figures. Colours are
those of Okabe and Ito, told apart by colour-blind readers, and each comes with a marker or line of its own.
"""

import io
import math
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, YAxis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.report.table import plain

WIDTH = 6.4  # [in]; at half a page's width the smallest text is still 5 pt
MEASURED = "#222222"
SEARCH = "#0072B2"
REFINED = "#D55E00"
OTHERS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
OTHER_LOOKS: tuple[tuple[str, str], ...] = tuple(zip(OTHERS, ("s", "^", "v", "P"), strict=True))
GREY = "#8C8C8C"
PALE = "#D9D9D9"

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

P = ParamSpec("P")


@contextmanager
def _style() -> Generator[None]:
    """Matplotlib's defaults and this style; what was set before comes back afterwards."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE.items())  # pyright: ignore[reportArgumentType, reportCallIssue]  # names are typed as literals
        yield


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw in this style, whatever matplotlib's settings on this machine are."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with _style():
            return draw(*args, **kwargs)

    return drawn


def figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure [in]."""
    return Figure(figsize=(width, height), layout="constrained")


def png(drawing: Figure) -> bytes:
    """Render at 150 dpi."""
    return _rendered(drawing, format="png", dpi=150, metadata={"Software": None})


def svg(drawing: Figure) -> bytes:
    """Render as SVG that needs no font."""
    return _rendered(drawing, format="svg", metadata={"Date": None, "Creator": None})


def _rendered(drawing: Figure, **how: Any) -> bytes:
    buffer = io.BytesIO()
    with _style(), warnings.catch_warnings():
        # the name of a log may hold letters that the font lacks: a box is drawn instead
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        drawing.savefig(buffer, **how)
    return buffer.getvalue()


def estimate_looks(fit: Fit) -> dict[str, tuple[str, str]]:
    """Colour and marker of each estimate, the most important first."""
    main = {fit.final: (REFINED, "D")} | {fit.searched.name: (SEARCH, "o")}
    others = [name for name in fit.estimates if name not in main]
    return main | dict(zip(others, OTHER_LOOKS, strict=False))


def legend_below(drawing: Figure, source: Axes, columns: int = 3) -> None:
    """Put the legend of one of its axes under the whole figure."""
    handles, labels = source.get_legend_handles_labels()
    if handles:
        # the longest labels need the width of a whole row
        fitting = max(1, min(columns, int(95 / (8 + max(map(len, labels))))))
        drawing.legend(handles, labels, loc="outside lower center", ncols=min(fitting, len(labels)))


def finite(values: Array) -> Array:
    """Return values with NaN for inf: what a line leaves out."""
    return np.where(np.isfinite(values), values, np.nan)


def value_axis(axis: Axis, values: Array) -> None:
    """Scale an axis: logarithmic where positive values span more than a decade, else from 0."""
    known = values[np.isfinite(values)]
    vertical = isinstance(axis, YAxis)
    if known.size and known.min() > 0 and known.max() > 10 * known.min():
        (axis.axes.set_yscale if vertical else axis.axes.set_xscale)("log")
        few = known.max() < 1000 * known.min()
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(tick))
    elif known.size:
        top = 1.05 * float(known.max()) if known.max() > 0 else 1.0
        (axis.axes.set_ylim if vertical else axis.axes.set_xlim)(min(0.0, 1.05 * float(known.min())), top)


def tick(value: float, _: int | None) -> str:
    """Write a number at an axis."""
    return plain(value)


def every(count: int, most: int) -> int:
    """Step that leaves at most `most` of `count` labels."""
    return max(1, math.ceil(count / most))
