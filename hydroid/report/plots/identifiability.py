"""What the data determine: singular values, the directions they belong to, correlation of the estimates."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from hydroid.parameters import Array
from hydroid.report.plots.style import GREY, MEASURED, REFINED, SEARCH, figure, styled, tick
from hydroid.report.table import plain
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.flags import WEAK_ABOVE
from hydroid.uncertainty.intervals import THRESHOLD, Profile

_CELL = 0.36  # [in]
_MOST_NUMBERS = 14
"""parameters up to which the cells of a map carry their numbers"""
_FADED = 1e-6
"""singular values below this part of the largest are drawn at the foot"""


def told(uncertainty: Uncertainty, found: Identifiability) -> dict[str, Figure]:
    """Return all figures by name."""
    return {
        "singular_values": singular_values(found),
        "directions": directions(found),
        "correlation": correlation(uncertainty, found),
    }


@styled
def singular_values(found: Identifiability) -> Figure:
    """How strongly each direction is felt, in units of the noise, and what is too weak."""
    values = found.singular
    top = max(float(values.max(initial=0.0)), 1 / WEAK_ABOVE)
    foot = top * _FADED
    drawing = figure(3.0)
    axes = drawing.subplots()
    axes.set_yscale("log")
    axes.set_ylim(foot / 3, 3 * top)
    for i, value in enumerate(values, start=1):
        felt, strong = value > foot, value >= 1 / WEAK_ABOVE
        color = SEARCH if strong else REFINED
        axes.plot([i, i], [foot / 3, max(value, foot)], color=color, linewidth=1.0, alpha=0.5)
        mark = "o" if strong else "D"
        axes.plot(
            i, max(value, foot), mark, color=color, markerfacecolor=color if felt else "white", markersize=6
        )
    axes.axhline(1 / WEAK_ABOVE, color=GREY, linestyle="--", linewidth=1.0)
    axes.text(
        len(values) + 0.45,
        1.2 / WEAK_ABOVE,
        f"±{100 * WEAK_ABOVE:.0f} %",
        color=GREY,
        fontsize=8,
        ha="right",
        va="bottom",
    )
    axes.set_xlim(0.5, len(values) + 0.5)
    axes.set_xticks(range(1, len(values) + 1))
    axes.grid(axis="x", visible=False)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(tick))
    axes.set_title("What the data feel")
    axes.set_xlabel("direction")
    axes.set_ylabel("singular value [noise]")
    return drawing


@styled
def directions(found: Identifiability) -> Figure:
    """Heat map of the directions: one a column, best determined first, with its standard deviation below."""
    count = len(found.names)
    drawing = figure(1.5 + _CELL * count)
    axes = drawing.subplots()
    deviations = [f"{plain(float(f'{100 / v:.2g}'))} %" if v > 0.1 else "∞" for v in found.singular]
    _map(drawing, axes, found.axes.T, found.names, deviations)
    axes.set_title("Directions: relative changes that belong together")
    axes.set_xlabel("standard deviation along the direction")
    for label, value in zip(axes.get_xticklabels(), found.singular, strict=True):
        label.set_color(MEASURED if value >= 1 / WEAK_ABOVE else REFINED)
    return drawing


@styled
def correlation(uncertainty: Uncertainty, found: Identifiability) -> Figure:
    """Correlation of the estimates; blank where one is not determined."""
    drawing = figure(1.5 + _CELL * len(found.names))
    axes = drawing.subplots()
    _map(drawing, axes, uncertainty.correlation, found.names, found.names)
    axes.set_title("Correlation of the estimates")
    return drawing


@styled
def profiles(found: Sequence[Profile], told_: Uncertainty, names: Sequence[str]) -> Figure:
    """Deviance of each profiled parameter against its values, the 95 % threshold and the linear parabola."""
    drawing = figure(2.6 * len(found) + 0.4)
    for axes, one in zip(np.atleast_1d(drawing.subplots(len(found), 1)), found, strict=True):
        i = names.index(one.name)
        centre, deviation = told_.theta[i], told_.standard_deviation[i]
        axes.plot(one.values, one.deviance, "o-", color=SEARCH, markersize=4)
        if np.isfinite(deviation) and deviation > 0:
            fine = np.linspace(one.values[0], one.values[-1], 101)
            axes.plot(fine, ((fine - centre) / deviation) ** 2, "--", color=GREY, linewidth=1.0)
        axes.axhline(THRESHOLD, color=REFINED, linewidth=1.0)
        axes.set_ylim(-0.2, max(2.5 * THRESHOLD, 0.5))
        axes.set_xlabel(one.name)
        axes.set_ylabel("deviance")
    drawing.suptitle("Profile likelihood")
    return drawing


def _map(drawing: Figure, axes: Axes, values: Array, rows: Sequence[str], columns: Sequence[str]) -> None:
    """Numbers between -1 and 1 as colours, with the numbers where there is room."""
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks(range(len(columns)), columns, rotation=45, ha="right", rotation_mode="anchor", fontsize=8)
    axes.tick_params(length=0)
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    if max(values.shape) <= _MOST_NUMBERS:
        for (i, j), value in np.ndenumerate(values):
            if np.isfinite(value):
                color = "white" if abs(value) > 0.6 else MEASURED
                text = f"{round(value, 2) + 0.0:.2f}".replace("-", "−")
                axes.text(j, i, text, ha="center", va="center", fontsize=7, color=color)
    drawing.colorbar(image, ax=axes, shrink=0.8, pad=0.02)
