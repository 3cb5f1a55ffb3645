"""A designed experiment: its commands with the predicted motion, and the predicted precision."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report.plots import style
from hydroid.uncertainty.flags import WEAK_ABOVE

_DASHED = (0, (5, 3))


def motion(log: Log, names: Sequence[str], limits: Array) -> Figure:
    """Draw commands and predicted angles of the joints that move.

    Args:
        log: commands, and the predicted motion.
        names: of the J joints.
        limits: lowest and highest angle allowed [rad], shape (J, 2); infinite where there is none.
    """
    joints: list[int] = np.flatnonzero(log.driven | (np.ptp(log.angle, axis=0) > 0)).tolist()
    drawing = style.figure(1.0 + 1.5 * len(joints), 7.4, right=0.75)
    panels = np.atleast_1d(drawing.subplots(len(joints), 1, sharex=True, gridspec_kw={"hspace": 0.35}))
    for axes, joint in zip(panels, joints, strict=True):
        _joint(axes, log, joint, limits[joint])
        axes.set_title(f"Joint {joint + 1}, {names[joint]}", fontsize=10)
    panels[-1].set_xlabel("time [s]")
    style.legend_below(drawing, style.labelled(panels[0]))
    return drawing


def _joint(axes: Axes, log: Log, joint: int, limits: Array) -> None:
    angle = np.degrees(log.angle[:, joint])
    right = axes.twinx()
    right.step(
        *style.decimated(log.time, log.command[:, joint]), where="post", color=style.GREY, linewidth=1.0
    )
    right.set_ylim(-108, 108)
    right.set_yticks((-100, 0, 100))
    right.set_ylabel("command [%]", color="#666666", fontsize=8)
    right.tick_params(labelsize=8)
    right.spines["right"].set_visible(True)
    right.grid(False)
    axes.set_zorder(right.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.plot(*style.decimated(log.time, angle), color=style.REFINED, linewidth=1.8, label="predicted angle")
    axes.plot((), (), color=style.GREY, linewidth=1.0, label="command")
    reach = max(0.15 * float(np.ptp(angle)), 1.0)
    axes.set_ylim(float(angle.min()) - reach, float(angle.max()) + reach)
    for limit in np.degrees(limits):
        axes.axhline(limit, color=style.MEASURED, linewidth=1.0, linestyle=_DASHED)
    axes.plot(
        (), (), color=style.MEASURED, linewidth=1.0, linestyle=_DASHED, label="limit (range less margin)"
    )
    axes.set_ylabel("angle [deg]", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.margins(x=0)


def precision(names: Sequence[str], before: Array, random: Array, designed: Array) -> Figure:
    """Draw standard deviations, shape (F,), before, after a random and after the designed experiment.

    `random` is the median over random experiments.
    """
    drawing = style.figure(1.7 + 0.3 * len(names), left=style.room_for(names))
    axes = drawing.subplots()
    at = np.arange(len(names))[::-1]
    axes.hlines(at, 100 * designed, 100 * random, color=style.PALE, linewidth=3.0, zorder=1)
    for values, color, mark, label in (
        (before, style.GREY, "|", "before"),
        (random, style.SEARCH, "o", "after a random experiment (median)"),
        (designed, style.REFINED, "D", "after the designed experiment"),
    ):
        axes.plot(100 * values, at, mark, color=color, markersize=8, label=label)
    limit = f"{100 * WEAK_ABOVE:.0f} %: identifiable below"
    axes.axvline(100 * WEAK_ABOVE, color=style.MEASURED, linewidth=1.0, linestyle=_DASHED, label=limit)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(style.tick))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(at, names)
    axes.set_xlabel("predicted relative standard deviation [%]")
    axes.set_title("Predicted precision of each parameter")
    style.legend_below(drawing, style.labelled(axes), columns=2)
    return drawing
