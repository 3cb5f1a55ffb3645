"""What each parameter does to one channel against time (article, figure 10)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.parameters import Array
from hydroid.report.plots import style
from hydroid.report.table import number, plain
from hydroid.uncertainty.jacobian import NO_EFFECT_BELOW

_ROW, _MOST = 0.95, 12
"""height of a panel [in]; more parameters than this stand in two columns"""
_SMALL = {"fontsize": 9, "fontweight": "normal"}


@dataclass(frozen=True, eq=False)
class ChannelCurves:
    """One channel at the estimate.

    name: of the channel. unit: its unit. time: [s], shape (T,). output: simulated, shape (T,).
    parameters: names of the F free parameters, and units of theirs.
    """

    name: str
    unit: str
    time: Array
    output: Array
    parameters: Sequence[tuple[str, str]]


def slopes(channel: ChannelCurves, change: Array) -> Figure:
    """Draw the change of a channel per 1 % of each parameter, shape (F, T), against time."""
    drawing, panels, top = _panels(f"{channel.name}: change per 1 % of each parameter", len(change))
    unit, time = channel.unit, channel.time
    top.plot(*style.decimated(time, channel.output), color=style.MEASURED)
    top.set_ylabel(f"[{unit}]")
    top.set_title("the output at the estimate", **_SMALL)
    strength = np.sqrt(np.mean(change**2, axis=1))
    none = strength <= NO_EFFECT_BELOW * np.nanmax(strength, initial=0.0)
    for axes, (name, _), curve, rms, idle in zip(
        panels, channel.parameters, change, strength, none, strict=True
    ):
        most = 0.0 if idle else float(np.max(np.abs(curve)))
        axes.plot(*style.decimated(time, style.finite(curve)), color=style.REFINED)
        axes.axhline(0.0, color=style.GREY, linewidth=0.8)
        # what is no more than rounding is drawn flat
        reach = 1.15 * most if np.isfinite(most) and most > 0 else 1.0
        axes.set_ylim(-reach, reach)
        axes.set_ylabel(f"{name}\n[{unit}/%]")
        size = f"rms {number(float(rms))} {unit} per 1 %" if np.isfinite(rms) else "the changed arm diverges"
        axes.set_title("no effect on this output" if idle else size, **_SMALL)
    return drawing


def response_families(channel: ChannelCurves, values: Array, responses: Array) -> Figure:
    """Draw a channel for several values of each parameter within its bounds, as in figure 10.

    Args:
        channel: the channel at the estimate.
        values: of each parameter, shape (F, N).
        responses: the channel at them, shape (F, N, T); NaN where the simulation diverges.
    """
    drawing, panels, top = _panels(f"{channel.name}: each parameter over its bounds", len(values))
    time, output = channel.time, channel.output
    top.set_axis_off()
    colors = colormaps["viridis"](np.linspace(0.0, 0.95, values.shape[1]))
    reach = max(float(np.ptp(output)), 1e-3)  # a response farther off has run away
    for axes, (name, unit), value, curves in zip(panels, channel.parameters, values, responses, strict=True):
        for color, curve in zip(colors, curves, strict=True):
            axes.plot(*style.decimated(time, style.finite(curve)), color=color, linewidth=0.8)
        axes.plot(*style.decimated(time, output), color=style.MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))
        known = curves[np.isfinite(curves)]
        low, high = (float(f(known, initial=f(output))) for f in (np.min, np.max))
        low, high = max(low, output.min() - reach), min(high, output.max() + reach)
        margin = 0.06 * (high - low) + 1e-9
        axes.set_ylim(low - margin, high + margin)
        axes.set_ylabel(f"[{channel.unit}]")
        lost = int(np.sum(~np.isfinite(curves).all(axis=1)))
        note = f", {lost} of {len(value)} infeasible" if lost else ""
        named = f"{name} [{unit}]" if unit else name
        axes.set_title(f"{named}: {plain(value[0])} to {plain(value[-1])}{note}", **_SMALL)
    key = top.inset_axes((0.08, 0.35, 0.3, 0.18))
    key.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap="viridis", extent=(0, 1, 0, 1))
    key.set_yticks(())
    key.set_xticks((0, 1), ("lower bound", "upper bound"), fontsize=8)
    key.grid(False)
    top.plot((), (), color=style.MEASURED, linestyle=(0, (4, 2)), label="at the estimate")
    top.legend(loc="center right")
    return drawing


def _panels(title: str, count: int) -> tuple[Figure, list[Axes], Axes]:
    """Return a figure with a wide panel above one panel per parameter."""
    columns = 1 if count <= _MOST else 2
    rows = -(-count // columns)
    drawing = style.figure(
        1.0 + _ROW * (rows + 1), 6.4 if columns == 1 else 10.0, left=0.95, top=0.6, bottom=0.5
    )
    drawing.suptitle(
        title,
        x=0.02,
        y=1 - 0.1 / drawing.get_figheight(),
        ha="left",
        va="top",
        fontsize=11,
        fontweight="bold",
    )
    grid = drawing.add_gridspec(rows + 1, columns, hspace=0.62, wspace=0.25)
    top = drawing.add_subplot(grid[0, :])
    panels = [drawing.add_subplot(grid[1 + i % rows, i // rows]) for i in range(count)]
    for i, axes in enumerate(panels):
        last = i % rows == rows - 1 or i == count - 1
        axes.tick_params(labelsize=8, labelbottom=last)
        if last:
            axes.set_xlabel("time [s]")
    for axes in (top, *panels):
        axes.margins(x=0)
        axes.yaxis.set_label_coords(-0.45 / (drawing.get_figwidth() / columns), 0.5)
    top.tick_params(labelsize=8)
    return drawing, panels, top
