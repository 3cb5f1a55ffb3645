"""The panel beside the picture: command, angle and pressure of each joint, drawn once, and a line at now."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hydroid.parameters import Array
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.figure import figure, style
from hydroid.viewer.motion import JointSignals, Motion


class SignalPanel:
    """Signals of a motion on a white panel.

    Args:
        motion: whose signals are drawn.
        size: width and height [px].
        scale: of letters and lines; 1 suits a height of 1080 px.
    """

    def __init__(self, motion: Motion, size: tuple[int, int], scale: float = 1.0) -> None:
        self._error, self._scale = motion.error, scale
        shown = motion.signals[:7]  # the others move in the picture only
        kinds = 3 if any(joint.pressures for joint in shown) else 2
        panels = [panel for joint in shown for panel in _joint(joint, motion.time)[:kinds]]
        chart = Chart(tuple(panels), 1 if len(shown) <= 2 else kinds, linked=True)
        with style():
            drawing = figure(chart, "\n")
            drawing.set_size_inches(size[0] / (100 * scale), size[1] / (100 * scale))
            drawing.set_dpi(100 * scale)
            canvas = FigureCanvasAgg(drawing)
            canvas.draw()
            self._picture = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._axes = drawing.axes
        bold = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"
        self._font = ImageFont.truetype(str(bold), round(22 * scale))

    def at(self, times: Sequence[float]) -> NDArray[np.uint8]:
        """Return the panel with a line at each time [s] as RGB, shape (height, width, 3), 0 to 255."""
        picture = Image.fromarray(self._picture)
        pen, thick = ImageDraw.Draw(picture), max(1, round(2 * self._scale))
        for axes in self._axes:
            box = axes.get_window_extent()
            for time in times:
                x = axes.transData.transform((time, 0.0))[0]
                pen.line([(x, picture.height - box.y1), (x, picture.height - box.y0)], (200, 30, 30), thick)
        words = ", ".join(f"{time:.1f}" for time in times) if len(times) > 1 else f"{times[0]:.2f}"
        error = f", rms error {self._error:.2f} deg" if np.isfinite(self._error) else ""
        pen.text((18 * self._scale, 12 * self._scale), f"{words} s{error}", "black", self._font)
        return np.asarray(picture)


def _joint(joint: JointSignals, time: Array) -> list[Panel]:
    """Return panels of the command, the angles and the pressures."""
    looks = {"measured": ("blue", 2.6, 0.35), "simulated": ("orange", 1.3, 1.0)}
    command = Mark("step", time, joint.measured.command[:, joint.joint], color="grey")
    angles = tuple(
        Mark("line", time, angle, color=looks[kind][0], label=kind, width=looks[kind][1])
        for kind, angle in joint.angles.items()
    )
    pressures = tuple(
        Mark("line", time, bar, color=color, label=label, width=looks[kind][1], alpha=looks[kind][2])
        for kind, pressure in joint.pressures.items()
        for bar, color, label in zip(pressure.T, ("green", "pink"), ("chamber A", "chamber B"), strict=True)
    )
    ends = float(time[0]), float(time[-1])
    return [
        Panel("", "", (command,), f"{joint.name}: command [%]", 130, ends, (-108.0, 108.0)),
        Panel("", "", angles, f"{joint.name}: angle [deg]", 220, ends),
        Panel("", "", pressures, f"{joint.name}: pressure [bar]", 220, ends),
    ]
