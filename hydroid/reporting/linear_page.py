"""The page of a linear model: how each joint's speed answers to its command, with what
the logs leave open."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Page, Plot, Section, Table
from hydroid.settings.arm import Arm
from hydroid.use.linear import LinearArm
from hydroid.words import listed, two_digits

SECONDS = 2.0  # of a step response
SAMPLES = 400  # of a curve
LOWEST = 0.05  # frequency [Hz]
HIGHEST = 20.0  # frequency [Hz]
INSIDE = (2.5, 97.5)  # percentiles of the band

_TEXT = (
    "The speed of each joint after its command has risen by 1 %, and how it follows a command that "
    "swings, in amplitude and phase (Bode); the delay is in both."
)


def linear_page(linear: LinearArm, drawn: Sequence[LinearArm], arm: Arm) -> Page:
    """Return the page of a linear model; `drawn` are those of other machines that the
    logs allow, about the same commands. It has the name `linear`."""
    tabs = list[Plot]()
    for k, name in enumerate(linear.joints):
        draw = partial(_chart, linear, drawn, k, arm)
        caption = f"{name}: step response and Bode plot"
        tabs.append(Plot(f"linear_{k + 1}", caption, draw, button=name))
    band = ""
    if drawn:
        band = f" Bands: 95 % of {len(drawn)} machines that agree with the logs."
    section = Section("Step response and Bode plot", _TEXT + band, tabs=tuple(tabs))
    table = _about(linear, arm)
    near = Section(table.title, tables={"about": table})
    commands = [
        f"{name} {two_digits(command)} %"
        for name, command in zip(linear.joints, linear.command.tolist(), strict=True)
    ]
    lead = f"{arm.name} as a linear system, near the commands {listed(commands)}."
    return Page("linear", "Linear model", lead, (section, near), ())


def _about(linear: LinearArm, arm: Arm) -> Table:
    """Return the commands and the motion about which it is linear."""
    rows = list[tuple[str | float, ...]]()
    for k, name in enumerate(linear.joints):
        shown = arm.joints[arm.joint_names.index(name)].shown
        command = float(linear.command[k])
        angle = float(shown.factor * linear.angle[k])
        speed = float(shown.factor * linear.speed[k])
        delay = float(linear.delay[k])
        rows.append((name, shown.unit, command, angle, speed, delay))
    header = ("joint", "unit", "command [%]", "angle", "speed [per s]", "delay [s]")
    return Table("About which it is linear", header, tuple(rows))


def _chart(linear: LinearArm, drawn: Sequence[LinearArm], k: int, arm: Arm) -> Chart:
    """Draw the answer of the k-th joint's speed to its command."""
    shown = arm.joints[arm.joint_names.index(linear.joints[k])].shown
    per = f"{shown.unit}/s per %"
    time = np.linspace(0.0, SECONDS, SAMPLES)
    frequency = np.geomspace(LOWEST, HIGHEST, SAMPLES)
    answers = [one.step(k, time) for one in (linear, *drawn)]
    steps = shown.factor * np.array(answers)
    swings = np.array([one.response(k, frequency) for one in (linear, *drawn)])
    amplitudes = shown.factor * np.abs(swings)
    phases = np.degrees(np.unwrap(np.angle(swings)))
    # a positive command may lower the angle: the phase then begins at 180
    phases -= 360.0 * np.round(phases[:, :1] / 360.0)
    panels = (
        Panel("time [s]", f"speed [{per}]", _marks(time, steps), "Step response", 250),
        Panel(
            "",
            f"amplitude [{per}]",
            _marks(frequency, amplitudes),
            "Bode plot",
            height=200,
            log_x=True,
            log_y=True,
        ),
        Panel(
            "frequency [Hz]",
            "phase [deg]",
            _marks(frequency, phases),
            height=200,
            log_x=True,
        ),
    )
    return Chart(panels)


def _marks(x: Array, curves: Array) -> tuple[Mark, ...]:
    """Draw the first of some curves, (n, F), and the band of the others."""
    line = Mark("line", x, curves[0], label="estimate")
    if len(curves) < 2:
        return (line,)
    low, high = np.percentile(curves[1:], INSIDE, axis=0)
    return Mark("band", x, low, high, label="95 % band", alpha=0.25), line
