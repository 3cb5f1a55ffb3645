"""What each parameter does to one channel against time (article, figure 10)."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.parameters import Array
from hydroid.report.plots.style import GREY, MEASURED, REFINED, figure, finite, styled
from hydroid.report.table import number, plain
from hydroid.uncertainty.jacobian import NO_EFFECT_BELOW

_ROW, _MOST = 0.95, 12
"""height of a panel [in]; more parameters than this stand in two columns"""
_POINTS = 2500
"""samples drawn of a curve: more than a page resolves"""
_FAR = 1.0
"""a response this many motions of the estimate's away has run off the panel"""


@styled
def slopes(title: str, unit: str, names: Sequence[str], time: Array, output: Array, change: Array) -> Figure:
    """Change of a channel per 1 % of each parameter against time.

    Args:
        title: of the figure.
        unit: of the channel.
        names: of the F parameters.
        time: [s], shape (T,).
        output: the channel at the estimate, shape (T,).
        change: per 1 % of each parameter, shape (F, T).
    """
    drawing, panels, top = _panels(title, len(names))
    thin = slice(None, None, max(1, len(time) // _POINTS))
    top.plot(time[thin], output[thin], color=MEASURED)
    top.set_ylabel(f"[{unit}]")
    top.set_title("the output at the estimate", fontsize=9, fontweight="normal")
    strength = np.sqrt(np.mean(change**2, axis=1))
    none = strength <= NO_EFFECT_BELOW * np.nanmax(strength, initial=0.0)
    for axes, name, curve, rms, idle in zip(panels, names, change, strength, none, strict=True):
        most = 0.0 if idle else float(np.max(np.abs(curve)))
        axes.plot(time[thin], finite(curve)[thin], color=REFINED)
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        # what is no more than rounding is drawn flat
        reach = 1.15 * most if np.isfinite(most) and most > 0 else 1.0
        axes.set_ylim(-reach, reach)
        axes.set_ylabel(f"{name}\n[{unit}/%]")
        said = f"rms {number(float(rms))} {unit} per 1 %" if np.isfinite(rms) else "the changed arm diverges"
        said = "no effect on this output" if idle else said
        axes.set_title(said, fontsize=9, fontweight="normal")
    return drawing


@styled
def sheaves(
    title: str,
    unit: str,
    names: Sequence[str],
    time: Array,
    output: Array,
    values: Array,
    responses: Array,
) -> Figure:
    """A channel for several values of each parameter within its bounds, as in figure 10.

    Args:
        title: of the figure.
        unit: of the channel.
        names: of the F parameters, with units.
        time: [s], shape (T,).
        output: the channel at the estimate, shape (T,).
        values: of each parameter, shape (F, N).
        responses: the channel at them, shape (F, N, T); NaN where infeasible.
    """
    drawing, panels, top = _panels(title, len(names))
    thin = slice(None, None, max(1, len(time) // _POINTS))
    top.set_axis_off()
    colors = colormaps["viridis"](np.linspace(0.0, 0.95, values.shape[1]))
    reach = _FAR * max(float(np.ptp(output)), 1e-3)
    for axes, name, value, curves in zip(panels, names, values, responses, strict=True):
        for color, curve in zip(colors, curves, strict=True):
            axes.plot(time[thin], finite(curve)[thin], color=color, linewidth=0.8)
        axes.plot(time[thin], output[thin], color=MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))
        known = curves[np.isfinite(curves)]
        low, high = (float(f(known, initial=f(output))) for f in (np.min, np.max))
        low, high = max(low, output.min() - reach), min(high, output.max() + reach)
        margin = 0.06 * (high - low) + 1e-9
        axes.set_ylim(low - margin, high + margin)
        axes.set_ylabel(f"[{unit}]")
        lost = int(np.sum(~np.isfinite(curves).all(axis=1)))
        note = f", {lost} of {len(value)} infeasible" if lost else ""
        axes.set_title(
            f"{name}: {plain(value[0])} to {plain(value[-1])}{note}", fontsize=9, fontweight="normal"
        )
    key = top.inset_axes((0.08, 0.35, 0.3, 0.18))
    key.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap="viridis", extent=(0, 1, 0, 1))
    key.set_yticks(())
    key.set_xticks((0, 1), ("lower bound", "upper bound"), fontsize=8)
    key.grid(False)
    top.plot((), (), color=MEASURED, linestyle=(0, (4, 2)), label="at the estimate")
    top.legend(loc="center right")
    return drawing


def _panels(title: str, count: int) -> tuple[Figure, list[Axes], Axes]:
    """A figure with a wide panel above one panel for each parameter."""
    columns = 1 if count <= _MOST else 2
    rows = -(-count // columns)
    drawing = figure(1.0 + _ROW * (rows + 1), 6.4 if columns == 1 else 10.0)
    drawing.suptitle(title, x=0.02, ha="left", fontsize=11, fontweight="bold")
    grid = drawing.add_gridspec(rows + 1, columns)
    top = drawing.add_subplot(grid[0, :])
    panels = [
        drawing.add_subplot(grid[1 + i % rows, i // rows], sharex=top if i == 0 else None)
        for i in range(count)
    ]
    for i, axes in enumerate(panels):
        last = i % rows == rows - 1 or i == count - 1
        axes.margins(x=0)
        axes.tick_params(labelsize=8, labelbottom=last)
        if last:
            axes.set_xlabel("time [s]")
    top.margins(x=0)
    top.tick_params(labelsize=8)
    drawing.align_ylabels()
    return drawing, panels, top
