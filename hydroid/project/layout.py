"""What a log holds: its columns, and how the joints move in it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hydroid.arrays import record
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log import ColumnGuess, JointMotion, Log, Table, check_log, motion_of
from hydroid.log.clues import column_unit, kind_of
from hydroid.log.read import angle_margin
from hydroid.project.columns import column_lines
from hydroid.project.section import given_section, guessed_section, missing_column
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings
from hydroid.words import listed

REVERSED = (
    "a reversed command suits a valve that is wired the other way. If a sensor counts the other way instead "
    "(compare arm.png), set scale: -1 at its angle and not at its command: gravity follows the angle"
)

SAID = ("row left out", "cut end", "lost", "gap", "half a command", "unasked", "target")
"""kinds of findings that say which part of a log is not read, or not told by it"""
MOVED = 0.5  # travel from which a joint moves [deg]


@record
class Layout:
    """The columns of a log, as the `log` section of a fit's settings, and what its numbers say.

    `outputs` are joints that a log drives and measures, `motions` how the measured ones move, by number from
    1; `reasons` have a line for each column that is not `unused`; `followed`: a joint that no command drives
    moves. `missing` says which columns a person must name, in a section that is then no more than a start;
    `candidates` are lines about what each could be.
    """

    section: Plain
    outputs: tuple[int, ...]
    reasons: tuple[str, ...]
    unused: tuple[str, ...]
    motions: Mapping[int, JointMotion]
    followed: bool
    origin: str = "GUESSED from the log: check every line."
    missing: str = ""
    candidates: tuple[str, ...] = ()


def find_layout(
    table: Table | None,
    arm: Arm,
    order: Sequence[str] = (),
    *,
    given: LogSettings | None = None,
    others: Sequence[Path] = (),
) -> Layout:
    """Guess the columns of a log, turn commands that act against the angle, and see how fast joints are.

    Without a log all joints have a command and an angle, and none is seen to move.

    Args:
        order: names of the arm's joints in the order of the log's numbers; none: the arm's order.
        given: what a person says of the columns, which are not guessed then.
        others: further logs of the same columns; a joint that one of them drives can be fitted.

    Raises:
        SettingsError: no joint has one of the names.
        LogError: no column holds numbers, `given` does not fit the log, or no joint is driven and moves.
    """
    if table is None:
        every = range(1, len(arm.joints) + 1)
        return Layout({"period_s": 0.01, "joints": {}}, tuple(every), (), (), {}, followed=False)
    guess = (
        ColumnGuess(given_section(table, arm, given), (), ()) if given else guessed_section(table, arm, order)
    )
    section, reasons = guess.log, [*guess.reasons]
    if missing := missing_column(section, targets=_has_targets(table)):
        if given is not None:
            raise LogError(
                missing.replace("looks like", "is given as"), table.source, "correct the log section"
            )
        return _skeleton(table, arm, guess, missing)
    entries, names = section["joints"], arm.joint_names
    measured = [joint for joint, entry in entries.items() if entry["angle"]]
    logs = _read(table, section, arm, others, reasons, strict=given is not None)
    motions = {joint: motion_of(logs[0], joint) for joint in measured} if logs else {}
    driven = [joint for joint in measured if entries[joint]["command"] is not None]
    if logs:
        _refuse_rest(table, driven, logs, names)
        idle = [names[j - 1] for j in driven if not any(log.driven[j - 1] for log in logs)]
        driven = [joint for joint in driven if names[joint - 1] not in idle]
        reasons += [f"{listed(idle)}: no command in the logs, so not compared"] if idle else []
    wrong = [j for j, m in motions.items() if m.contradicts(backward=j in arm.backward)]
    for joint, motion in motions.items():
        reasons += _remarks(motion, arm.joints[joint - 1], joint in wrong)
        if joint in wrong:
            entries[joint]["command"] = turned(entries[joint]["command"])
    reasons += [REVERSED] if wrong else []
    for what in "angle", "command":
        lacking = [name for place, name in enumerate(names, 1) if not entries.get(place, {}).get(what)]
        reasons += [f"no {what} found for {listed(lacking)}"] if lacking else []
    followed = any(m.travel > 1 for joint, m in motions.items() if joint not in driven)  # [deg]
    made = Layout(section, tuple(driven), tuple(reasons), guess.unused, motions, followed)
    return made if given is None else replace(made, origin="As you gave them, compared with the log.")


def _has_targets(table: Table) -> bool:
    """Return whether a column seems to hold the position that a controller is to reach."""
    units = {name: column_unit(name, table.units.get(name, "")) for name in table.names if name}
    return any(kind_of(name, unit) == "target" for name, unit in units.items())


def _skeleton(table: Table, arm: Arm, guess: ColumnGuess, missing: str) -> Layout:
    """Return a layout that a person completes: all joints, with placeholders for what is not known."""
    section = guess.log
    entries = {
        joint: dict(section["joints"].get(joint, {"command": None, "angle": None}))
        for joint in range(1, len(arm.joints) + 1)
    }
    for joint, entry in entries.items():
        unit = "m" if arm.joints[joint - 1].slides else "deg"
        entry["command"] = entry["command"] or {"column": "COMMAND", "scale": 1}
        entry["angle"] = entry["angle"] or {"column": "ANGLE", "unit": unit}
    section = {"time": {"column": "TIME", "unit": "s"}, "command": None, "angle": None} | section
    section["joints"] = entries
    lines = column_lines(table)
    return Layout(
        section, tuple(entries), guess.reasons, (), {}, followed=False, missing=missing, candidates=lines
    )


def _read(
    table: Table,
    section: Plain,
    arm: Arm,
    others: Sequence[Path],
    reasons: list[str],
    *,
    strict: bool,
) -> list[Log]:
    """Read logs by a section; an error of the first one is a reason, or ends the command if `strict`."""
    free = dict.fromkeys(arm.joint_names, (-np.inf, np.inf))
    settings, logs = validate(section, LogSettings, table.source), list[Log]()
    for path in (Path(table.source), *others):
        log, findings = check_log(path, settings, free, arm=arm)
        if log is None:
            if strict:
                raise findings[0].error()
            reasons.append(f"the log cannot be used as it is: {findings[0]}")
            log, _ = check_log(path, settings, free, arm=arm, repair=True)
        reasons += [str(one) for one in findings if one.level == "warning" and one.kind in SAID]
        if log is None and path == Path(table.source):
            return []  # what its joints do is not known
        logs += [log] if log else []
    return logs


def _refuse_rest(table: Table, driven: Sequence[int], logs: Sequence[Log], names: Sequence[str]) -> None:
    """Refuse logs in which no joint is driven and moves: nothing can be fitted to them."""
    travels = dict[int, float]()
    for joint in driven:
        moved = [motion_of(log, joint).travel for log in logs if log.driven[joint - 1]]
        if moved:
            travels[joint] = max(moved)
    if any(travel > MOVED for travel in travels.values()):
        return
    hint = (
        "give a log in which it is; or write the project without --log, correct `log` in its fit.yaml, and "
    )
    hint += "go on with --config"
    what = "no command is ever given"
    if travels:
        what = f"{listed([names[joint - 1] for joint in travels])} driven, but nothing moves"
    raise LogError(f"no joint is driven and moves: {what}", table.source, hint)


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
