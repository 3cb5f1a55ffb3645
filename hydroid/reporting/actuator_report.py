"""What each joint's valve and actuator do, beside what was measured: speeds, openings,
answers to a step.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import CurveEstimate, FitSummary, QuantityEstimate
from hydroid.log import Log
from hydroid.log.command_sizes import ONE_SIZE, largest_commands, smallest_commands
from hydroid.posterior.curves import LEAST_START, TIME_CONSTANTS
from hydroid.reporting.actuator_tables import (
    NEAR,
    RESPONSE_HEADER,
    SETTLED,
    TURNED,
    Crossing,
    far_commands,
    phase_crossing,
    response_rows,
    speed_table,
)
from hydroid.reporting.chart import Chart, Color, Mark, Panel
from hydroid.reporting.page import Cell, Plot, Section, Table
from hydroid.reporting.parameters_report import SIDES, direction_word
from hydroid.reporting.stated_values import in_heading, value_and_origin, value_of
from hydroid.settings.fit import FitSettings
from hydroid.words import listed, two_digits, value_and_interval

OVER = 0.25
"""time over which a speed is measured [s]; for as long before it the command must have
stood still"""
STILL = 20.0
"""by how much a command that stands still may change [%]: a joystick never rests"""
STEADY = 0.2
"""part of a steady speed by which those in both halves of OVER may differ"""
SLOW = 0.05
"""part of the fastest speed below which a speed may differ as one of this size"""
AT_END = 0.02
"""part of a joint's travel in the logs within which it may stand at a stop"""


class Commands(NamedTuple):
    """What commands the logs give a joint [%]: the largest of both signs, and the
    smallest, 0 of a sign without."""

    negative: float
    positive: float
    least_negative: float
    least_positive: float


class DeadBand(NamedTuple):
    """The dead band of a direction [%], whether the fit estimates it, and how a heading
    states it."""

    value: float
    estimated: bool
    words: str


Words = Mapping[str, str]
"""what commands of a direction do with a joint, by the direction"""
TOWARDS: dict[str, Color] = {"positive": "blue", "negative": "orange"}
"""endings of curves, as `posterior.quantities` names directions, and their colours"""

_SPEED = (
    "Dead band: up to this command the valve stays shut; at 0 % the smallest command opens it. "
    "Fixed: not estimated by the fit. Extrapolated: the logs have no command so small. "
    "Lines: the model's steady speed of the joint alone at mid travel, with the sign of the angle, "
    "and the opening of the valve. Bands: where these lines lie, to 95 %. Points: speeds in the "
    "logs against the command one dead time earlier. They may lie outside the bands, as may the "
    "speeds in Range of validity: the logs have other poses and loads, and joints that share the "
    "pump. Grey: commands that the logs do not contain."
)
_PUMP = (
    " The pump limits the speed, too: it gives at most {pump}. Where the load pulls the joint "
    "faster than the pump fills its chamber, the valve alone limits it."
)
_NO_PUMP = " The model's pump has no limit: speeds are those of the valve."
_SPEED_ALONE = (
    "Lines: the model's steady speed at mid travel, with the sign of the angle. Bands: 95 % "
    "intervals. Points: measured speeds, in any pose and under any load. Grey: "
    "commands that the logs do not contain."
)
_STEP = (
    "How fast and how late the joint follows its command, from rest at mid travel: its speed "
    "after a step, above 0 in the direction of the command, and the frequency response "
    "computed from it. Its amplitude is the speed over the whole command of the step, dead band "
    "included: small changes beyond the dead band act more strongly (gain in “All quantities”). "
    "Bands: 95 % intervals. A curve ends where the logs do not determine it. "
    "Frequencies go up to a quarter of the logs' rate, {rate:g} Hz."
)
_NO_SPRING = " This model has no spring of oil: it states no natural frequency."
_TABLE = (
    f" Tables: measured is the median of the measured speeds within {NEAR:g} % of the command. A "
    f"speed is measured over {OVER:g} s where it was steady: both halves differ by "
    f"{100 * STEADY:.0f} % at most, and within {2 * OVER:g} s the command changed by {STILL:g} % at most."
)
_RESPONSES = (
    "In brackets: 95 % intervals. Settling time: after it, the speed stays within "
    f"{100 * SETTLED:.0f} % of its value {TIME_CONSTANTS:g} time constants after the dead time (or "
    f"{LEAST_START:g} s after the step, if that is later). Over: by then it has not settled. Phase: "
    "of the speed against the command; over: it stays above up to this frequency."
)
_DELAYS = (
    " Dead time: from the command until the speed has reached a tenth. The transport delay in "
    "Parameters is its first part, in which nothing moves. The rest is the lag of valve and arm."
)


