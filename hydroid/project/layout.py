"""What a log holds: its columns, and how the joints move in it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hydroid.arrays import record
from hydroid.errors import LogError, SettingsError
from hydroid.files import Plain
from hydroid.log import JointMotion, Table, check_log, guess_columns, motion_of
from hydroid.log.read import angle_margin
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings
from hydroid.words import listed

REVERSED = (
    "a reversed command suits a valve that is wired the other way. If a sensor counts the other way instead "
    "(compare arm.png), set scale: -1 at its angle and not at its command: gravity follows the angle"
)


@record
class Layout:
    """The columns of a log, as the `log` section of a fit's settings, and what its numbers say.

    `outputs` are joints with a command and an angle, `motions` how the measured ones move, by number from 1;
    `reasons` have a line for each column that is not `unused`; `followed`: a joint without a command moves.
    """

    section: Plain
    outputs: tuple[int, ...]
    reasons: tuple[str, ...]
    unused: tuple[str, ...]
    motions: Mapping[int, JointMotion]
    followed: bool


def find_layout(table: Table | None, arm: Arm, order: Sequence[str]) -> Layout:
    """Guess the columns of a log, turn commands that act against the angle, and see how fast joints are.

    Without a log all joints have a command and an angle, and none is seen to move.
    """
    if table is None:
        every = range(1, len(arm.joints) + 1)
        return Layout({"period_s": 0.01, "joints": {}}, tuple(every), (), (), {}, followed=False)
    names = arm.joint_names
    for name in order:
        if name not in names:
            raise SettingsError(f"no joint {name!r}", "--joints", f"the arm's joints: {', '.join(names)}")
    places = [names.index(name) for name in order or names]
    slides = [k for k, place in enumerate(places, 1) if arm.joints[place].slides]
    links = [arm.link_names[place] for place in places]
    section, guessed, unused = guess_columns(table, order or names, links=links, slides=slides)
    # A slow log is simulated in two steps a sample; what a fast one adds is not seen on such machines.
    period = section["period_s"]
    section["period_s"] = max(period, 0.02) if period < 0.03 else 0.02 if period < 0.1 else 0.05
    entries = {places[k - 1] + 1: entry for k, entry in section["joints"].items()}
    section["joints"], reasons = dict(sorted(entries.items())), [*guessed]
    measured = [joint for joint, entry in section["joints"].items() if entry["angle"]]
    if not measured:
        hint = f"rename them, or write the log section by hand; columns: {', '.join(table.names)}"
        raise LogError("has no column that looks like an angle", table.source, hint)
    free = dict.fromkeys(names, (-np.inf, np.inf))
    settings = validate(section, LogSettings, table.source)
    log, findings = check_log(Path(table.source), settings, free)
    if log is None:
        reasons.append(f"the log cannot be used as it is: {findings[0]}")
        log, _ = check_log(Path(table.source), settings, free, repair=True)
    motions = {joint: motion_of(log, joint) for joint in measured} if log else {}
    wrong = [j for j, m in motions.items() if m.contradicts(backward=j in arm.backward)]
    for joint, motion in motions.items():
        reasons += _remarks(motion, arm.joints[joint - 1], joint in wrong)
        if joint in wrong:
            entries[joint]["command"] = turned(entries[joint]["command"])
    reasons += [REVERSED] if wrong else []
    driven = [joint for joint in measured if entries[joint]["command"] is not None]
    for what in "angle", "command":
        lacking = [name for place, name in enumerate(names, 1) if not entries.get(place, {}).get(what)]
        reasons += [f"no {what} found for {listed(lacking)}"] if lacking else []
    followed = any(m.travel > 1 for joint, m in motions.items() if joint not in driven)  # [deg]
    return Layout(section, tuple(driven or measured), tuple(reasons), unused, motions, followed)


def _remarks(motion: JointMotion, joint: Joint, wrong: bool) -> Iterator[str]:
    angle, against = motion.log.angle[:, motion.joint - 1], motion.directed[1]
    what, unit, factor = ("positions", "m", 1.0) if joint.slides else ("angles", "deg", np.degrees(1))
    low, high, margin = angle.min(), angle.max(), angle_margin(*joint.limits)
    if not joint.continuous and (low < joint.limits[0] - margin or high > joint.limits[1] + margin):
        yield (
            f"{joint.name}: {what} in the log run from {low * factor:.4g} to {high * factor:.4g} {unit}, but "
            f"the arm allows {joint.range[0]:.6g} to {joint.range[1]:.6g}: give them an offset or a scale of "
            "-1, or change the range in arm.xml"
        )
    if wrong:
        share = f"on {max(against, 1 - against):.0%} of its way"
        yield f"{joint.name} moves against its command ({share}): the command's sign is reversed"
    if motion.log.driven[motion.joint - 1] and motion.dead_band > 10:
        below = f"below about {motion.dead_band:g} % of command"
        yield f"{joint.name} hardly moves {below}: a dead band, or little opening"


def turned(command: Plain) -> Plain:
    """Return the settings of a command of the other sign."""
    if isinstance(command["column"], list):
        return command | {"column": command["column"][::-1]}
    offset = {"offset": -command["offset"]} if command.get("offset") else {}
    return command | {"scale": -command.get("scale", 1.0)} | offset
