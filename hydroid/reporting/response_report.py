"""What models make of logs: each joint's error in each log, its response, and the arm
in motion."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, cycle

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import rms
from hydroid.files import Plain
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import rms_deg
from hydroid.joint_verdict import JointVerdict
from hydroid.reporting.chart import (
    SERIES,
    Chart,
    Mark,
    Panel,
    command_panel,
    finite,
    reference,
    zero_line,
)
from hydroid.reporting.moving_arm import MOST, moving_arm
from hydroid.reporting.page import Plot, Section, Table, log_names, short_name
from hydroid.settings.arm import Arm
from hydroid.units import TURNING, Display
from hydroid.words import number, significant

MOTIONS = 8
"""logs that a page shows in motion"""
SAMPLES = 9000
"""parts of the curves of all responses of a page together: the page stays small"""
MOST_BINS = 1000
"""parts of one response's curves, at most"""
LEAST_BINS = 150
"""parts of one response's curves, at least"""
FAR = 3.0
"""ranges of the measured angle beyond which a response that runs away is not drawn"""
COMMAND_COLORS = ("blue", "green", "pink", "yellow", "sky", "grey")
"""of the joints' commands in one panel"""
BAR = 1e-5
"""what 1 Pa is in bar"""
LITRES_PER_MINUTE = 6e4
"""what 1 m³/s is in L/min"""
CHAMBER_COLORS = ("green", "pink")
"""of chambers A and B"""
ALL = "joints"
"""column of the responses of all joints together"""

_MATRIX = (
    "Rms error of each joint in each log. Green: within the allowed error; amber: up to twice it; "
    "red: worse. Choose one to see its response and the arm in motion."
)
_MOTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where "
    "they differ most. The view from the side turns with the machine."
)
_HELD = " Joints that are not fitted move as measured."
_NOTE = "fit: 100 % is perfect, 0 % as bad as a constant. expected: the rms error that the fit predicts."
_KINDS = {True: "unseen", False: "fitted", None: ""}
_COLUMNS = {
    "fit": "fit",
    "log": "log",
    "kind": "log is",
    "name": "joint",
    "unit": "unit",
    "mae_deg": "mean absolute",
    "rms_deg": "rms",
    "max_deg": "largest",
    "fit_percent": "fit [%]",
    "expected_deg": "expected",
    "inside_percent": "inside band [%]",
}


