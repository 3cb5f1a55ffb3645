"""The error over two parameters (article, figure 11)."""

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.parameters import Parameter
from hydroid.report.plots.style import GREY, PALE, REFINED, figure, styled
from hydroid.report.table import number, plain
from hydroid.report.words import in_reader_units, norm_label
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.surface import Surface

_LEVELS = 14


@styled
def contours(found: Surface, how: ObjectiveSettings) -> Figure:
    """Contours of the error; estimate, the grid's lowest point and infeasible areas are marked."""
    error = in_reader_units(how, np.where(np.isfinite(found.error), found.error, np.nan)).T
    drawing = figure(5.2)
    axes = drawing.subplots()
    across, up = found.values
    axes.set_facecolor(PALE)
    known = error[np.isfinite(error)]
    handles = []
    if known.size and known.max() > known.min():
        # a point that reproduces its data exactly would stretch a logarithmic scale to nothing
        low = max(float(known.min()), 1e-3 * float(known.max()))
        wide = known.max() > 5 * low
        space = np.geomspace if wide else np.linspace
        levels = space(low, float(known.max()), _LEVELS)
        norm = (LogNorm if wide else Normalize)(levels[0], levels[-1])
        shown = np.clip(error, low, None)
        filled = axes.contourf(across, up, shown, levels, norm=norm, cmap="viridis_r", extend="neither")
        axes.contour(across, up, shown, levels, colors="white", linewidths=0.4, alpha=0.6)
        bar = drawing.colorbar(filled, ax=axes, label=norm_label(how), format=FuncFormatter(_tick))
        bar.set_ticks(list(levels[:: max(1, _LEVELS // 6)]))
        bar.ax.yaxis.set_minor_locator(NullLocator())
    if found.infeasible:
        handles.append(Patch(facecolor=PALE, edgecolor=GREY, label=f"infeasible ({found.infeasible} points)"))
    best = found.lowest
    unit = "" if how.relative else " deg"
    for (x, y, value), color, mark, label in (
        (best, "white", "o", "lowest of the grid"),
        ((*found.estimate, found.estimate_error), REFINED, "D", "estimate"),
    ):
        told = f"{label} ({number(float(in_reader_units(how, np.array(value))))}{unit})"
        (handle,) = axes.plot(
            x, y, mark, color=color, markeredgecolor="black", markersize=8, label=told, linestyle="none"
        )
        handle.set_clip_on(False)
        handles.append(handle)
    for axis, values, parameter in (
        (axes.xaxis, across, found.parameters[0]),
        (axes.yaxis, up, found.parameters[1]),
    ):
        logarithmic = values[0] > 0 and not np.isclose(values[1] - values[0], values[-1] - values[-2])
        if logarithmic:
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_minor_locator(NullLocator())
            axis.set_major_formatter(FuncFormatter(_tick))
        axis.set_label_text(_named(parameter))
    axes.set_xlim(across[0], across[-1])
    axes.set_ylim(up[0], up[-1])
    axes.set_title(f"Error over {found.parameters[0].name} and {found.parameters[1].name}, all else held")
    drawing.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 3))
    return drawing


def _named(parameter: Parameter) -> str:
    return f"{parameter.name} [{parameter.unit}]" if parameter.unit else parameter.name


def _tick(value: float, _: int | None) -> str:
    return plain(float(f"{value:.3g}"))
