"""The report of a designed experiment: commands, predicted motion and predicted precision."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from hydroid.advice.design import Design
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Light, Page, Plot, Section, Step, Verdict
from hydroid.reporting.table import Cell, Table
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.words import number

_SHOWN = 0.15
"""parts of the weakest direction below this share of the largest are not named"""
_LIMITS = (
    "The limits were checked only in simulation, at the present estimate. The machine moves differently as "
    "far as it differs from the model."
)
_UNCHECKED = "Collisions were not checked: design.clearance_m is null."
_COLLISIONS = (
    "Collisions were checked with the shapes of the model, which knows no hoses, no cylinders and nothing "
    "that stands around the machine."
)


def safety(settings: DesignSettings) -> str:
    """Return what the limits are worth."""
    collisions = _UNCHECKED if settings.clearance_m is None else _COLLISIONS
    return f"{_LIMITS} {collisions} Watch the first run with a hand on the emergency stop."


def design_page(arm: Arm, settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Page:
    """Return the page of a designed experiment at parameters by name; its table is `design`."""
    margin = np.radians(settings.margin_deg)
    limits = np.column_stack([arm.lower + margin, arm.upper - margin])
    known = int(np.sum(design.after.deviations <= WEAK_ABOVE))
    weakest = f"{100 * design.weakest(design.after)[0]:.2g} %"
    lead = (
        f"The designed experiment determines {known} of {len(design.names)} parameters to "
        f"{100 * WEAK_ABOVE:.0f} %; the weakest combination to {weakest}."
    )
    tried = len(design.random)
    drawn = f"It is the best of {tried} random experiments and their variations, in simulation."
    near = f"None within {settings.clearance_m:g} m, with the model's shapes only."
    lights = (
        Light("Range, speed and command", "fair", "Within their limits, in simulation only."),
        Light("Collisions", "open", _UNCHECKED)
        if settings.clearance_m is None
        else Light("Collisions", "fair", near),
    )
    steps = (
        Step("Run commands.csv on the machine, with a hand on the emergency stop.", safety(settings)),
        Step("Fit again with the new log beside the old ones.", "The table predicts how precise it will be."),
    )
    moving = "Commands and the motion that the present estimate predicts."
    precise = "Predicted relative standard deviations, assuming ±100 % on each parameter before any log."
    motion = Plot("motion", moving, partial(motion_chart, design.predicted, arm.joint_names, limits), True)
    precision = Plot("precision", precise, partial(precision_chart, design))
    sections = (
        Section("Do next", steps=steps),
        Section("Motion", plots=(motion,)),
        Section("Precision", tables={"design": design_table(settings, design, theta)}, plots=(precision,)),
    )
    return Page("design", "The next experiment", lead, sections, verdict=Verdict(lead, drawn, lights))


def design_table(settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Table:
    """Return the predicted precision of each parameter before, after a random and the designed experiment."""
    rows: list[tuple[Cell, ...]] = []
    for name, *deviations in zip(design.names, *_deviations(design), strict=True):
        before, random, designed = map(float, deviations)
        flag = flag_of(designed)
        gain = 100 * before, 100 * random, 100 * designed, random / designed
        rows.append((name, theta[name], *gain, "" if flag is Flag.IDENTIFIABLE else flag.value))
    header = ("name", "estimate", "before [%]", "random [%]", "designed [%]", "random / designed", "flag")
    note, optional = _design_note(settings, design), ("random / designed", "estimate")
    return Table("Predicted relative standard deviations", header, tuple(rows), note, optional)


def _design_note(settings: DesignSettings, design: Design) -> str:
    before, _ = design.weakest(design.known)
    weakest, direction = design.weakest(design.after)
    order = np.argsort(-np.abs(direction))
    shares = direction[order] / direction[order[0]]
    shown = order[np.abs(shares) >= _SHOWN]
    sign = np.sign(direction[order[0]])
    parts = " ".join(f"{sign * direction[i]:+.2f} {design.names[i]}" for i in shown).replace("-", "−")
    total, some = len(design.names), design.directions.shape[1]
    lost = "" if some == total else f" (of the {some} of {total} that random experiments depend on)"
    time = settings.noise_correlation_s
    correlation = f" with a correlation time of {time:g} s" if time else ", white"
    return (
        f"Noise {settings.noise_deg:g} deg{correlation}; before: every parameter ±100 % unless logs say more;"
        f" random: median of {len(design.random)} experiments of the same length and limits. Weakest "
        f"direction{lost}: {number(100 * before)} % before, {number(100 * design.random_weakest)} % random, "
        f"{number(100 * weakest)} % designed; it is {parts}. {safety(settings)}"
    )


def _deviations(design: Design) -> tuple[Array, Array, Array]:
    """Return standard deviations before, after a random and after the designed experiment, each (F,)."""
    return design.known.deviations, design.random_deviations, design.after.deviations


def motion_chart(log: Log, names: tuple[str, ...], limits: Array) -> Chart:
    """Draw commands and predicted angles of the joints that move.

    `limits` are the lowest and highest angle allowed [rad], shape (J, 2); infinite where there is none.
    """
    panels, limit = list[Panel](), "limit (range less margin)"
    for joint in np.flatnonzero(log.driven | (np.ptp(log.angle, axis=0) > 0)).tolist():
        angle, ends = np.degrees(log.angle[:, joint]), np.degrees(limits[joint])
        reach = max(0.15 * float(np.ptp(angle)), 1.0)
        across = float(angle.min()) - reach, float(angle.max()) + reach
        marks = (
            Mark("line", log.time, angle, color="orange", label="predicted angle", width=2),
            Mark("rule", y=ends[np.isfinite(ends)], color="ink", label=limit, width=1, look="dashed"),
        )
        title = f"Joint {joint + 1}, {names[joint]}"
        panels.append(Panel("", "angle [deg]", marks, title, 190, y_limits=across))
        command = Mark("step", log.time, log.command[:, joint], color="grey", label="command")
        panels.append(Panel("time [s]", "command [%]", (command,), height=120, y_limits=(-108.0, 108.0)))
    return Chart(tuple(panels), linked=True)


def precision_chart(design: Design) -> Chart:
    """Draw standard deviations before, after a random (the median) and after the designed experiment."""
    before, random, designed = (100 * values for values in _deviations(design))
    at, limit = np.arange(len(design.names), dtype=float), np.array([100 * WEAK_ABOVE])
    after, identifiable = "after the designed experiment", f"{100 * WEAK_ABOVE:.0f} %: identifiable below"
    marks = (
        Mark("bars", designed, at, random, color="pale", width=4),
        Mark("points", before, at, color="grey", label="before", width=12, look="dash"),
        Mark("points", random, at, label="after a random experiment (median)", width=9),
        Mark("points", designed, at, color="orange", label=after, width=9, look="diamond"),
        Mark("rule", limit, color="ink", label=identifiable, width=1, look="dashed"),
    )
    title, across = "Predicted precision of each parameter", "predicted relative standard deviation [%]"
    height = 90 + 26 * len(at)
    return Chart((Panel(across, "", marks, title, height, log_x=True, names=design.names),))