def response_section(
    predictions: Sequence[Prediction],
    arm: Arm,
    verdicts: Iterable[Sequence[JointVerdict]],
) -> Section:
    """Return each joint's error in each log with the responses behind it, and the arm
    in motion.

    The first prediction of a log is the one that moves. Of each joint the errors are
    shown of the first prediction that compares it; they are coloured by the tolerances
    of the first fit that does.
    """
    by_log = dict[str, list[Prediction]]()
    for prediction in predictions:
        by_log.setdefault(prediction.log.source, []).append(prediction)
    names = log_names(by_log)
    tolerances = dict[int, float]()
    for verdict in chain.from_iterable(verdicts):
        tolerances.setdefault(verdict.joint, verdict.tolerance_deg)
    count = sum(len(_compared(group)) for group in by_log.values())
    bins = min(MOST_BINS, max(LEAST_BINS, SAMPLES // max(count, 1)))
    tabs = list[Plot]()
    moving = dict[str, Prediction]()
    for log, group in by_log.items():
        row = f"{names[log]} {_kind(group[0])}".strip()
        moving[row] = group[0]
        for tab in _log_tabs(arm, group, names[log], bins, tolerances):
            tabs.append(replace(tab, name=f"response_{len(tabs) + 1}", row=row))
    beside = motions(arm, moving)
    title = "Response"
    text = ""
    if len(tabs) > 1:
        title = "Errors by log"
        text = _MATRIX
    note = _motion_note(arm, predictions) if beside else ""
    return Section(title, text, tabs=tuple(tabs), beside=beside, beside_note=note)


def _motion_note(arm: Arm, predictions: Sequence[Prediction]) -> str:
    """Explain the arm in motion."""
    every = len(arm.joints)
    if all(len(prediction.joints) == every for prediction in predictions):
        return _MOTION
    return _MOTION + _HELD


def _log_tabs(
    arm: Arm,
    group: Sequence[Prediction],
    log: str,
    bins: int,
    tolerances: Mapping[int, float],
) -> list[Plot]:
    """Return the tabs of a log: one for each joint that is compared, and one of all of
    them together."""
    tabs = list[Plot]()
    for joint in _compared(group):
        tabs.append(_joint_tab(arm, joint, group, log, bins, tolerances))
    if len(tabs) > 1:
        tabs.append(_all_tab(arm, group, log, bins, tabs))
    return tabs


def error_table(predictions: Sequence[Prediction], arm: Arm, *, one_fit: bool) -> Table:
    """Return all errors of all predictions, one row for each joint of each."""
    sources = dict.fromkeys(prediction.log.source for prediction in predictions)
    names = log_names(sources)
    rows = list[dict[str, object]]()
    for prediction in predictions:
        for row in prediction.plain(arm.joint_names):
            row |= {
                "fit": short_name(prediction.fit),
                "log": names[prediction.log.source],
                "kind": _kind(prediction),
            }
            shown = arm.joints[row["joint"] - 1].shown
            row["unit"] = shown.unit
            for key, error in row.items():
                if "_deg" in key and error is not None:
                    row[key] = shown.of_degrees(error)
            rows.append(row)
    columns = dict(_COLUMNS)
    if one_fit:
        del columns["fit"]
    optional = tuple(
        columns[key] for key in ("mae_deg", "max_deg", "inside_percent", "expected_deg")
    )
    return Table.of("All errors", columns, rows, _NOTE, optional)


def motion_section(
    arm: Arm, predictions: Mapping[str, Prediction], caption: str = _MOTION
) -> Section | None:
    """Return the arm in motion as a section of its own, a tab for each of the worst
    logs, by name.

    It is for pages without responses beside it. None of what diverged.
    """
    plots = motions(arm, predictions)
    if not plots:
        return None
    tabs = tuple(replace(plot, button=plot.row, row="") for plot in plots)
    return Section("The arm in motion", caption, tabs=tabs)


def motions(arm: Arm, predictions: Mapping[str, Prediction]) -> tuple[Plot, ...]:
    """Return the arm in motion in the worst of the logs, given by the names of their
    rows.

    What diverged is left out.
    """

    def worst_rms(row: str) -> float:
        return max(error.rms for error in predictions[row].indices.values())

    usable = [row for row, p in predictions.items() if np.isfinite(p.response).all()]
    rows = sorted(usable, key=worst_rms, reverse=True)[:MOTIONS]
    if not rows:
        return ()
    model = load_model(arm).compile()
    # all pictures of a page share what it may hold
    moments = MOST // len(rows)
    plots = list[Plot]()
    for row in rows:
        draw = partial(moving_arm, model, arm.joint_names, predictions[row], moments)
        caption = f"The arm in motion: {row}"
        plots.append(Plot(f"motion_{len(plots) + 1}", caption, draw, row=row))
    return tuple(plots)


def _compared(group: Sequence[Prediction]) -> list[int]:
    """Return the joints that any prediction of a log compares, numbered from 1."""
    joints = chain.from_iterable(prediction.joints for prediction in group)
    return [*dict.fromkeys(joints)]


def _kind(prediction: Prediction) -> str:
    if prediction.apart:
        return "unseen, not counted"
    return _KINDS[prediction.unseen]


def _joint_tab(
    arm: Arm,
    joint: int,
    group: Sequence[Prediction],
    log: str,
    bins: int,
    tolerances: Mapping[int, float],
) -> Plot:
    """Return the tab of one joint in a log: its error, and the response of each model
    that compares it.
    """
    predictions = [prediction for prediction in group if joint in prediction.joints]
    name = arm.name_of(joint)
    shown = arm.joint(joint).shown
    title = f"{name} in {log}"
    error = rms_deg([predictions[0].error(joint)])
    draw = partial(draw_response, title, joint, predictions, bins, shown)
    return Plot(
        "",
        title,
        draw,
        zoom=True,
        button=_size(error, shown),
        column=name,
        state=_state(error, tolerances.get(joint, np.inf)),
    )


def _size(error: float, shown: Display) -> str:
    """Write an error [deg] as its joint is shown."""
    if not np.isfinite(error):
        return "diverged"
    return f"{significant(shown.of_degrees(error), 2)}{shown.mark}"


def _state(error: float, tolerance: float) -> str:
    """Return the state of a button that shows an error; one that is NaN is bad."""
    if error <= tolerance:
        return "good"
    return "fair" if error <= 2 * tolerance else "bad"


def _all_tab(
    arm: Arm, group: Sequence[Prediction], log: str, bins: int, tabs: Sequence[Plot]
) -> Plot:
    """Return the tab of all joints of a log together: the state is the worst of
    theirs."""
    states = {tab.state for tab in tabs}
    worst = next(state for state in ("bad", "fair", "good") if state in states)
    title = f"All joints in {log}"
    draw = partial(draw_joints, title, arm, group, max(LEAST_BINS, bins // 2))
    return Plot("", title, draw, zoom=True, button="all", column=ALL, state=worst)


def draw_response(
    title: str,
    joint: int,
    predictions: Sequence[Prediction],
    bins: int,
    shown: Display = TURNING,
) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual,
    command and pressures.
    """
    log = predictions[0].log
    column = joint - 1
    measured = shown.factor * log.angle[:, column]
    upper = [reference(log.time, measured, "measured")]
    middle = [zero_line()]
    travel = float(np.ptp(measured))
    colors = cycle(SERIES)
    for prediction, color in zip(predictions, colors, strict=False):
        look: Plain = {"color": color, "off": prediction is not predictions[0]}
        response, residual, band = _response_marks(
            prediction, joint, shown, travel, look
        )
        upper.append(response)
        middle.append(residual)
        # a band stands behind every line
        middle[:0] = band
    title += _largest(predictions[0], joint, shown)
    panels = [
        Panel("", f"{shown.word} [{shown.unit}]", tuple(upper), title, 180),
        Panel("", f"residual [{shown.unit}]", tuple(middle), height=110),
    ]
    if pressures := _pressures(predictions[0], joint):
        panels.append(Panel("", "pressure [bar]", pressures, height=105))
    if flows := _flows(predictions[0], joint):
        panels.append(Panel("", "flow in [L/min]", flows, height=100))
    command = Mark("step", log.time, log.command[:, column], color="grey")
    panels.append(command_panel(command))
    return Chart(tuple(panels), linked=True, bins=bins)


def _largest(prediction: Prediction, joint: int, shown: Display) -> str:
    """Say how large the largest error is, and when; nothing of what diverged."""
    error = np.abs(shown.factor * prediction.error(joint))
    if not np.isfinite(error).all():
        return ""
    place = int(np.argmax(error))
    size = significant(float(error[place]), 2)
    return f": largest error {size} {shown.unit}, at {prediction.log.time[place]:.1f} s"


def _response_marks(
    prediction: Prediction, joint: int, shown: Display, travel: float, look: Plain
) -> tuple[Mark, Mark, list[Mark]]:
    """Draw the response, the residual and, where there is one, the 95 % band of a joint
    that travelled so far, as it is shown."""
    time = prediction.log.time
    measured = shown.factor * prediction.log.angle_of(joint)
    residual = shown.factor * finite(prediction.error(joint))
    name = short_name(prediction.fit)
    size = rms(residual)
    label = f"{name} (diverged)"
    if np.isfinite(size):
        label = f"{name} ({number(size)} {shown.unit} rms)"
    # a response that runs away must not flatten the others
    residual[np.abs(residual) > FAR * max(travel, 1.0)] = np.nan
    response = Mark("line", time, measured - residual, label=label, **look)
    error = Mark("line", time, residual, label=label, width=1, **look)
    band = prediction.bands.get(joint)
    if band is None:
        return response, error, []
    half = shown.factor * band.half
    label = f"{name}, 95 % band"
    if np.mean(2 * half) > travel:
        label += ", wider than the motion"
    # nor must a band that the parameters leave open
    half = np.fmin(half, 2.0 * np.nanmax(np.abs(residual), initial=1e-6))
    return (
        response,
        error,
        [Mark("band", time, -half, half, label=label, alpha=0.18, **look)],
    )


def _pressures(prediction: Prediction, joint: int) -> tuple[Mark, ...]:
    """Draw the pressures of both chambers of a joint, as far as they are measured and
    simulated."""
    marks = list[Mark]()
    time = prediction.log.time
    measured = prediction.log.pressure
    oil = prediction.oil
    for side, color in enumerate(CHAMBER_COLORS):
        name = f"chamber {'AB'[side]}"
        if measured is not None:
            pressure = BAR * measured[:, joint - 1, side]
            mark = Mark("line", time, pressure, color=color, label=f"{name}, measured")
            marks.append(replace(mark, width=5, alpha=0.35))
        if oil is not None:
            pressure = BAR * oil.pressure[:, prediction.joints.index(joint), side]
            label = f"{name}, simulated"
            marks.append(Mark("line", time, pressure, color=color, label=label))
    if oil is not None and oil.line is not None:
        look: Plain = {"color": "grey", "label": "pump's line"}
        marks.append(Mark("line", time, BAR * oil.line, width=1, **look))
    # a chamber without a sensor has a column of NaN
    return tuple(mark for mark in marks if np.isfinite(mark.y).any())


def _flows(prediction: Prediction, joint: int) -> tuple[Mark, ...]:
    """Draw the simulated flows into both chambers of a joint; none where there are
    none."""
    oil = prediction.oil
    if oil is None:
        return ()
    flows = LITRES_PER_MINUTE * oil.flow[:, prediction.joints.index(joint)]
    if np.isnan(flows).all():
        return ()
    marks = [zero_line()]
    for side, color in enumerate(CHAMBER_COLORS):
        look: Plain = {"color": color, "label": f"chamber {'AB'[side]}, simulated"}
        marks.append(Mark("line", prediction.log.time, flows[:, side], **look))
    return tuple(marks)


def draw_joints(title: str, arm: Arm, group: Sequence[Prediction], bins: int) -> Chart:
    """Draw all joints of a log on one time axis: measured and simulated angles, the
    flows that they take in, the pressure of the pump's line, and all commands."""
    panels = list[Panel]()
    commands = list[Mark]()
    flows = list[Mark]()
    pump = list[Mark]()
    for joint, color in zip(_compared(group), cycle(COMMAND_COLORS), strict=False):
        prediction = next(p for p in group if joint in p.joints)
        time = prediction.log.time
        name = arm.name_of(joint)
        shown = arm.joint(joint).shown
        measured = shown.factor * prediction.log.angle_of(joint)
        simulated = measured - shown.factor * finite(prediction.error(joint))
        far = FAR * max(np.ptp(measured), 1.0)
        simulated[np.abs(simulated - measured) > far] = np.nan
        marks = (
            reference(time, measured, "measured", width=4),
            Mark("line", time, simulated, color="orange", label="simulated"),
        )
        heading = title if not panels else ""
        label = f"{short_name(name)} [{shown.unit}]"
        panels.append(Panel("", label, marks, heading, 150))
        command = prediction.log.command_of(joint)
        commands.append(Mark("step", time, command, color=color, label=name))
        oil = prediction.oil
        if oil is None:
            continue
        # oil enters one chamber while it leaves the other
        flow = LITRES_PER_MINUTE * oil.flow[:, prediction.joints.index(joint)]
        flows.append(Mark("line", time, flow.max(axis=1), color=color, label=name))
        if oil.line is not None and not pump:
            pump.append(Mark("line", time, BAR * oil.line, color="grey"))
    if any(np.isfinite(mark.y).any() for mark in flows):
        panels.append(Panel("", "flow in [L/min]", tuple(flows), height=130))
    if pump:
        panels.append(Panel("", "pump [bar]", tuple(pump), height=110))
    panels.append(command_panel(*commands, height=160))
    return Chart(tuple(panels), linked=True, bins=bins)
