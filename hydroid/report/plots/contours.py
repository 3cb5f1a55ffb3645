"""The error over two parameters (article, figure 11)."""

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from hydroid.report.phrases import in_reader_units, norm_label
from hydroid.report.plots import style
from hydroid.report.table import number
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.surface import WIDE, Surface

_LEVELS = 14


def contours(surface: Surface, objective: ObjectiveSettings) -> Figure:
    """Draw contours of the error and mark the estimate, the lowest point and where simulations diverge."""
    error = in_reader_units(objective, np.where(np.isfinite(surface.error), surface.error, np.nan)).T
    drawing = style.figure(5.0, right=0.3)
    axes = drawing.subplots()
    across, up = surface.values
    axes.set_facecolor(style.PALE)
    known = error[np.isfinite(error)]
    if known.size and known.max() > known.min():
        # a point that reproduces its data exactly would stretch a logarithmic scale to nothing
        low = max(float(known.min()), 1e-3 * float(known.max()))
        wide = known.max() > 5 * low
        levels = (np.geomspace if wide else np.linspace)(low, float(known.max()), _LEVELS)
        norm = (LogNorm if wide else Normalize)(levels[0], levels[-1])
        shown = np.clip(error, low, None)
        filled = axes.contourf(across, up, shown, levels, norm=norm, cmap="viridis_r", extend="neither")
        axes.contour(across, up, shown, levels, colors="white", linewidths=0.4, alpha=0.6)
        bar = drawing.colorbar(
            filled, ax=axes, label=norm_label(objective), format=FuncFormatter(style.tick), pad=0.03
        )
        bar.set_ticks(list(levels[:: max(1, _LEVELS // 6)]))
        bar.ax.yaxis.set_minor_locator(NullLocator())
    unit = "" if objective.relative else " deg"
    for (x, y, value), color, mark, label in (
        (surface.lowest, "white", "o", "lowest point drawn"),
        ((*surface.estimate, surface.estimate_error), style.REFINED, "D", "estimate"),
    ):
        size = 10 if mark == "o" else 6  # where both are one point, the estimate lies on the other
        text = f"{label} ({number(float(in_reader_units(objective, np.array(value))))}{unit})"
        look = {"markeredgecolor": "black", "markersize": size, "clip_on": False, "linestyle": "none"}
        axes.plot(x, y, mark, color=color, label=text, **look)
    handles = style.labelled(axes)
    if surface.infeasible:
        name = f"infeasible ({surface.infeasible} points)"
        handles.append(Patch(facecolor=style.PALE, edgecolor=style.GREY, label=name))
    for axis, values, parameter, scale in (
        (axes.xaxis, across, surface.parameters[0], axes.set_xscale),
        (axes.yaxis, up, surface.parameters[1], axes.set_yscale),
    ):
        if values[0] > 0 and values[-1] > WIDE * values[0]:
            scale("log")
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_minor_locator(NullLocator())
            axis.set_major_formatter(FuncFormatter(style.tick))
        axis.set_label_text(f"{parameter.name} [{parameter.unit}]" if parameter.unit else parameter.name)
    axes.set_xlim(across[0], across[-1])
    axes.set_ylim(up[0], up[-1])
    first, second = (parameter.name for parameter in surface.parameters)
    axes.set_title(f"Error over {first} and {second}, all other parameters at the estimate")
    style.legend_below(drawing, handles)
    return drawing
