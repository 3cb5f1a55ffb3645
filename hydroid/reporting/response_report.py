"""What models make of logs: each joint's error in each log, its response, and the arm
in motion."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, cycle

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import rms
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import rms_deg
from hydroid.joint_verdict import JointVerdict
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.moving_arm import MOST, moving_arm
from hydroid.reporting.page import Plot, Section, Table, log_names, short_name
from hydroid.settings.arm import Arm
from hydroid.units import display
from hydroid.words import number, two_digits

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
ALL = "joints"
"""column of the responses of all joints together"""

_MATRIX = (
    "Rms error of each joint. Green: within its tolerance; amber: within twice that; red: beyond. Choose one "
    "to see its response and the arm in motion."
)
_MOTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where they differ most, "
    "and turns with the machine. Other joints replay their measured angles."
)
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
    for one in predictions:
        by_log.setdefault(one.log.source, []).append(one)
    names = log_names(by_log)
    tolerances = dict[int, float]()
    for one in chain.from_iterable(verdicts):
        tolerances.setdefault(one.joint, one.tolerance_deg)
    count = sum(len(_compared(group)) for group in by_log.values())
    bins = min(MOST_BINS, max(LEAST_BINS, SAMPLES // max(count, 1)))
    tabs = list[Plot]()
    for log, group in by_log.items():
        row = f"{names[log]} {_kind(group[0])}".strip()
        of_log = [
            _joint_tab(arm, joint, group, names[log], bins, tolerances)
            for joint in _compared(group)
        ]
        if len(of_log) > 1:
            of_log.append(_all_tab(arm, group, names[log], bins, of_log))
        tabs += [_numbered(tab, row, len(tabs) + i) for i, tab in enumerate(of_log, 1)]
    rows = {
        log: f"{names[log]} {_kind(group[0])}".strip() for log, group in by_log.items()
    }
    beside = motions(arm, {rows[log]: group[0] for log, group in by_log.items()})
    title, text = ("Errors by log", _MATRIX) if len(tabs) > 1 else ("Response", "")
    return Section(
        title,
        text,
        tabs=tuple(tabs),
        beside=beside,
        beside_note=_MOTION if beside else "",
    )


def error_table(predictions: Sequence[Prediction], arm: Arm, *, one_fit: bool) -> Table:
    """Return all errors of all predictions, one row for each joint of each."""
    names = log_names(dict.fromkeys(one.log.source for one in predictions))
    rows = list[dict[str, object]]()
    for one in predictions:
        for row in one.plain(arm.joint_names):
            row |= {
                "fit": short_name(one.fit),
                "log": names[one.log.source],
                "kind": _kind(one),
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
    tabs = [
        replace(plot, button=plot.row, row="") for plot in motions(arm, predictions)
    ]
    return Section("The arm in motion", caption, tabs=tuple(tabs)) if tabs else None


def motions(arm: Arm, predictions: Mapping[str, Prediction]) -> tuple[Plot, ...]:
    """Return the arm in motion in the worst of the logs, given by the names of their
    rows.

    What diverged is left out.
    """
    usable = [
        item for item in predictions.items() if np.isfinite(item[1].response).all()
    ]
    usable.sort(key=lambda item: -max(one.rms for one in item[1].indices.values()))
    del usable[MOTIONS:]
    if not usable:
        return ()
    model = load_model(arm).compile()
    plots = list[Plot]()
    for row, one in usable:
        drawing = partial(moving_arm, model, arm.joint_names, one, MOST // len(usable))
        plots.append(
            Plot(
                f"motion_{len(plots) + 1}",
                f"The arm in motion: {row}",
                drawing,
                row=row,
            )
        )
    return tuple(plots)


def _compared(group: Sequence[Prediction]) -> list[int]:
    """Return the joints that any prediction of a log compares, numbered from 1."""
    return [*dict.fromkeys(joint for one in group for joint in one.joints)]


def _kind(one: Prediction) -> str:
    return "unseen, not counted" if one.apart else _KINDS[one.unseen]


def _numbered(tab: Plot, row: str, count: int) -> Plot:
    return Plot(
        f"response_{count}",
        tab.caption,
        tab.draw,
        True,
        tab.button,
        row,
        tab.column,
        tab.state,
    )


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
    several = [one for one in group if joint in one.joints]
    name = arm.joint_names[joint - 1]
    slides = arm.joints[joint - 1].slides
    title = f"{name} in {log}"
    error = rms_deg([several[0].error(joint)])
    tolerance = tolerances.get(joint, np.inf)
    state = "good"
    if not error <= tolerance:
        state = "fair" if error <= 2 * tolerance else "bad"
    size = (
        f"{two_digits(1e3 * np.radians(error))} mm"
        if slides
        else f"{two_digits(error)}°"
    )
    drawing = partial(draw_response, title, joint, several, bins, slides=slides)
    return Plot(
        "",
        title,
        drawing,
        button=size if np.isfinite(error) else "diverged",
        column=name,
        state=state,
    )


def _all_tab(
    arm: Arm, group: Sequence[Prediction], log: str, bins: int, tabs: Sequence[Plot]
) -> Plot:
    """Return the tab of all joints of a log together: the state is the worst of
    theirs."""
    states = {tab.state for tab in tabs}
    worst = next(state for state in ("bad", "fair", "good") if state in states)
    title = f"All joints in {log}"
    drawing = partial(draw_joints, title, arm, group, max(LEAST_BINS, bins // 2))
    return Plot("", title, drawing, button="all", column=ALL, state=worst)


def draw_response(
    title: str,
    joint: int,
    several: Sequence[Prediction],
    bins: int,
    *,
    slides: bool = False,
) -> Chart:
    """Draw the measured angle of one joint, every model's response and residual,
    command and pressures.
    """
    log = several[0].log
    column = joint - 1
    place, unit, factor = display(slides=slides)
    measured = factor * log.angle[:, column]
    upper = [
        Mark(
            "line",
            log.time,
            measured,
            color="ink",
            label="measured",
            width=5,
            alpha=0.35,
        )
    ]
    middle = [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    # a response that runs away must not flatten the others
    far = FAR * max(np.ptp(measured), 1.0)
    for i, (one, color) in enumerate(zip(several, cycle(SERIES), strict=False)):
        residual = factor * finite(one.error(joint))
        name = short_name(one.fit)
        size = rms(residual)
        label = (
            f"{name} ({number(size)} {unit} rms)"
            if np.isfinite(size)
            else f"{name} (diverged)"
        )
        residual[np.abs(residual) > far] = np.nan
        angle = factor * one.log.angle[:, column] - residual
        upper.append(
            Mark("line", one.log.time, angle, color=color, label=label, off=i > 0)
        )
        middle.append(
            Mark(
                "line",
                one.log.time,
                residual,
                color=color,
                label=label,
                width=1,
                off=i > 0,
            )
        )
        if band := one.bands.get(joint):
            half = factor * band.half
            useless = (
                ", wider than the motion"
                if np.mean(2 * half) > np.ptp(measured)
                else ""
            )
            # nor must a band that the parameters leave open
            half = np.fmin(half, 2.0 * np.nanmax(np.abs(residual), initial=1e-6))
            label = f"{name}, 95 % band{useless}"
            drawn = Mark(
                "band",
                one.log.time,
                -half,
                half,
                color=color,
                label=label,
                alpha=0.18,
                off=i > 0,
            )
            middle.insert(0, drawn)
    panels = [
        Panel("", f"{place} [{unit}]", tuple(upper), title, 200),
        Panel("", f"residual [{unit}]", tuple(middle), height=130),
    ]
    if pressures := _pressures(several[0], joint):
        panels.append(Panel("", "pressure [bar]", pressures, height=120))
    command = Mark("step", log.time, log.command[:, column], color="grey")
    panels.append(
        Panel("time [s]", "command [%]", (command,), height=130, y_limits=(-108, 108))
    )
    return Chart(tuple(panels), linked=True, bins=bins)


def _pressures(one: Prediction, joint: int) -> tuple[Mark, ...]:
    """Draw the pressures of both chambers of a joint, as far as they are measured and
    simulated."""
    marks = list[Mark]()
    log = one.log
    for side, color in enumerate(("green", "pink")):
        name = f"chamber {'AB'[side]}"
        if (
            log.pressure is not None
            and np.isfinite(log.pressure[:, joint - 1, side]).any()
        ):
            measured = 1e-5 * log.pressure[:, joint - 1, side]
            mark = Mark(
                "line", log.time, measured, color=color, label=f"{name}, measured"
            )
            marks.append(replace(mark, width=5, alpha=0.35))
        if (
            one.pressure is not None
            and np.isfinite(one.pressure[:, one.joints.index(joint), side]).any()
        ):
            simulated = 1e-5 * one.pressure[:, one.joints.index(joint), side]
            marks.append(
                Mark(
                    "line", log.time, simulated, color=color, label=f"{name}, simulated"
                )
            )
    return tuple(marks)


def draw_joints(title: str, arm: Arm, group: Sequence[Prediction], bins: int) -> Chart:
    """Draw all joints of a log on one time axis: measured and simulated angles, and all
    commands."""
    panels = list[Panel]()
    commands = list[Mark]()
    for number_of, joint in enumerate(_compared(group)):
        one = next(prediction for prediction in group if joint in prediction.joints)
        name = arm.joint_names[joint - 1]
        _, unit, factor = arm.joints[joint - 1].shown
        measured = factor * one.log.angle[:, joint - 1]
        simulated = measured - factor * finite(one.error(joint))
        simulated[np.abs(simulated - measured) > FAR * max(np.ptp(measured), 1.0)] = (
            np.nan
        )
        marks = (
            Mark(
                "line",
                one.log.time,
                measured,
                color="ink",
                label="measured",
                width=4,
                alpha=0.35,
            ),
            Mark("line", one.log.time, simulated, color="orange", label="simulated"),
        )
        heading = title if not panels else ""
        panels.append(Panel("", f"{short_name(name)} [{unit}]", marks, heading, 150))
        color = ("blue", "green", "pink", "yellow", "sky", "grey")[number_of % 6]
        command = one.log.command[:, joint - 1]
        commands.append(
            Mark("step", one.log.time, command, color=color, label=f"command of {name}")
        )
    panels.append(
        Panel(
            "time [s]", "command [%]", tuple(commands), height=160, y_limits=(-108, 108)
        )
    )
    return Chart(tuple(panels), linked=True, bins=bins)
