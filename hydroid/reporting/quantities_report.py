"""What the logs determine, in the words of an engineer: table, figure and lines of a fit's quantities."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from hydroid.estimate import CurveEstimate, FitSummary, QuantityEstimate
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Plot, Section
from hydroid.reporting.table import Table
from hydroid.settings.fit import FitSettings
from hydroid.words import number

BEST_WITHIN = 0.3
"""half of a 95 % interval, relative to the value, up to which a property counts as fixed"""
_CAPTION = (
    "Speeds with 95 % intervals, against command in mid travel and over the travel. Grey: commands beyond "
    "the logs. Ticks: those that they hold."
)


def quantity_section(settings: FitSettings, summary: FitSummary, logs: Sequence[Log]) -> tuple[Section, ...]:
    """Return the section with all quantities and the curves of speed; none where there are none."""
    if not summary.quantities:
        return ()
    names = settings.arm.joint_names
    speeds = {name: curve for name, curve in summary.curves.items() if "_speed" in name}
    plots = (Plot("speed", _CAPTION, partial(draw_speeds, speeds, logs, names)),) if speeds else ()
    return (Section("What is known", tables={"quantities": quantity_table(summary, names)}, plots=plots),)


def quantity_table(summary: FitSummary, joints: Sequence[str]) -> Table:
    """Return the quantities that are determined, each with its 95 % interval; `joints` are all names."""
    rows = tuple(
        (
            *(None if one.joint is None else joints[one.joint - 1], one.label, one.unit),
            *(one.value, *one.interval, 100 * one.within),
        )
        for one in summary.quantities.values()
        if one.within <= 1.0
    )
    note = "from, to: 95 % interval, right only if the model is. docs/quantities.md defines each."
    header = ("joint", "quantity", "unit", "value", "from", "to", "± [%]")
    return Table("Quantities", header, rows, note, ("± [%]",))


def best_known(quantities: Mapping[str, QuantityEstimate]) -> Iterator[str]:
    """Yield a line for each of the best-known quantities, the best first, under a heading; or nothing."""
    best = sorted((q for q in quantities.values() if q.within <= BEST_WITHIN), key=lambda q: q.within)[:6]
    several = len({q.joint for q in quantities.values()}) > 1
    for i, q in enumerate(best):
        if i == 0:
            yield "Best determined, with 95 % intervals:"
        ends = " to ".join(number(end) for end in q.interval if end is not None)
        of = f"joint {q.joint}: " if several else ""
        yield f"  {of}{q.label}: {f'{number(q.value)} {q.unit}'.rstrip()} ({ends})"


def curves_csv(curves: Mapping[str, CurveEstimate]) -> str:
    """Return all curves as CSV, one point per row; an end without limit is empty."""
    header = ("curve", "joint", "quantity", "unit", "along", "at", "value", "from", "to")
    rows = tuple(
        (name, curve.joint, curve.label, curve.unit, curve.along, at, value, *ends)
        for name, curve in curves.items()
        for at, value, ends in zip(curve.at, curve.value, curve.interval, strict=True)
    )
    return Table("", header, rows).csv()


def draw_speeds(curves: Mapping[str, CurveEstimate], logs: Sequence[Log], joints: Sequence[str]) -> Chart:
    """Draw each joint's speed against command with its band and, in stage 2, at 50 % over its travel."""
    panels: list[Panel] = []
    for name, curve in curves.items():
        at, value, ends = np.array(curve.at), np.array(curve.value), np.array(curve.interval, dtype=float)
        whole, marks = [np.ones(len(at), dtype=bool)], list[Mark]()
        if name.endswith("_speed"):  # over commands: its two directions, with the dead band between them
            whole, commands = [at > 0, at < 0], [log.command[:, curve.joint - 1] for log in logs]
            marks = _logged(np.concatenate(commands), logs[0].period)
        for part, color in zip(whole, ("blue", "orange"), strict=False):
            low, high = ends[part].T
            marks += [
                Mark("band", at[part], low, high, color=color, alpha=0.25),
                Mark("line", at[part], value[part], color=color),
                Mark("points", at[part], value[part], color=color, width=5),
            ]
        title = f"{joints[curve.joint - 1]}: {curve.label}"
        panels.append(Panel(curve.along, f"speed [{curve.unit}]", tuple(marks), title, 250))
    return Chart(tuple(panels), columns=len(panels) // len({curve.joint for curve in curves.values()}))


def _logged(commands: Array, period: float) -> list[Mark]:
    """Shade what lies beyond the logs' commands, and tick those that are held for 0.2 s."""
    levels, counts = np.unique(commands[commands != 0], return_counts=True)
    if not levels.size:
        return []
    low, high = min(levels[0], 0.0), max(levels[-1], 0.0)
    beyond = Mark("spans", np.array([-105.0, high]), end=np.array([low, 105.0]), color="pale", alpha=0.4)
    held = levels[counts * period >= 0.2]
    return [beyond, Mark("points", held, np.zeros(len(held)), color="grey", width=9, look="dash")]
