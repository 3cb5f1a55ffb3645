"""The page of commands along a path: predicted errors, where a wish cannot be had, the
arm in motion."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from hydroid.fitting.validation import Prediction
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Page, Plot, Section, Table
from hydroid.reporting.response_report import motion_section
from hydroid.settings.arm import Arm
from hydroid.use.follow import Followed, Missed
from hydroid.words import listed, number, two_digits

_MOTION = (
    "Orange: what the model makes of the commands. Grey: the wished path, hidden where both agree. "
    "The picture begins where they differ most."
)
_NOTE = (
    "error: rms between wished and predicted angle. with its band: 95 % of the machines that the logs allow "
    "stay within this rms error, without any feedback."
)


def follow_page(name: str, followed: Followed, arm: Arm) -> Page:
    """Return the page; its file has the `name`, its table is `tracking`."""
    table = tracking_table(followed, arm)
    columns = [joint - 1 for joint in followed.joints]
    moving = Prediction(
        name, followed.log, followed.joints, followed.angle[:, columns], {}, None
    )
    motion = motion_section(arm, {"the path": moving}, _MOTION)
    tabs = list[Plot]()
    for joint in followed.joints:
        name_of_joint = arm.joint_names[joint - 1]
        draw = partial(_chart, followed, joint, arm)
        tabs.append(
            Plot(f"joint_{joint}", name_of_joint, draw, zoom=True, button=name_of_joint)
        )
    sections = (
        Section(
            table.title, "", tuple(missed_lines(followed, arm)), {"tracking": table}
        ),
        *([motion] if motion else []),
        Section(
            "Joint by joint",
            "Wished and predicted angle, the error with its band, and the command.",
            tabs=tuple(tabs),
        ),
    )
    return Page(name, f"Commands for {arm.name}", _lead(followed, arm), sections, ())


def tracking_table(followed: Followed, arm: Arm) -> Table:
    """Return the predicted errors of the joints."""
    rows: list[tuple[str | float | None, ...]] = []
    for joint in followed.joints:
        _, unit, factor = arm.joints[joint - 1].shown
        error, wide = (factor * size for size in followed.rms(joint))
        command = followed.log.command[:, joint - 1]
        full = 100.0 * float(np.mean(np.abs(command) >= 100.0))
        rows.append(
            (
                arm.joint_names[joint - 1],
                unit,
                error,
                wide if np.isfinite(wide) else None,
                full,
            )
        )
    header = ("joint", "unit", "error", "with its band", "full command [% of time]")
    return Table("Predicted tracking error", header, tuple(rows), _NOTE)


def missed_lines(followed: Followed, arm: Arm) -> list[str]:
    """Return a sentence for each joint and reason for which a wish cannot be had."""
    groups: dict[tuple[int, str], list[Missed]] = {}
    for one in followed.missed:
        groups.setdefault((one.joint, one.limit), []).append(one)
    return [_missed(group, followed.lead_s, arm) for group in groups.values()]


def _missed(group: Sequence[Missed], lead: float, arm: Arm) -> str:
    worst = max(group, key=lambda one: abs(one.wished - one.had))
    _, unit, factor = arm.joints[worst.joint].shown
    spans = [f"{one.from_s - lead:.2f} to {one.to_s - lead:.2f}" for one in group]
    had = two_digits(factor * worst.had)
    wished = two_digits(factor * worst.wished)
    what = f"{arm.joint_names[worst.joint]}: {worst.limit}, at worst {had} {unit}/s where {wished} are wished"
    return f"{what}; {listed(spans, 3)} s into the path"


def _lead(followed: Followed, arm: Arm) -> str:
    def relative(joint: int) -> float:
        return followed.rms(joint)[0]

    worst = max(followed.joints, key=relative)
    _, unit, factor = arm.joints[worst - 1].shown
    error = number(factor * followed.rms(worst)[0])
    text = f"The model follows the path to {error} {unit} rms at most ({arm.joint_names[worst - 1]})."
    if followed.missed:
        names = dict.fromkeys(arm.joint_names[one.joint] for one in followed.missed)
        text += f" {', '.join(names)} cannot move as fast as the path asks everywhere."
    return text


def _chart(followed: Followed, joint: int, arm: Arm) -> Chart:
    column = joint - 1
    word, unit, factor = arm.joints[column].shown
    time = followed.log.time - followed.lead_s
    wished = factor * followed.log.angle[:, column]
    predicted = factor * followed.angle[:, column]
    error = wished - predicted
    upper = (
        Mark("line", time, wished, color="ink", label="wished", width=5, alpha=0.35),
        Mark("line", time, predicted, color="orange", label="predicted"),
    )
    middle = [Mark("rule", y=np.zeros(1), color="grey", width=1)]
    if (half := followed.half.get(joint)) is not None and np.isfinite(half).all():
        wide = factor * half
        middle.append(
            Mark(
                "band",
                time,
                error - wide,
                error + wide,
                color="orange",
                label="95 % band",
                alpha=0.18,
            )
        )
    middle.append(Mark("line", time, error, color="orange", label="predicted", width=1))
    command = Mark("step", time, followed.log.command[:, column], color="grey")
    spans = [one for one in followed.missed if one.joint == column]
    panels = (
        Panel("", f"{word} [{unit}]", upper, arm.joint_names[column], 280),
        Panel("", f"error [{unit}]", tuple(middle), height=190),
        Panel(
            "time [s]",
            "command [%]",
            (*_shaded(spans, followed.lead_s), command),
            height=160,
            y_limits=(-108, 108),
        ),
    )
    return Chart(panels, linked=True)


def _shaded(spans: Sequence[Missed], lead: float) -> list[Mark]:
    if not spans:
        return []
    begin = np.array([one.from_s for one in spans]) - lead
    end = np.array([one.to_s for one in spans]) - lead
    return [
        Mark("spans", x=begin, end=end, color="pink", label="cannot be had", alpha=0.3)
    ]
