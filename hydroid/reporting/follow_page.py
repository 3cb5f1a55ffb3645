"""The page of commands along a path: predicted errors, where a wish cannot be had, the
arm in motion."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from hydroid.files import Plain
from hydroid.fitting.validation import Prediction
from hydroid.reporting.chart import (
    Chart,
    Mark,
    Panel,
    command_panel,
    reference,
    zero_line,
)
from hydroid.reporting.page import Cell, Page, Plot, Section, Table
from hydroid.reporting.response_report import motion_section
from hydroid.settings.arm import Arm
from hydroid.use.follow import Followed, Missed
from hydroid.words import listed, number, two_digits

_MOTION = (
    "Orange: what the model makes of the commands. Grey: the wished path, hidden where both agree. "
    "The picture begins where they differ most."
)
_NOTE = (
    "error: rms between wished and predicted angle. with its band: with 95 % probability the machine "
    "stays within this rms error, without any feedback. saturated: part of the time at full command."
)


def follow_page(
    name: str, followed: Followed, arm: Arm, said: Sequence[str] = ()
) -> Page:
    """Return the page; its file has the `name`, its table is `tracking`, and beside it
    stands what is `said` of the path."""
    table = tracking_table(followed, arm)
    sections = [Section(table.title, "", tuple(said), {"tracking": table})]
    columns = [joint - 1 for joint in followed.joints]
    angle = followed.angle[:, columns]
    moving = Prediction(name, followed.log, followed.joints, angle, {}, None)
    motion = motion_section(arm, {"the path": moving}, _MOTION)
    if motion is not None:
        sections.append(motion)
    tabs = list[Plot]()
    for joint in followed.joints:
        joint_name = arm.name_of(joint)
        draw = partial(_chart, followed, joint, arm)
        tab = Plot(f"joint_{joint}", joint_name, draw, zoom=True, button=joint_name)
        tabs.append(tab)
    text = "Wished and predicted angle, the error with its band, and the command."
    sections.append(Section("Joint by joint", text, tabs=tuple(tabs)))
    title = f"Commands for {arm.name}"
    return Page(name, title, _lead(followed, arm), tuple(sections), ())


def tracking_table(followed: Followed, arm: Arm) -> Table:
    """Return the predicted errors of the joints."""
    rows = list[tuple[Cell, ...]]()
    for joint in followed.joints:
        shown = arm.joint(joint).shown
        error, wide = followed.rms(joint)
        banded = None
        if np.isfinite(wide):
            banded = shown.factor * wide
        command = followed.log.command_of(joint)
        full = 100.0 * float(np.mean(np.abs(command) >= 100.0))
        name = arm.name_of(joint)
        rows.append((name, shown.unit, shown.factor * error, banded, full))
    header = ("joint", "unit", "error", "with its band", "saturated [%]")
    return Table("Predicted tracking error", header, tuple(rows), _NOTE)


def missed_lines(followed: Followed, arm: Arm) -> list[str]:
    """Return a sentence for each joint and reason for which a wish cannot be had."""
    groups = dict[tuple[int, str], list[Missed]]()
    for span in followed.missed:
        groups.setdefault((span.joint, span.limit), []).append(span)
    return [_missed(group, followed.lead_s, arm) for group in groups.values()]


def _missed(group: Sequence[Missed], lead: float, arm: Arm) -> str:
    worst = max(group, key=lambda span: abs(span.wished - span.had))
    shown = arm.joints[worst.joint].shown
    spans = [f"{span.from_s - lead:.2f} to {span.to_s - lead:.2f}" for span in group]
    had = two_digits(shown.factor * worst.had)
    wished = two_digits(shown.factor * worst.wished)
    what = f"{arm.joint_names[worst.joint]}: {worst.limit}"
    speeds = f"at worst {had} instead of {wished} {shown.unit}/s"
    return f"{what}, {speeds}; {listed(spans, 3)} s into the path"


def _lead(followed: Followed, arm: Arm) -> str:
    def relative(joint: int) -> float:
        return followed.rms(joint)[0]

    worst = max(followed.joints, key=relative)
    shown = arm.joint(worst).shown
    error = number(shown.factor * followed.rms(worst)[0])
    name = arm.name_of(worst)
    text = f"The model follows the path to {error} {shown.unit} rms at most ({name})."
    if followed.missed:
        names = dict.fromkeys(arm.joint_names[span.joint] for span in followed.missed)
        text += f" {', '.join(names)} cannot move as fast as the path asks everywhere."
    return text


def _chart(followed: Followed, joint: int, arm: Arm) -> Chart:
    column = joint - 1
    shown = arm.joints[column].shown
    unit = shown.unit
    factor = shown.factor
    time = followed.log.time - followed.lead_s
    wished = factor * followed.log.angle[:, column]
    predicted = factor * followed.angle[:, column]
    error = wished - predicted
    look: Plain = {"color": "orange", "label": "predicted"}
    upper = (reference(time, wished, "wished"), Mark("line", time, predicted, **look))
    middle = [zero_line()]
    half = followed.half.get(joint)
    if half is not None and np.isfinite(half).all():
        low = error - factor * half
        high = error + factor * half
        label = "95 % band"
        band = Mark("band", time, low, high, color="orange", label=label, alpha=0.18)
        middle.append(band)
    middle.append(Mark("line", time, error, width=1, **look))
    spans = [span for span in followed.missed if span.joint == column]
    shaded = _shaded(spans, followed.lead_s)
    command = Mark("step", time, followed.log.command[:, column], color="grey")
    panels = (
        Panel("", f"{shown.word} [{unit}]", upper, arm.joint_names[column], 280),
        Panel("", f"error [{unit}]", tuple(middle), height=190),
        command_panel(*shaded, command, height=160),
    )
    return Chart(panels, linked=True)


def _shaded(spans: Sequence[Missed], lead: float) -> list[Mark]:
    if not spans:
        return []
    begin = np.array([span.from_s for span in spans]) - lead
    end = np.array([span.to_s for span in spans]) - lead
    return [
        Mark("spans", x=begin, end=end, color="pink", label="cannot be had", alpha=0.3)
    ]