def speed_section(
    settings: FitSettings, summary: FitSummary, logs: Sequence[Log]
) -> Section | None:
    """Return the section of speed and valve opening against command, a tab per joint.

    None: no curves.
    """
    tabs = list[Plot]()
    fastest = list[str]()
    shut = list[str]()
    below = list[float]()
    cards = dict[str, Table]()
    for joint in settings.outputs:
        name = settings.arm.name_of(joint)
        speed = summary.curves.get(f"{name}_speed")
        if speed is None:
            continue
        opening = summary.curves.get(f"{name}_opening")
        cloud = _measured_cloud(logs, joint, _dead_times(name, summary))
        cloud[1] *= settings.arm.joint(joint).shown.factor
        commands = _logged_commands(logs, joint)
        sides = _sides(name, summary)
        draw = partial(_speed_chart, name, (speed, opening), sides, commands, cloud)
        caption = f"{name}: {speed.label}"
        tabs.append(Plot(f"speed_{len(tabs) + 1}", caption, draw, button=name))
        words = {to: direction_word(summary, name, to) for to in TOWARDS}
        fastest.append(_fastest(name, speed, commands, words))
        if opening is not None:
            bands = _dead_bands(settings, summary, joint)
            shut.append(f"{name} {_bands_in_words(bands)}")
            below += _extrapolated(bands, commands)
        table = speed_table(name, speed, opening, cloud)
        note = _beyond(speed, commands) + _pulled(settings, summary, joint, speed)
        note += _far_from_measured(speed, cloud)
        cards[f"speed_{name}"] = replace(table, note=note)
    if not tabs:
        return None
    title = "Speed against command"
    text = _SPEED_ALONE
    fastest = [*filter(None, fastest)]
    answer = f"the model's speed at the logs' largest commands: {'; '.join(fastest)}"
    if shut:
        title = "Valve: dead band and speed"
        text = _SPEED + _pump_words(settings, summary)
        answer = f"dead band [%]: {', '.join(shut)}"
        if below:
            answer += f"; extrapolated below {_span(below)}"
    text += _TABLE
    return Section(
        title, text, tabs=tuple(tabs), cards=cards, folded=True, answer=answer
    )


def _pump_words(settings: FitSettings, summary: FitSummary) -> str:
    """Say whether the pump limits the speeds of a joint that moves alone."""
    if value_of(settings, summary, "pump_flow")[0] is None:
        return _NO_PUMP
    return _PUMP.format(pump=value_and_origin(settings, summary, "pump_flow"))


def _pulled(
    settings: FitSettings, summary: FitSummary, joint: int, speed: CurveEstimate
) -> str:
    """Say from which commands on a joint takes more oil than the pump gives; nothing
    where it never does.

    A load that pulls the joint does not wait until its chamber is full.
    """
    name = settings.arm.name_of(joint)
    pump = value_of(settings, summary, "pump_flow")[0]
    said = list[str]()
    for side, towards in SIDES.items():
        flow = summary.quantities.get(f"{name}_full_flow_{towards}")
        draw = value_of(settings, summary, f"draw_{side.lower()}", joint)[0]
        if pump is None or flow is None or draw is None:
            continue
        rows = _of_sign(speed, towards)
        wanted = (
            draw * flow.value * np.abs(rows[1] / rows[1, np.argmax(np.abs(rows[0]))])
        )
        beyond = rows[0, wanted > pump]
        if len(beyond):
            said.append(f"{_signed(beyond[np.argmin(np.abs(beyond))])} %")
    if not said:
        return ""
    return (
        f" From {listed(said)} on, the load pulls the joint: its chamber grows faster than the pump "
        "can fill it."
    )


def _of_sign(curve: CurveEstimate, towards: str) -> Array:
    """Return the rows of a curve at commands of a sign, as `_rows` has them."""
    rows = _rows(curve)
    sign = 1.0 if towards == "positive" else -1.0
    return rows[:, sign * rows[0] > 0]


def _dead_bands(
    settings: FitSettings, summary: FitSummary, joint: int
) -> tuple[DeadBand, DeadBand]:
    """Return the dead bands of a joint for positive and for negative commands."""
    positive, negative = (_dead_band(settings, summary, joint, side) for side in SIDES)
    return positive, negative


