"""The report of a designed experiment: commands, predicted motion and predicted precision."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.experiment.design import Design
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report import style
from hydroid.report.page import Page, Plot, Section
from hydroid.report.table import Cell, Table, number
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.uncertainty.flags import WEAK_ABOVE, Flag, flag_of

_DASHED = (0, (5, 3))
_SHOWN = 0.15
"""parts of the weakest direction below this share of the largest are not named"""
_LIMITS = (
    "The limits were checked only in simulation, at the present estimate. The machine moves differently as "
    "far as it differs from the model."
)
_COLLISIONS = (
    "Collisions were checked with the shapes of the model, which knows no hoses, no cylinders and nothing "
    "that stands around the machine."
)


def safety(settings: DesignSettings) -> str:
    """Return what the limits are worth."""
    unchecked = "Collisions were not checked: design.clearance_m is null."
    collisions = unchecked if settings.clearance_m is None else _COLLISIONS
    return f"{_LIMITS} {collisions} Watch the first run with a hand on the emergency stop."


def design_page(arm: Arm, settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Page:
    """Return the page of a designed experiment at parameters by name; its table is `design`."""
    table = design_table(settings, design, theta)
    margin = np.radians(settings.margin_deg)
    limits = np.column_stack([arm.lower + margin, arm.upper - margin])
    moving = "Commands and the motion that the present estimate predicts."
    precise = "Predicted relative standard deviations, from ±100 % without any log."
    section = Section(
        "Prediction",
        points=(safety(settings),),
        tables={"design": table},
        plots=(
            Plot("motion", moving, partial(motion, design.predicted, arm.joint_names, limits)),
            Plot("precision", precise, partial(precision, design)),
        ),
    )
    lead = f"The best of {len(design.random)} random experiments and their variations, in simulation."
    return Page("design", "The next experiment", lead, (section,))


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
    information = design.best.information
    before, _ = design.precision.weakest()
    weakest, direction = design.precision.weakest(information)
    order = [
        i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= _SHOWN * np.abs(direction).max()
    ]
    sign = np.sign(direction[order[0]])
    parts = " ".join(f"{sign * direction[i]:+.2f} {design.names[i]}" for i in order).replace("-", "−")
    total, some = len(design.names), design.precision.directions.shape[1]
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
    known = design.precision
    return known.deviations(), design.random_deviations, known.deviations(design.best.information)


def motion(log: Log, names: tuple[str, ...], limits: Array) -> Figure:
    """Draw commands and predicted angles of the joints that move.

    `limits` are the lowest and highest angle allowed [rad], shape (J, 2); infinite where there is none.
    """
    joints: list[int] = np.flatnonzero(log.driven | (np.ptp(log.angle, axis=0) > 0)).tolist()
    drawing = style.figure(1.0 + 1.5 * len(joints), 7.4, right=0.75)
    panels = np.atleast_1d(drawing.subplots(len(joints), 1, sharex=True, gridspec_kw={"hspace": 0.35}))
    for axes, joint in zip(panels, joints, strict=True):
        _joint(axes, log, joint, limits[joint])
        axes.set_title(f"Joint {joint + 1}, {names[joint]}", fontsize=10)
    panels[-1].set_xlabel("time [s]")
    style.legend_below(drawing, panels[0])
    return drawing


def _joint(axes: Axes, log: Log, joint: int, limits: Array) -> None:
    angle = np.degrees(log.angle[:, joint])
    right = axes.twinx()
    command = style.decimated(log.time, log.command[:, joint])
    right.step(*command, where="post", color=style.GREY, linewidth=1.0)
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
    dashed: dict[str, Any] = {"color": style.MEASURED, "linewidth": 1.0, "linestyle": _DASHED}
    for limit in np.degrees(limits):
        axes.axhline(limit, **dashed)
    axes.plot((), (), label="limit (range less margin)", **dashed)
    axes.set_ylabel("angle [deg]", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.margins(x=0)


def precision(design: Design) -> Figure:
    """Draw standard deviations before, after a random (the median) and after the designed experiment."""
    names = design.names
    before, random, designed = _deviations(design)
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
    style.logarithmic(axes.xaxis)
    axes.set_yticks(at, names)
    axes.set_xlabel("predicted relative standard deviation [%]")
    axes.set_title("Predicted precision of each parameter")
    style.legend_below(drawing, axes, columns=2)
    return drawing
