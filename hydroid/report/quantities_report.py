"""What the logs determine, in the words of an engineer: table, figure and lines of a fit's quantities."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hydroid.estimate import CurveEstimate, QuantityEstimate
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.quantities.quantities import Quantities
from hydroid.report import style
from hydroid.report.page import Plot, Section
from hydroid.report.phrases import listed
from hydroid.report.table import Cell, Table, number

BEST = 6
"""quantities that a fit prints at most"""
BEST_WITHIN = 0.3
"""relative half interval of these at most"""
DETERMINED_WITHIN = 1.0
"""relative half interval above which a quantity is listed as not determined"""
_HELD = 0.2
"""how long a command is held at least to be marked in the figure [s]"""
_CAPTION = (
    "Left: speed against command in the middle of the logged travel; the band is its 95 % interval. Grey: "
    "commands beyond those of the logs. Ticks: commands that the logs hold. Right: the speed at 50 % command "
    "over the logged travel. Where there is no band, the logs do not determine the speed."
)


def quantity_section(problem: Problem, quantities: Quantities) -> Section:
    """Return the section with all quantities and the curves of speed."""
    logs, source = problem.logs, "logs and priors" if len(problem.priors) else "logs"
    lost = [_name(q, quantities) for q in quantities.scalars.values() if not _within(q) <= DETERMINED_WITHIN]
    text = (
        "These quantities follow from all parameters together. They can be known well although no single "
        "parameter is: all parameter sets that explain the logs agree on them."
    )
    points = (f"Not determined: {listed(lost)}.",) if lost else ()
    speeds = {c.joint: c for n, c in quantities.curves.items() if n.endswith("_speed")}
    plots = (Plot("speed", _CAPTION, partial(draw_speeds, quantities, logs)),) if speeds else ()
    table = quantity_table(quantities)
    return Section(f"What the {source} determine", text, points, tables={"quantities": table}, plots=plots)


def quantity_table(quantities: Quantities) -> Table:
    """Return the quantities that are determined, each with its 95 % interval."""
    rows: list[tuple[Cell, ...]] = []
    for one in quantities.scalars.values():
        if (within := _within(one)) <= DETERMINED_WITHIN:
            rows.append((one.joint, one.label, one.unit, one.value, *one.interval, 100 * within))
    note = (
        "from, to: 95 % interval, to first order; ±: half of it. It is only right if the model is right. "
        "Speeds: in the middle of the logged travel. Dead time: from a step of the command until a tenth of "
        "the final speed. Time constant: from there to 63 % of it. docs/quantities.md defines every quantity."
    )
    header = ("joint", "quantity", "unit", "value", "from", "to", "± [%]")
    return Table("Quantities", header, tuple(rows), note, ("± [%]",))


def best_known(quantities: Quantities) -> list[str]:
    """Return a line for each of the best-known quantities, the best first, under a heading; or nothing."""
    known = [q for q in quantities.scalars.values() if _within(q) <= BEST_WITHIN]
    best = sorted(known, key=_within)[:BEST]
    lines = [
        f"  {_name(q, quantities)}: {number(q.value)} {q.unit}".rstrip() + f" ({_ends(q)})" for q in best
    ]
    return ["Best determined, with 95 % intervals:", *lines] if lines else []


def curves_csv(curves: Mapping[str, CurveEstimate]) -> str:
    """Return all curves as CSV, one point per row; an end without limit is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("curve", "joint", "quantity", "unit", "along", "at", "value", "from", "to"))
    for name, curve in curves.items():
        for at, value, ends in zip(curve.at, curve.value, curve.interval, strict=True):
            writer.writerow((name, curve.joint, curve.label, curve.unit, curve.along, at, value, *ends))
    return text.getvalue()


def draw_speeds(quantities: Quantities, logs: Sequence[Log]) -> Figure:
    """Draw each joint's speed against command with its band and, in stage 2, at 50 % over its travel."""
    curves = quantities.curves
    joints = [c.joint for n, c in curves.items() if n.endswith("_speed")]
    columns = 2 if any("_over_poses" in n for n in curves) else 1
    drawing = style.figure(0.5 + 2.6 * len(joints))
    panels = drawing.subplots(
        len(joints), columns, squeeze=False, gridspec_kw={"hspace": 0.5, "wspace": 0.25}
    )
    for row, joint in zip(panels, joints, strict=True):
        commands = np.concatenate([log.command[:, joint - 1] for log in logs])
        _mark_commands(row[0], commands, logs[0].period)
        curve = curves[f"joint{joint}_speed"]
        at = np.array(curve.at)
        for side, color in ((at > 0, style.SEARCH), (at < 0, style.REFINED)):
            _band(row[0], curve, side, color)
        row[0].set_title(f"Joint {joint}: speed in mid travel")
        row[0].set_xlabel("command [%]")
        row[0].set_ylabel("speed [deg/s]")
        poses = [c for n, c in curves.items() if n.startswith(f"joint{joint}_speed_50_over_poses")]
        for one, color in zip(poses, (style.SEARCH, style.REFINED), strict=False):
            _band(row[-1], one, np.ones(len(one.at), bool), color, one.label.rpartition(", ")[2])
        if poses:
            row[-1].set_title("Speed at 50 % over its travel")
            row[-1].set_xlabel("angle [deg]")
            row[-1].legend(fontsize=8)
    return drawing


def _band(
    axes: Axes, curve: CurveEstimate, chosen: NDArray[np.bool_], color: str, label: str | None = None
) -> None:
    at, value = np.array(curve.at)[chosen], np.array(curve.value)[chosen]
    ends = np.array([[np.nan if e is None else e for e in pair] for pair in curve.interval])[chosen]
    axes.fill_between(at, *ends.T, color=color, alpha=0.25, linewidth=0)
    axes.plot(at, value, ".-", color=color, markersize=4, label=label)


def _mark_commands(axes: Axes, commands: Array, period: float) -> None:
    """Shade what lies beyond the logs' commands, and tick those that are held."""
    levels, counts = np.unique(commands[commands != 0], return_counts=True)
    axes.set_xlim(-105, 105)
    if levels.size:
        axes.axvspan(-105, min(levels[0], 0), color=style.PALE, alpha=0.6, linewidth=0)
        axes.axvspan(max(levels[-1], 0), 105, color=style.PALE, alpha=0.6, linewidth=0)
    held = levels[counts * period >= _HELD]
    axes.plot(
        held, np.zeros(len(held)), "|", color=style.GREY, markersize=6, transform=axes.get_xaxis_transform()
    )


def _within(quantity: QuantityEstimate) -> float:
    """Half of the 95 % interval relative to the value; infinite where the interval has no limit."""
    low, high = quantity.interval
    if low is None or high is None or quantity.value == 0:
        return math.inf
    return abs((high - low) / (2 * quantity.value))


def _name(quantity: QuantityEstimate, quantities: Quantities) -> str:
    several = len({q.joint for q in quantities.scalars.values()}) > 1
    return f"joint {quantity.joint}: {quantity.label}" if several else quantity.label


def _ends(quantity: QuantityEstimate) -> str:
    return " to ".join(number(end) for end in quantity.interval if end is not None)