def _dead_band(
    settings: FitSettings, summary: FitSummary, joint: int, side: str
) -> DeadBand:
    """Return the dead band of a side of a joint."""
    # the spool's overlap included
    whole = f"{settings.arm.name_of(joint)}_dead_band_{SIDES[side]}"
    if stated := summary.quantities.get(whole):
        return DeadBand(stated.value, True, in_heading(summary, stated))
    quantity = f"dead_band_{side.lower()}"
    value, estimate = value_of(settings, summary, quantity, joint)
    if estimate is None:
        return DeadBand(value or 0.0, False, two_digits(value or 0.0))
    return DeadBand(estimate.value, True, in_heading(summary, estimate))


def _bands_in_words(bands: tuple[DeadBand, DeadBand]) -> str:
    """Write the dead bands of a joint for positive and for negative commands."""
    positive, negative = bands
    words = f"+{positive.words} and -{negative.words}"
    if positive.words == negative.words:
        words = positive.words
    is_fixed = not (positive.estimated or negative.estimated)
    return f"{words} (fixed)" if is_fixed else words


def _extrapolated(bands: tuple[DeadBand, DeadBand], commands: Commands) -> list[float]:
    """Return the smallest commands of the logs in the directions in which the fit places
    the dead band below them [%]."""
    sizes = (commands.least_positive, -commands.least_negative)
    return [
        size
        for band, size in zip(bands, sizes, strict=True)
        if band.estimated and band.value < size
    ]


def _span(sizes: Sequence[float]) -> str:
    """Write from where to where some sizes go."""
    low, high = f"{min(sizes):.0f}", f"{max(sizes):.0f}"
    return low if low == high else f"{low} to {high}"


def _far_from_measured(speed: CurveEstimate, measured: Array) -> str:
    """Say where the measured medians are far from the model's speed; nothing where they
    are near everywhere."""
    far = [f"{_signed(command)}" for command in far_commands(speed, measured)]
    if not far:
        return ""
    return f" The measured median is far from the model's speed at {listed(far)} %."


def _fastest(name: str, speed: CurveEstimate, commands: Commands, words: Words) -> str:
    """Write the speeds of a joint at the largest commands of the logs, in both
    directions."""
    said = list[str]()
    for towards, largest in (
        ("positive", commands.positive),
        ("negative", commands.negative),
    ):
        if largest:
            # value and ends of the interval there, NaN of one without
            rows = _rows(speed)
            top, *ends = (float(np.interp(largest, rows[0], row)) for row in rows[1:])
            low, high = sorted(map(abs, ends))
            word = words[towards] or towards
            # its unit stands once for a joint
            size = two_digits(abs(top))
            if np.isfinite(ends).all():
                size = value_and_interval(abs(top), low, high)
            size += "" if said else f" {speed.unit}"
            said.append(f"{word} {size} at {largest:+.0f} %")
    return f"{name} {', '.join(said)}" if said else ""


def _logged_commands(logs: Sequence[Log], joint: int) -> Commands:
    smallest = smallest_commands(logs, joint)
    return Commands(
        *largest_commands(logs, joint),
        least_negative=0.0 - smallest.get(-1.0, 0.0),
        least_positive=smallest.get(1.0, 0.0),
    )


def _beyond(speed: CurveEstimate, commands: Commands) -> str:
    """Say where a curve goes beyond the commands of the logs; nothing where it does
    not."""
    above = speed.at[-1] > commands.positive + ONE_SIZE
    below = speed.at[0] < commands.negative - ONE_SIZE
    said = list[str]()
    if above or below:
        said.append(
            f"beyond {_signed(commands.negative)} and {_signed(commands.positive)} %"
        )
    if commands.least_positive - commands.least_negative > 2 * ONE_SIZE:
        inner = f"{_signed(commands.least_negative)} and {_signed(commands.least_positive)} %"
        said.append(f"between {inner}")
    if not said:
        return ""
    return (
        f"The logs have no commands {', nor '.join(said)}: there all is extrapolated."
    )


def _signed(command: float) -> str:
    return f"{command:+.0f}".replace("+0", "0")


def _sides(name: str, summary: FitSummary) -> dict[str, str]:
    """Return what a legend calls the commands of both signs."""
    sides = dict[str, str]()
    for side, towards in SIDES.items():
        word = direction_word(summary, name, towards)
        sides[towards] = f"side {side}: {towards} commands"
        if word:
            sides[towards] += f", {word}"
    return sides


def _measured_cloud(
    logs: Sequence[Log], joint: int, dead_times: Sequence[QuantityEstimate]
) -> Array:
    """Return commands [%] and measured speeds [rad/s] of a joint in all logs, shape
    (2, n)."""
    delay = float(np.mean([time.value for time in dead_times])) if dead_times else 0.0
    pairs = [np.empty((2, 0))]
    for log in logs:
        if log.measures(joint):
            pairs.append(np.array(measured_speeds(log, joint, delay)))
    return np.hstack(pairs)


