"""Whether a joint moves with its command or against it.

By convention a positive command turns a joint to positive angles. The log is cut into windows; in those with
a strong command the joint's travel counts for or against it. Delays shorter than a window change the share
little, and a joint at a stop has no travel.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.log.log import Finding, Log, numbered

WINDOW = 0.5  # [s]
STRONG = 0.3  # of the joint's largest command
TRAVEL = 3.0  # [deg] that tell a direction
AGAINST = 0.75  # of the travel goes against the command: it is logged the other way around


@dataclass(frozen=True)
class Direction:
    """How far a joint travelled under strong commands [deg], and which part of this against them."""

    travel: float
    against: float

    @property
    def turned(self) -> bool:
        """Whether command or angle is logged the other way around."""
        return self.against > AGAINST


def direction_of(log: Log, joint: int) -> Direction | None:
    """Return the direction of a joint (number, from 1); None where it hardly travels under a command."""
    u, q = log.command[:, joint - 1], log.angle[:, joint - 1]
    width = max(round(WINDOW / log.period), 1)
    windows = (len(u) - 1) // width
    if windows < 2 or np.isnan(q).any() or not u.any():
        return None
    ends = np.arange(windows + 1) * width
    command = np.add.reduceat(u, ends[:-1])[:windows] / width
    # from the middle of one window to that of the next: valve and oil need a few tenths of a second
    later = np.minimum(ends + width // 2, len(q) - 1)
    travel = np.rad2deg(np.diff(q[later]))
    counts = np.abs(command) > STRONG * np.abs(u).max()
    path = float(np.abs(travel[counts]).sum())
    if path < TRAVEL:
        return None
    return Direction(path, float(np.abs(travel[counts & (travel * command < 0)]).sum()) / path)


def direction_findings(log: Log, column: Callable[[int], str]) -> list[Finding]:
    """Report joints that move against their commands; `column` names a joint's."""
    joints = (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    found = {joint: d for joint in joints if (d := direction_of(log, joint)) and d.turned}
    if not found:
        return []
    share = ", ".join(f"{d.against:.0%} of {d.travel:.3g} deg" for d in found.values())
    what = f"angle of {numbered([*found])} moves against the command (for {share} of travel)"
    first = next(iter(found))
    hint = f"if the command is logged with the opposite sign, set log.joints.{first}.command.scale: -1"
    return [Finding("warning", what, log.source, hint, column=column(first), kind="direction")]


def disagreements(logs: Sequence[Log]) -> list[Finding]:
    """Report joints that move with their command in some logs and against it in others."""
    findings = list[Finding]()
    for joint in range(1, max((log.joints for log in logs), default=0) + 1):
        directions = {log.source: d for log in logs if (d := direction_of(log, joint))}
        turned = [source for source, d in directions.items() if d.turned]
        others = [source for source, d in directions.items() if d.against < 1 - AGAINST]
        if turned and others:
            odd = min(turned, others, key=len)
            what = f"joint {joint} moves against its command in {len(turned)} of {len(turned + others)} logs"
            hint = "the sign of the command or the angle differs between the logs: correct it in these logs"
            findings.append(Finding("warning", what, odd[0], hint, kind="directions differ"))
    return findings
