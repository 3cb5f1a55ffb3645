"""A designed experiment: its commands with the motion they are predicted to cause, and what it would tell."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report.plots.style import GREY, MEASURED, PALE, REFINED, SEARCH, figure, styled
from hydroid.report.table import plain


@styled
def motion(log: Log, names: Sequence[str], lower: Array, upper: Array) -> Figure:
    """Commands and predicted angles of the joints that move.

    Args:
        log: commands, and the predicted motion.
        names: of the joints, (J,).
        lower: limits of the motion [rad], shape (J,); -inf where there is none.
        upper: the same above.
    """
    joints: list[int] = np.flatnonzero(log.driven | (np.ptp(log.angle, axis=0) > 0)).tolist()
    drawing = figure(0.9 + 1.5 * len(joints), 7.4)
    panels = np.atleast_1d(drawing.subplots(len(joints), 1, sharex=True))
    for axes, joint in zip(panels, joints, strict=True):
        _joint(axes, log, joint, (lower[joint], upper[joint]))
        axes.set_title(f"Joint {joint + 1}, {names[joint]}", fontsize=10)
    panels[-1].set_xlabel("time [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=3)
    return drawing


def _joint(axes: Axes, log: Log, joint: int, limits: tuple[float, float]) -> None:
    angle = np.degrees(log.angle[:, joint])
    right = axes.twinx()
    right.step(log.time, log.command[:, joint], where="post", color=GREY, linewidth=1.0)
    right.set_ylim(-108, 108)
    right.set_yticks((-100, 0, 100))
    right.set_ylabel("command [%]", color="#666666", fontsize=8)
    right.tick_params(labelsize=8)
    right.spines["right"].set_visible(True)
    right.grid(False)
    axes.set_zorder(right.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.plot(log.time, angle, color=REFINED, linewidth=1.8, label="predicted angle")
    axes.plot((), (), color=GREY, linewidth=1.0, label="command")
    reach = max(0.15 * float(np.ptp(angle)), 1.0)
    axes.set_ylim(float(angle.min()) - reach, float(angle.max()) + reach)
    for limit in limits:
        axes.axhline(np.degrees(limit), color=MEASURED, linewidth=1.0, linestyle=(0, (5, 3)))
    axes.plot((), (), color=MEASURED, linewidth=1.0, linestyle=(0, (5, 3)), label="limit (range less margin)")
    axes.set_ylabel("angle [deg]", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.margins(x=0)


@styled
def precision(names: Sequence[str], before: Array, random: Array, designed: Array, known: float) -> Figure:
    """Relative standard deviation of each parameter before, after a random and after the designed experiment.

    Args:
        names: of the F parameters.
        before: shape (F,).
        random: shape (F,), the median over random experiments.
        designed: shape (F,).
        known: below this a parameter counts as determined.
    """
    drawing = figure(1.5 + 0.3 * len(names))
    axes = drawing.subplots()
    at = np.arange(len(names))[::-1]
    axes.hlines(at, 100 * designed, 100 * random, color=PALE, linewidth=3.0, zorder=1)
    for values, color, mark, label in (
        (before, GREY, "|", "before"),
        (random, SEARCH, "o", "random experiment (median)"),
        (designed, REFINED, "D", "designed experiment"),
    ):
        axes.plot(100 * values, at, mark, color=color, markersize=8, label=label)
    axes.axvline(100 * known, color=MEASURED, linewidth=1.0, linestyle=(0, (5, 3)))
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(_tick))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(at, names)
    axes.set_xlabel(
        "predicted relative standard deviation [%], from ±100 % without any log\n"
        "left of the dashed line: determined"
    )
    axes.set_title("What the experiment would tell")
    drawing.legend(loc="outside lower center", ncols=3)
    return drawing


def _tick(value: float, _: int | None) -> str:
    return plain(value)