def step_section(settings: FitSettings, summary: FitSummary) -> Section | None:
    """Return the section of step and frequency responses, a tab per joint.

    None: the fit states none.
    """
    names = [
        settings.arm.name_of(joint)
        for joint in settings.outputs
        if _steps(settings.arm.name_of(joint), summary)
    ]
    if not names:
        return None
    tabs = list[Plot]()
    rows = list[tuple[Cell, ...]]()
    for name in names:
        draw = partial(_response_chart, name, summary.curves)
        caption = f"{name}: step and frequency response"
        tabs.append(Plot(f"step_{len(tabs) + 1}", caption, draw, button=name))
        for towards in _steps(name, summary):
            rows.append(response_rows(name, towards, summary))
    title = "Step and frequency response"
    text = _STEP.format(rate=1.0 / settings.log.period_s)
    # the oil of the dynamic model is a spring by itself
    rings = value_of(settings, summary, "oil_frequency")[0] is not None
    if settings.rung.has("oil_frequency") and not rings:
        text += _NO_SPRING
    note = _RESPONSES
    if any(_has_delay(settings, summary, joint) for joint in settings.outputs):
        note += _DELAYS
    tables = {"responses": Table("", RESPONSE_HEADER, tuple(rows), note)}
    return Section(
        title,
        text,
        tabs=tuple(tabs),
        tables=tables,
        folded=True,
        answer=_slower(names, summary),
    )


def _has_delay(settings: FitSettings, summary: FitSummary, joint: int) -> bool:
    """Return whether a joint's commands have a transport delay."""
    sides = ("delay_a", "delay_b")
    return any(value_of(settings, summary, side, joint)[0] for side in sides)


def _steps(name: str, summary: FitSummary) -> list[str]:
    """Return the directions in which a fit states the step response of a joint."""
    return [one for one in TOWARDS if f"{name}_step_{one}" in summary.curves]


def _slower(names: Sequence[str], summary: FitSummary) -> str:
    """Say how late joints are in their slower directions, and at which frequency the first
    of them lags by a quarter; nothing where the fit does not state it."""
    late = list[str]()
    turned = dict[str, Crossing]()
    for name in names:
        if dead_times := _dead_times(name, summary):
            latest = max(dead_times, key=lambda time: time.value)
            late.append(f"{name} {in_heading(summary, latest)}")
        phases = _towards(name, "phase", summary.curves).values()
        if crossings := [*filter(None, map(phase_crossing, phases))]:
            turned[name] = min(crossings, key=_frequency)
    answers = list[str]()
    if late:
        answers.append(f"dead time [s]: {', '.join(late)}")
    if turned:
        first = min(turned, key=lambda name: turned[name].frequency)
        answers.append(f"lag {-TURNED:g}° at {turned[first].short} Hz ({first})")
    return "; ".join(answers)


def _frequency(crossing: Crossing) -> float:
    return crossing.frequency


def measured_speeds(log: Log, joint: int, delay: float) -> tuple[Array, Array]:
    """Return commands [%] and speeds [rad/s] of a joint, from 1, where its command
    stood still and its speed was steady, (n,) each.

    The command is that of `delay` [s] before. Stretches of OVER do not overlap; those
    without a command, and those near an end of the travel, are left out.
    """
    command = log.command_of(joint)
    angle = log.angle_of(joint)
    half = max(round(0.5 * OVER / log.period), 1)
    steps = round(delay / log.period)
    low = np.min(angle)
    high = np.max(angle)
    margin = AT_END * (high - low)
    # of a joint that stands still, the sensor's noise is no speed
    ways = angle[2 * half :] - angle[: -2 * half]
    least = SLOW * float(np.max(np.abs(ways), initial=0.0))
    commands = list[float]()
    speeds = list[float]()
    for middle in range(steps + 3 * half, len(angle) - half, 2 * half):
        held = command[middle - steps - 3 * half : middle - steps + half]
        free = low + margin < angle[middle] < high - margin
        if not free or np.ptp(held) > STILL or not np.any(held):
            continue
        before = angle[middle] - angle[middle - half]
        after = angle[middle + half] - angle[middle]
        way = before + after
        if abs(after - before) > 0.5 * STEADY * max(abs(way), least):
            continue
        commands.append(float(held[2 * half :].mean()))
        speeds.append(float(way / (2 * half * log.period)))
    return np.array(commands), np.array(speeds)


