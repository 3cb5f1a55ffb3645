"""The panel beside the picture: command, angle and pressure of each joint, drawn once, and a line at now."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hydroid.parameters import Array
from hydroid.report import style
from hydroid.viewer.motion import JointSignals, Motion

MOST_JOINTS = 7
"""joints that are drawn; the others move in the picture only"""
SIMULATED, MEASURED = "#D95F02", "#1F6FD0"
"""colours of the simulated arm and of its ghost, in panel and picture"""
CHAMBERS = ("#7B3294", "#008837")
NOW = (200, 30, 30)
HEAD = 0.085
"""part of the panel's height above the axes, for time and legend"""


class Panel:
    """Signals of a motion on a white panel.

    Args:
        motion: whose signals are drawn.
        size: width and height [px].
        scale: of letters and lines; 1 suits a height of 1080 px.
    """

    def __init__(self, motion: Motion, size: tuple[int, int], scale: float = 1.0) -> None:
        self._motion, self._size, self._scale = motion, size, scale
        with style.style(), mpl.rc_context({"font.size": 9.0, "axes.titlesize": 9.5, "axes.labelsize": 8.5}):
            drawing = Figure(figsize=(size[0] / (100 * scale), size[1] / (100 * scale)), dpi=100 * scale)
            canvas = FigureCanvasAgg(drawing)
            self._axes = _draw(drawing, motion.signals[:MOST_JOINTS], motion.time)
            canvas.draw()
            self._picture = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        letters = Path(mpl.get_data_path()) / "fonts" / "ttf"
        self._large = ImageFont.truetype(str(letters / "DejaVuSans-Bold.ttf"), round(26 * scale))
        self._small = ImageFont.truetype(str(letters / "DejaVuSans.ttf"), round(15 * scale))

    def at(self, times: Sequence[float]) -> NDArray[np.uint8]:
        """Return the panel with a line at each time [s] as RGB, shape (height, width, 3), 0 to 255."""
        picture = Image.fromarray(self._picture)
        pen, height, thick = ImageDraw.Draw(picture), self._size[1], max(1, round(2 * self._scale))
        for axes in self._axes:
            box = axes.get_window_extent()
            for time in times:
                x = axes.transData.transform((time, 0.0))[0]
                pen.line([(x, height - box.y1), (x, height - box.y0)], fill=NOW, width=thick)
        left, unit = 18 * self._scale, self._scale
        words = ", ".join(f"{time:.1f}" for time in times) if len(times) > 1 else f"{times[0]:.2f}"
        pen.text((left, 14 * unit), f"{words} s", fill="black", font=self._large)
        self._legend(pen, left, 56 * unit)
        return np.asarray(picture)

    def _legend(self, pen: ImageDraw.ImageDraw, left: float, top: float) -> None:
        entries = [(SIMULATED, "simulated")]
        if self._motion.measured is not None:
            entries.append((MEASURED, "measured"))
        if any(signals.pressure is not None for signals in self._motion.signals):
            entries += [(CHAMBERS[0], "pressure A"), (CHAMBERS[1], "B")]
        for color, label in entries:
            side = 14 * self._scale
            pen.rectangle([left, top + 2, left + side, top + 2 + side], fill=color)
            pen.text((left + 1.5 * side, top), label, fill="#333333", font=self._small)
            left += 1.5 * side + pen.textlength(label, font=self._small) + 2 * side
        if np.isfinite(self._motion.error):
            error = f"rms {self._motion.error:.2f} deg"
            pen.text((left, top), error, fill="#333333", font=self._small)


def _draw(drawing: Figure, signals: Sequence[JointSignals], time: Array) -> list[Axes]:
    """Draw few joints below each other with large panels, or one row for each of many."""
    kinds = ["command", "angle", *(["pressure"] if any(s.pressure is not None for s in signals) else [])]
    few = len(signals) <= 2
    rows, columns = (len(kinds) * len(signals), 1) if few else (len(signals), len(kinds))
    heights = [1.0 if kind == "command" else 1.6 for kind in kinds] * len(signals) if few else [1.0] * rows
    room = {"left": 0.1 if few else 0.07, "right": 0.97, "top": 1 - HEAD - 0.03, "bottom": 0.055}
    room |= {"hspace": 0.3 if few else 0.5, "wspace": 0.3}
    grid = drawing.add_gridspec(rows, columns, height_ratios=heights, **room)
    made: list[Axes] = []
    for j, joint in enumerate(signals):
        for k, kind in enumerate(kinds):
            row, column = (j * len(kinds) + k, 0) if few else (j, k)
            axes: Any = drawing.add_subplot(grid[row, column])
            _KINDS[kind](axes, joint, time)
            axes.set_xlim(time[0], time[-1])
            axes.locator_params(axis="y", nbins=4)
            if row < rows - 1:
                axes.set_xticklabels([])
            else:
                axes.set_xlabel("time [s]")
            made.append(axes)
    return made


def _command(axes: Axes, joint: JointSignals, time: Array) -> None:
    axes.step(*style.decimated(time, joint.command), where="post", color="#555555", linewidth=1.2)
    axes.set_ylim(-108, 108)
    axes.set_title(f"{joint.name}: command [%]")


def _angle(axes: Axes, joint: JointSignals, time: Array) -> None:
    if joint.measured is not None:
        axes.plot(*style.decimated(time, joint.measured), color=MEASURED, linewidth=2.6, alpha=0.75)
    axes.plot(*style.decimated(time, joint.simulated), color=SIMULATED, linewidth=1.4)
    axes.set_title(f"{joint.name}: angle [deg]")


def _pressure(axes: Axes, joint: JointSignals, time: Array) -> None:
    for chamber, color in enumerate(CHAMBERS):
        if joint.measured_pressure is not None:
            values = style.decimated(time, joint.measured_pressure[:, chamber])
            axes.plot(*values, color=color, linewidth=2.6, alpha=0.35)
        if joint.pressure is not None:
            axes.plot(*style.decimated(time, joint.pressure[:, chamber]), color=color, linewidth=1.1)
    axes.set_title(f"{joint.name}: pressure [bar]")


_KINDS = {"command": _command, "angle": _angle, "pressure": _pressure}
