"""What the logs determine: singular values, their directions, correlation of the estimates, profiles."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from hydroid.parameters import Array
from hydroid.report.plots import style
from hydroid.report.table import plain
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.flags import WEAK_ABOVE
from hydroid.uncertainty.intervals import THRESHOLD, Profile

_CELL = 0.36  # [in]
_MOST_NUMBERS = 14
"""parameters up to which the cells of a map carry their numbers"""
_LEAST_DRAWN = 1e-6
"""singular values below this part of the largest are drawn at the foot"""
_PROFILE_MARGIN = 0.3
"""part of a profile's interval that is drawn beyond each end"""


def singular_values(result: Identifiability) -> Figure:
    """Draw how well each combination is determined, and which are not determined to WEAK_ABOVE."""
    values, limit = result.singular, 1 / WEAK_ABOVE
    top = max(float(values.max(initial=0.0)), limit)
    foot = top * _LEAST_DRAWN
    drawing = style.figure(3.0, left=0.9)
    axes = drawing.subplots()
    axes.set_yscale("log")
    axes.set_ylim(foot / 3, 3 * top)
    at, height = np.arange(1, len(values) + 1), np.maximum(values, foot)
    for chosen, color, mark in ((values >= limit, style.SEARCH, "o"), (values < limit, style.REFINED, "D")):
        axes.vlines(at[chosen], foot / 3, height[chosen], color=color, linewidth=1.0, alpha=0.5)
        for fill, part in ((color, chosen & (values > foot)), ("white", chosen & (values <= foot))):
            axes.plot(at[part], height[part], mark, color=color, markerfacecolor=fill, markersize=6)
    axes.axhline(limit, color=style.GREY, linestyle="--", linewidth=1.0)
    note = f"standard deviation {100 * WEAK_ABOVE:.0f} %"
    axes.text(len(values) + 0.45, 1.2 * limit, note, color=style.GREY, fontsize=8, ha="right", va="bottom")
    axes.set_xlim(0.5, len(values) + 0.5)
    axes.set_xticks(at)
    axes.grid(axis="x", visible=False)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(style.tick))
    axes.set_title("How well each combination of parameters is measured")
    axes.set_xlabel("direction, best determined first")
    axes.set_ylabel("1 / relative standard deviation")
    return drawing


def directions(result: Identifiability) -> Figure:
    """Draw the directions as a map, one per column, with their standard deviations below."""
    deviations = [f"{plain(float(f'{100 / v:.2g}'))} %" if v > 0.1 else "∞" for v in result.singular]
    drawing = _map(result.axes.T, result.names, deviations)
    axes = drawing.axes[0]
    axes.set_title("Share of each parameter in each direction")
    axes.set_xlabel("relative standard deviation along the direction")
    for label, value in zip(axes.get_xticklabels(), result.singular, strict=True):
        label.set_color(style.MEASURED if value >= 1 / WEAK_ABOVE else style.REFINED)
    return drawing


def correlation(uncertainty: Uncertainty, names: Sequence[str]) -> Figure:
    """Draw the correlation of the estimates, blank where one is not identifiable."""
    drawing = _map(uncertainty.correlation, names, names)
    drawing.axes[0].set_title("Correlation of the estimates")
    return drawing


def profiles(results: Sequence[Profile], uncertainty: Uncertainty, names: Sequence[str]) -> Figure:
    """Draw the deviance around each profiled parameter's interval, with the linear approximation."""
    drawing = style.figure(2.3 * len(results) + 0.9)
    panels = np.atleast_1d(drawing.subplots(len(results), 1, gridspec_kw={"hspace": 0.45}))
    for axes, profile in zip(panels, results, strict=True):
        i = names.index(profile.name)
        centre, deviation = uncertainty.theta[i], uncertainty.standard_deviation[i]
        low, high = np.clip(profile.interval, profile.values[0], profile.values[-1])
        margin = _PROFILE_MARGIN * (high - low)
        ends = max(low - margin, profile.values[0]), min(high + margin, profile.values[-1])
        fine = np.union1d(np.linspace(*ends, 201), profile.values)
        # between its points the square root is taken for linear, as in the interval
        root = np.sqrt(np.maximum(profile.deviance, 0.0)) * np.sign(profile.values - centre)
        axes.axvspan(low, high, color="#DCE9F3", zorder=0.5, label="95 % interval")
        axes.plot(fine, np.interp(fine, profile.values, root) ** 2, color=style.SEARCH, label="profile")
        axes.plot(profile.values, profile.deviance, "o", color=style.SEARCH, markersize=4)
        if np.isfinite(deviation) and deviation > 0:
            parabola = ((fine - centre) / deviation) ** 2
            axes.plot(fine, parabola, "--", color=style.GREY, linewidth=1.0, label="linear approximation")
        axes.axhline(THRESHOLD, color=style.REFINED, linewidth=1.0, label="threshold of 95 %")
        axes.set_xlim(*ends)
        axes.set_ylim(min(-0.2, 1.2 * float(profile.deviance.min())), 2.5 * THRESHOLD)
        axes.set_xlabel(profile.name)
        axes.set_ylabel("deviance")
    panels[0].set_title("Rise of the error where one parameter is held and the others are fitted again")
    style.legend_below(drawing, style.labelled(panels[0]), columns=4)
    return drawing


def _map(values: Array, rows: Sequence[str], columns: Sequence[str]) -> Figure:
    """Draw numbers from -1 to 1 as colours, with the numbers where there is room."""
    drawing = style.figure(
        1.5 + _CELL * len(rows),
        left=style.room_for(rows),
        right=0.1,
        bottom=0.5 + 0.7 * style.room_for(columns, 8),
    )
    axes = drawing.subplots()
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks(range(len(columns)), columns, rotation=45, ha="right", rotation_mode="anchor", fontsize=8)
    axes.tick_params(length=0)
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    if max(values.shape) <= _MOST_NUMBERS:
        for (i, j), value in np.ndenumerate(values):
            if np.isfinite(value):
                color = "white" if abs(value) > 0.6 else style.MEASURED
                text = f"{round(value, 2) + 0.0:.2f}".replace("-", "−")
                axes.text(j, i, text, ha="center", va="center", fontsize=7, color=color)
    drawing.colorbar(image, ax=axes, shrink=0.8, pad=0.02)
    return drawing
