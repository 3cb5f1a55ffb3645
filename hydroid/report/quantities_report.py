"""What the logs determine, in the words of an engineer: table, figure and lines of a fit's quantities."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hydroid.estimate import CurveEstimate, QuantityEstimate
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.quantities import Quantities
from hydroid.problem.problem import Problem
from hydroid.report.chart import Chart, Color, Mark, Panel
from hydroid.report.page import Plot, Section
from hydroid.report.table import Cell, Table
from hydroid.words import listed, number

BEST = 6
"""quantities that a fit prints at most"""
BEST_WITHIN = 0.3
"""relative half interval of these at most"""
MOST_LOST = 8
"""quantities that are not determined, of which at most so many are named"""
DETERMINED_WITHIN = 1.0
"""relative half interval above which a quantity is listed as not determined"""
_HELD = 0.2
"""how long a command is held at least to be marked in the figure [s]"""
_CAPTION = (
    "Speed against command in the middle of the logged travel, and at 50 % command over the travel; bands "
    "are 95 % intervals. Grey: commands beyond those of the logs. Ticks: commands that the logs hold. A "
    "band may be thinner than its line. Where the logs do not determine the speed, curves.csv has no limits."
)


def quantity_section(problem: Problem, quantities: Quantities) -> Section:
    """Return the section with all quantities and the curves of speed."""
    logs, source = problem.logs, "logs and priors" if len(problem.priors) else "logs"
    text = (
        f"The {source} determine these quantities. They follow from all parameters together, and can be "
        "known well although no single parameter is: parameter sets that explain the logs mostly agree on "
        "them."
    )
    speeds = any(name.endswith("_speed") for name in quantities.curves)
    plots = (Plot("speed", _CAPTION, partial(draw_speeds, quantities, logs)),) if speeds else ()
    tables = {"quantities": quantity_table(quantities)}
    return Section("What is known", text, tables=tables, plots=plots)


def lost_quantities(quantities: Quantities) -> tuple[str, ...]:
    """Name the quantities that the logs do not determine."""
    lost = [_name(q, quantities) for q in quantities.scalars.values() if not _within(q) <= DETERMINED_WITHIN]
    if not lost:
        return ()
    more = len(lost) - MOST_LOST
    names = listed(lost) if more <= 1 else f"{', '.join(lost[:MOST_LOST])} and {more} more quantities"
    return (f"Not determined: {names}.",)


def quantity_table(quantities: Quantities) -> Table:
    """Return the quantities that are determined, each with its 95 % interval."""
    rows: list[tuple[Cell, ...]] = []
    for one in quantities.scalars.values():
        if (within := _within(one)) <= DETERMINED_WITHIN:
            rows.append((one.joint, one.label, one.unit, one.value, *one.interval, 100 * within))
    note = (
        "from, to: 95 % interval, to first order; ±: half of the interval, about two standard deviations. "
        "The interval is only right if the model is right. "
        "Speeds: in the middle of the logged travel. Dead time: from a step of the command until a tenth of "
        "the final speed. Time constant: from there to 63 % of it. docs/quantities.md defines every quantity."
    )
    header = ("joint", "quantity", "unit", "value", "from", "to", "± [%]")
    return Table("Quantities", header, tuple(rows), note, ("± [%]",))


def known_quantities(quantities: Quantities) -> int:
    """Return how many quantities have a 95 % interval within BEST_WITHIN."""
    return sum(_within(q) <= BEST_WITHIN for q in quantities.scalars.values())


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


def draw_speeds(quantities: Quantities, logs: Sequence[Log]) -> Chart:
    """Draw each joint's speed against command with its band and, in stage 2, at 50 % over its travel."""
    curves = quantities.curves
    columns = 2 if any("_over_poses" in name for name in curves) else 1
    panels: list[Panel] = []
    for curve in (c for name, c in curves.items() if name.endswith("_speed")):
        commands = np.concatenate([log.command[:, curve.joint - 1] for log in logs])
        marks = _logged(commands, logs[0].period)
        at = np.array(curve.at)
        for side, color in ((at > 0, "blue"), (at < 0, "orange")):
            marks += _curve(curve, side, color)
        title = f"Joint {curve.joint}: speed in mid travel"
        panels.append(Panel("command [%]", "speed [deg/s]", tuple(marks), title, 250, (-105.0, 105.0)))
        poses = [c for n, c in curves.items() if n.startswith(f"joint{curve.joint}_speed_50_over_poses")]
        marks = []
        for one, color in zip(poses, ("blue", "orange"), strict=False):
            marks += _curve(one, np.ones(len(one.at), bool), color, one.label.rpartition(", ")[2])
        if columns > 1:
            panels.append(Panel("angle [deg]", "speed [deg/s]", tuple(marks), "Speed at 50 % command", 250))
    return Chart(tuple(panels), columns=columns)


def _curve(curve: CurveEstimate, chosen: NDArray[np.bool_], color: Color, label: str = "") -> list[Mark]:
    at, value = np.array(curve.at)[chosen], np.array(curve.value)[chosen]
    ends = np.array([[np.nan if e is None else e for e in pair] for pair in curve.interval])[chosen]
    return [
        Mark("band", at, ends[:, 0], ends[:, 1], color=color, alpha=0.25),
        Mark("line", at, value, color=color, label=label),
        Mark("points", at, value, color=color, width=5),
    ]


def _logged(commands: Array, period: float) -> list[Mark]:
    """Shade what lies beyond the logs' commands, and tick those that are held."""
    levels, counts = np.unique(commands[commands != 0], return_counts=True)
    if not levels.size:
        return []
    low, high = min(levels[0], 0.0), max(levels[-1], 0.0)
    beyond = Mark("spans", np.array([-105.0, high]), end=np.array([low, 105.0]), color="pale", alpha=0.4)
    held = levels[counts * period >= _HELD]
    return [beyond, Mark("points", held, np.zeros(len(held)), color="grey", width=9, look="dash")]


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
