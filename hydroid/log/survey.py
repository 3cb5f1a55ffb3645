"""What logs are good for: how far each joint moves, its stops, and commands that no log has."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from hydroid.log.delay import smooth, stands_at_stop
from hydroid.log.direction import disagreements
from hydroid.log.log import Finding, Floats, Log, numbered

SMOOTHING = 0.25  # standard deviation of a Gaussian over which a travel is taken [s]
HARDLY = 2.0  # [deg]: a joint that is driven strongly moves further
STRONG = 30.0  # [%]
LEAST = 300.0  # [% s] of strong commands before their effect is judged
REST = 0.2  # [s] of rest before the first command that give a start pose
AT_STOP = 0.5  # [s] at a stop that are worth a line
HELD = 0.3  # [s] for which logs hold a command before it counts
BIN = 5.0  # [%]
OPEN = 19.5  # [%]: a wider interval without commands leaves the valve curve open
HIGH = 80.0  # [%]: above the largest command, if it is lower, the curve is open too
_MAX_LISTED = 3  # joints in a line


def moved(log: Log, joint: int) -> float:
    """Return the range over which a measured joint (number, from 1) moved [deg], but for its noise."""
    return float(np.rad2deg(np.ptp(smooth(log.angle[:, joint - 1], SMOOTHING / log.period))))


def motion_findings(log: Log) -> list[Finding]:
    """Report joints that hardly move or stand at a stop, and a log that does not begin at rest."""
    findings = list[Finding]()
    joints = (np.flatnonzero(log.driven & log.measured) + 1).tolist()
    strong = np.where(np.abs(log.command) > STRONG, np.abs(log.command), 0.0).sum(axis=0) * log.period
    still = [j for j in joints if strong[j - 1] > LEAST and 0 < moved(log, j) < HARDLY]
    if still:
        most = max(moved(log, joint) for joint in still)
        what = f"strong commands hardly move {numbered(still)}, by {most:.2g} deg at most"
        hint = "check log.joints: is this the angle of that command?"
        findings.append(Finding("warning", what, log.source, hint, kind="no motion"))
    stops = {j: float(stands_at_stop(log, j).sum() * log.period) for j in joints if j not in still}
    stops = {j: seconds for j, seconds in stops.items() if seconds >= AT_STOP}
    if stops:
        parts = ", ".join(f"joint {j} for {seconds:.3g} s" for j, seconds in stops.items())
        what = f"is driven against the end of its travel: {parts}"
        hint = "this time says nothing about the valve; the joint's range in the arm's file should end there"
        findings.append(Finding("note", what, log.source, hint, kind="at a stop"))
    first = int(np.argmax(log.command.any(axis=1)))
    if log.driven.any() and first * log.period < REST:
        what = f"begins with a command after {first * log.period:.2g} s" if first else "begins with a command"
        hint = "the first sample is the start pose: begin a log with a second of rest"
        findings.append(Finding("note", what, log.source, hint, kind="no rest"))
    return findings


def survey(logs: Sequence[Log]) -> list[Finding]:
    """Report what all logs together lack or contradict: directions, and commands that none of them has."""
    if not logs:
        return []
    findings, gaps, one_way = disagreements(logs), list[str](), list[str]()
    joints = np.flatnonzero(np.any([log.driven & log.measured for log in logs], axis=0)) + 1
    for joint in joints.tolist():
        levels = {sign: _levels(logs, joint, sign) for sign in (1, -1)}
        if open_ := [*_gaps(levels[1], 1), *_gaps(levels[-1], -1)]:
            gaps.append(f"joint {joint} {', '.join(open_)}")
        for sign, word in ((1, "positive"), (-1, "negative")):
            if not len(levels[sign]) and len(levels[-sign]):
                one_way.append(f"joint {joint} {word}")
    source = logs[0].source if len(logs) == 1 else f"{len(logs)} logs"
    if gaps:
        more = f"; and of {len(gaps) - _MAX_LISTED} more joints" if len(gaps) > _MAX_LISTED else ""
        where = f"{'; '.join(gaps[:_MAX_LISTED])}{more}"
        what = f"no command [%] of {where}: nothing is known about the valve curve there"
        hint = "add logs with such commands, or keep the parameters of the curve fixed"
        findings.append(Finding("note", what, source, hint, kind="open valve curve"))
    if one_way:
        what = f"never commanded: {', '.join(one_way)}"
        hint = "parameters of that direction stay unknown"
        findings.append(Finding("note", what, source, hint, kind="one direction"))
    return findings


def _levels(logs: Sequence[Log], joint: int, sign: int) -> Floats:
    """Return the commands of one direction [%] that are held long enough, ascending: means over bins."""
    commands = [(sign * log.command[:, joint - 1], log.period) for log in logs]
    values = np.concatenate([u[u > 1] for u, _ in commands])
    seconds = np.concatenate([np.full((u > 1).sum(), period) for u, period in commands])
    bins = (values // BIN).astype(int)
    held = np.bincount(bins, seconds) if len(bins) else np.zeros(0)
    used = np.flatnonzero(held >= HELD)
    return np.array([np.average(values[bins == b], weights=seconds[bins == b]) for b in used])


def _gaps(levels: Floats, sign: int) -> list[str]:
    """Return the intervals without commands between levels [%] and above them, in the direction of `sign`."""
    wide = [(sign * a, sign * b) for a, b in pairwise(levels) if b - a >= OPEN]
    gaps = [f"between {min(pair):.0f} and {max(pair):.0f}" for pair in wide]
    if len(levels) and levels[-1] < HIGH:
        gaps.append(f"{'above' if sign > 0 else 'below'} {sign * levels[-1]:.0f}")
    return gaps