def _dead_times(name: str, summary: FitSummary) -> list[QuantityEstimate]:
    """Return the dead times of a joint in both directions [s], as far as the fit states
    them."""
    both = (summary.quantities.get(f"{name}_dead_time_{to}") for to in TOWARDS)
    return [time for time in both if time is not None]


def _speed_chart(
    name: str,
    curves: tuple[CurveEstimate, CurveEstimate | None],
    sides: Mapping[str, str],
    commands: Commands,
    measured: Array,
) -> Chart:
    """Draw speed and opening of a joint over its logged commands, and measured pairs of
    command and speed, shape (2, n), in the curves' units."""
    speed, opening = curves
    left = np.array([-105.0, commands.least_negative, commands.positive])
    right = np.array([commands.negative, commands.least_positive, 105.0])
    beyond = Mark("spans", left, end=right, color="pale", alpha=0.4)
    cloud = Mark(
        "points",
        *measured,
        color="ink",
        label="measured",
        width=5,
        alpha=0.35,
    )
    marks = (beyond, *_both_sides(speed, sides), cloud)
    panels = [Panel("", f"speed [{speed.unit}]", marks, f"{name}: {speed.label}", 300)]
    if opening is not None:
        label = f"opening [{opening.unit}]"
        panels.append(
            Panel("", label, (beyond, *_both_sides(opening, sides)), opening.label, 200)
        )
    panels[-1] = replace(panels[-1], x="command [%]")
    return Chart(tuple(panels), linked=True)


def _both_sides(curve: CurveEstimate, sides: Mapping[str, str]) -> list[Mark]:
    """Draw a curve against the command, with the dead band between its two sides."""
    marks = list[Mark]()
    for towards, color in TOWARDS.items():
        marks += _banded(_of_sign(curve, towards), color, f"model, {sides[towards]}")
    return marks


def _banded(rows: Array, color: Color, label: str) -> tuple[Mark, Mark]:
    """Draw the interval of a curve and the curve, from rows as `_rows` gives them."""
    x, value, low, high = rows
    band = Mark("band", x, low, high, color=color, label=label, alpha=0.25)
    return band, Mark("line", x, value, color=color, label=label)


def _response_chart(name: str, curves: Mapping[str, CurveEstimate]) -> Chart:
    """Draw what the curves say of one joint in both directions."""
    step = _response_panel("speed", _towards(name, "step", curves))
    amplitude = _response_panel("amplitude", _towards(name, "amplitude", curves))
    phase = _response_panel("phase", _towards(name, "phase", curves))
    return Chart(
        (
            replace(step, title=f"{name}: step of the command", height=250),
            replace(amplitude, title="frequency response", log_x=True, log_y=True),
            replace(phase, log_x=True),
        )
    )


def _towards(
    name: str, kind: str, curves: Mapping[str, CurveEstimate]
) -> dict[str, CurveEstimate]:
    """Return the curves of a kind by the direction of the command."""
    keys = {towards: f"{name}_{kind}_{towards}" for towards in TOWARDS}
    return {towards: curves[key] for towards, key in keys.items() if key in curves}


def _response_panel(y: str, curves: Mapping[str, CurveEstimate]) -> Panel:
    """Draw curves of a kind, by the direction of the command, with their bands."""
    marks = list[Mark]()
    along = ""
    unit = ""
    for towards, curve in curves.items():
        label = _answered(curve, towards)
        marks += _banded(_determined(_rows(curve)), TOWARDS[towards], label)
        along = curve.along
        unit = curve.unit
    return Panel(along, f"{y} [{unit}]", tuple(marks), height=200)


def _determined(rows: Array) -> Array:
    """Return rows as `_rows` has them, NaN where a curve has no interval, though it has
    elsewhere: a line without its band would look as if it were known exactly."""
    is_open = np.isnan(rows[2:]).any(axis=0)
    if is_open.all():
        return rows
    rows[1:, is_open] = np.nan
    return rows


def _answered(curve: CurveEstimate, towards: str) -> str:
    """Write the command that a curve answers, and what it does with the joint."""
    direction = curve.moves or f"{towards} commands"
    if curve.step is None:
        return direction
    return f"{abs(curve.step):g} % command, {curve.moves or towards}"


def _rows(curve: CurveEstimate) -> Array:
    """Return places, values, and both ends of the intervals, NaN where there is no
    limit, shape (4, n).
    """
    ends = np.array(curve.interval, dtype=float)
    return np.array([curve.at, curve.value, ends[:, 0], ends[:, 1]], dtype=float)
