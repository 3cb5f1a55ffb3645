"""What the logs determine, in the words of an engineer: cards of quantities, and curves of speed."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from hydroid.estimate import CurveEstimate, FitSummary
from hydroid.log import Log
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Plot, Section
from hydroid.reporting.table import Table
from hydroid.settings.fit import FitSettings

BEST_WITHIN = 0.3
"""half of a 95 % interval, relative to the value, up to which a property counts as known"""


def quantity_section(settings: FitSettings, summary: FitSummary) -> tuple[Section, ...]:
    """Return the section with a card of the best known quantities of each joint; none without any."""
    names, cards = settings.arm.joint_names, dict[str, Table]()
    known = sorted(
        (q for q in summary.quantities.values() if q.within <= BEST_WITHIN), key=lambda q: q.within
    )
    for joint in dict.fromkeys(q.joint for q in summary.quantities.values()):
        rows = tuple(
            (q.label, f"{q.value:.3g} {q.unit} ± {100 * q.within:.2g} %")
            for q in [q for q in known if q.joint == joint][:5]
        )
        name = "machine" if joint is None else names[joint - 1]
        if rows:
            cards[f"known_{name}"] = Table(name, ("quantity", "value"), rows)
    text = "With 95 % intervals, which are right only if the model is. estimate.yaml has all quantities."
    return (Section("What is known", text, cards=cards),) if cards else ()


def speed_section(settings: FitSettings, summary: FitSummary, logs: Sequence[Log]) -> tuple[Section, ...]:
    """Return the section with the curves of speed; none where there are none."""
    speeds = {name: curve for name, curve in summary.curves.items() if "_speed" in name}
    text = (
        "Speeds with 95 % intervals, against command in mid travel and over the travel. Grey: commands "
        "beyond the logs."
    )
    plot = Plot("speed", text, partial(draw_speeds, speeds, logs, settings.arm.joint_names))
    return (Section("Speeds", plots=(plot,), folded=True),) if speeds else ()


def draw_speeds(curves: Mapping[str, CurveEstimate], logs: Sequence[Log], joints: Sequence[str]) -> Chart:
    """Draw each joint's speed against command with its band and, in stage 2, at 50 % over its travel."""
    panels: list[Panel] = []
    for name, curve in curves.items():
        at, value, ends = np.array(curve.at), np.array(curve.value), np.array(curve.interval, dtype=float)
        whole, marks = [np.ones(len(at), dtype=bool)], list[Mark]()
        if name.endswith("_speed"):  # over commands: its two directions, with the dead band between them
            commands = np.concatenate([log.command[:, curve.joint - 1] for log in logs])
            whole, logged = [at > 0, at < 0], (commands.min(initial=0.0), commands.max(initial=0.0))
            beyond = np.array([[-105.0, logged[1]], [logged[0], 105.0]])
            marks = [Mark("spans", beyond[0], end=beyond[1], color="pale", alpha=0.4)]
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
