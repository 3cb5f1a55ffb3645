"""The report of a designed experiment: commands, predicted motion and predicted precision."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from hydroid.advice.design import Design
from hydroid.findings import Finding
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Light, Page, Plot, Section, Verdict
from hydroid.reporting.table import Cell, Table
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings

_RUN, _FIT = (Finding(kind, "note") for kind in ("run the experiment", "fit it too"))


def design_page(arm: Arm, settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Page:
    """Return the page of a designed experiment at parameters by name; its table is `design`."""
    margin = np.radians(settings.margin_deg)
    limits = np.column_stack([arm.lower + margin, arm.upper - margin])
    known, percent = int(np.sum(design.after.deviations <= WEAK_ABOVE)), f"{100 * WEAK_ABOVE:.0f} %"
    lead = (
        f"The designed experiment determines {known} of {len(design.names)} parameters to {percent}; the "
        f"weakest combination to {100 * design.weakest(design.after)[0]:.2g} %."
    )
    tried = f"It is the best of {len(design.random)} random experiments and their variations, in simulation."
    collisions = Light("Collisions", "open", "They were not checked: design.clearance_m is null.")
    if settings.clearance_m is not None:
        near = (
            f"None within {settings.clearance_m:g} m of the model's shapes, which have no hoses and nothing "
        )
        collisions = Light("Collisions", "fair", f"{near}around the machine.")
    lights = Light("Range, speed and command", "fair", "Within their limits, in simulation only."), collisions
    moving = "Commands and the motion that the present estimate predicts."
    motion = Plot("motion", moving, partial(motion_chart, design.best.log, arm.joint_names, limits), True)
    sections = (
        Section("Do next", steps=(_RUN, _FIT)),
        Section("Motion", plots=(motion,)),
        Section("Precision", tables={"design": design_table(settings, design, theta)}),
    )
    return Page("design", "The next experiment", lead, sections, verdict=Verdict(lead, tried, lights))


def design_table(settings: DesignSettings, design: Design, theta: Mapping[str, float]) -> Table:
    """Return the predicted precision of each parameter before, after a random and the designed experiment."""

    def row(name: str, deviations: Array) -> dict[str, Cell]:
        before, random, designed = map(float, deviations)
        flag = flag_of(designed)
        return {
            "name": name,
            "estimate": theta[name],
            "before [%]": 100 * before,
            "random [%]": 100 * random,
            "designed [%]": 100 * designed,
            "random / designed": random / designed,
            "flag": "" if flag is Flag.IDENTIFIABLE else flag.value,
        }

    _, direction = design.weakest(design.after)
    shares = direction / direction[np.argmax(np.abs(direction))]
    order = [i for i in np.argsort(-np.abs(shares)) if abs(shares[i]) >= 0.15]
    parts = " ".join(f"{shares[i]:+.2f} {design.names[i]}" for i in order).replace("-", "−")
    time = settings.noise_correlation_s
    noise = f"{settings.noise_deg:g} deg, {f'correlation time {time:g} s' if time else 'white'}"
    note = (
        f"Noise: {noise}. before: every parameter ±100 % unless logs say more. random: median of "
        f"{len(design.random)} experiments of the same length and limits. "
        f"The weakest combination: {parts}. {_RUN.hint}"
    )
    deviations = np.column_stack([design.known.deviations, design.random_deviations, design.after.deviations])
    rows = map(row, design.names, deviations)
    title = "Predicted relative standard deviations"
    return Table.of(title, rows, note, ("random / designed", "estimate"))


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
        panels.append(Panel("", "angle [deg]", marks, names[joint], 190, y_limits=across))
        command = Mark("step", log.time, log.command[:, joint], color="grey", label="command")
        panels.append(Panel("time [s]", "command [%]", (command,), height=120, y_limits=(-108.0, 108.0)))
    return Chart(tuple(panels), linked=True)
