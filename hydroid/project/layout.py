"""What a log holds: its columns, and how the joints move in it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from hydroid.arrays import Limits, record
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.fitting.valve_start import JointStart, fitted_valve
from hydroid.log import (
    ColumnGuess,
    JointMotion,
    Log,
    Table,
    motion_of,
    stands_still,
)
from hydroid.log.clues import column_unit, kind_of
from hydroid.log.conditions import varies
from hydroid.log.log import LEAST_COMMAND
from hydroid.log.mapping import angle_margin
from hydroid.log.motion import SHORTEST_LOG
from hydroid.progress import Progress, no_progress
from hydroid.project.columns import column_lines
from hydroid.project.logs import Others, reach_of, read_first, read_others
from hydroid.project.mirrored import mirror_sensors, of_other_sign
from hydroid.project.section import (
    given_section,
    guessed_section,
    missing_column,
    simulation_period,
)
from hydroid.settings.arm import Arm, Joint
from hydroid.settings.load import validate
from hydroid.settings.log import EFFECTS, Input, LogSettings, log_file
from hydroid.words import listed

GUESSED = "GUESSED from the log: check every line."
GIVEN = "As you gave them, compared with the log."
UNDRIVEN = "no command in the logs that are fitted, so not compared"
STANDING = (
    "driven, but the angle never changes, so not compared; check the sensor, or its "
    "column in fit.yaml"
)
REVERSED = (
    "a reversed command suits a valve that is wired the other way. If a sensor counts the other "
    "way instead (compare arm.png), set scale: -1 at its angle and not at its command: gravity "
    "follows the angle"
)
QUICKEST = 0.06
"""delay and lag of a joint of which the first samples tell whether it begins at rest
[s]"""
LACKING = {
    (True, False): "no angle found for {}: simulated by the command, and compared with "
    "nothing. If a column holds the angle, name it in fit.yaml (log.joints)",
    (False, True): "no command found for {}: not fitted",
    (False, False): "no command and no angle found for {}: not fitted",
}
"""by whether a joint has a command and an angle"""
SIGNALS = ("signal", "channel", "variable", "tag", "signalname", "name", "kanal")
VALUES = ("value", "val", "wert", "valeur")
"""names of columns in logs that hold one signal per row"""

MOVED = 0.5  # travel from which a joint moves [deg]
FOLLOWS = 0.7  # correlation of a joint's speed with the command that moves it, at least
NOT_FOLLOWS = 0.3  # with one that does not, at most
FOLLOWED = 1.0  # travel above which a joint that no command drives is followed [deg]


@record
class Layout:
    """The columns of a log, as the `log` section of a fit's settings, and what its
    numbers say.

    `outputs` are joints that a log drives and measures; `motions`: how the measured ones
    move in the log that tells most of it, by number from 1; `valves`: those by which
    the outputs follow commands of the sign that these have in the section; `left_out`:
    further logs that cannot be read by it; `reach`: the ends of what joints do in the
    others [rad, m]; `reasons` have a line for each column that is not `unused`;
    `varied`: an engine's speed or an oil's temperature of which the logs hold enough to
    tell its effect; `followed`: a joint that no command drives moves; `missing`: which
    columns a person must name, in a section that is then no more than a start;
    `candidates`: lines about what each could be.
    """

    section: Plain
    outputs: tuple[int, ...]
    reasons: tuple[str, ...]
    unused: tuple[str, ...]
    motions: Mapping[int, JointMotion]
    followed: bool
    valves: Mapping[int, JointStart] = field(default_factory=dict[int, JointStart])
    left_out: tuple[Path, ...] = ()
    reach: Mapping[int, Limits] = field(default_factory=dict[int, Limits])
    origin: str = GUESSED
    varied: tuple[Input, ...] = ()
    missing: str = ""
    candidates: tuple[str, ...] = ()


def find_layout(
    table: Table | None,
    arm: Arm,
    order: Sequence[str] = (),
    *,
    given: LogSettings | None = None,
    others: Others | None = None,
    progress: Progress = no_progress,
) -> Layout:
    """Guess the columns of a log, turn commands that act against the angle,
    and see how fast joints are.

    Without a log all joints have a command and an angle, and none is seen to move.

    Args:
        order: names of the arm's joints in the order of the log's numbers; none: the
            arm's order.
        given: what a person says of the columns, which are not guessed then.
        others: further logs of the same columns; a joint that one of them drives can be
            fitted. One that cannot be read by the columns of the first is left out.
        progress: what is read, or fitted, and how much of it.

    Raises:
        SettingsError: no joint has one of the names.
        LogError: no column holds numbers, `given` does not fit the log,
            or no joint is driven and moves.
    """
    if table is None:
        every = tuple(range(1, len(arm.joints) + 1))
        return Layout(
            {"period_s": 0.01, "joints": {}}, every, (), (), {}, followed=False
        )
    others = others or Others()
    if given is not None:
        guess = _given(table, arm, given)
        layout = _seen(table, arm, guess, others, GIVEN, progress)
        if "period_s" not in given.model_fields_set:
            _set_period(layout, table)
        return layout
    guess = guessed_section([table, *others.tables(progress)], arm, order)
    missing = missing_column(guess.log, targets=_has_targets(table))
    if missing:
        missing = _one_signal_per_row(table) or missing
        return _skeleton(table, arm, guess, missing)
    layout = _seen(table, arm, guess, others, GUESSED, progress)
    _set_period(layout, table)
    return layout


def _set_period(layout: Layout, table: Table) -> None:
    """Set the period of a fit's simulation: where valves open, and how soon joints
    follow, has been seen at a finer one."""
    settings = validate(layout.section, LogSettings, table.source)
    layout.section["period_s"] = simulation_period(table, settings)


def _seen(
    table: Table,
    arm: Arm,
    guess: ColumnGuess,
    others: Others,
    origin: str,
    progress: Progress,
) -> Layout:
    """Return the layout of columns, with what the logs show of the joints' motion."""
    entries = guess.log["joints"]
    reasons = [*guess.reasons]
    if origin == GIVEN:
        # a person who names columns knows which way they count
        settings = validate(guess.log, LogSettings, table.source)
        logs = read_first(table, settings, arm, reasons, progress, strict=True)
    else:
        settings, logs = _mirrored(table, arm, guess, others, reasons, progress)
    measured = [joint for joint, entry in entries.items() if entry["angle"]]
    driven = _with_command(entries, measured)
    left_out = list[Path]()
    reach = dict[int, Limits]()
    motions = dict[int, JointMotion]()
    varied: tuple[Input, ...] = ()
    if logs:
        fitted, unseen, left_out = read_others(
            table, settings, arm, others, reasons, progress
        )
        logs += fitted
        varied = tuple(name for name in EFFECTS if varies(logs, name))
        reach = reach_of([*logs, *unseen], measured)
        motions = {joint: _telling(logs, joint) for joint in measured}
        reasons += _disagreeing(logs, motions, arm)
        reasons += _exchanged(motions, driven, arm.joint_names)
        _refuse_rest(table, driven, logs, arm.joint_names)
        driven = _driven(driven, logs, arm.joint_names, reasons)
    wrong = _turn_commands(entries, motions, reach, arm, reasons)
    reasons += _lacking(entries, arm.joint_names)
    valves = _valves(logs, driven, wrong, progress)
    if origin == GUESSED:
        reasons += _begin_in_motion(guess.log, logs, valves, arm.joint_names)
        _forget_standing(entries, measured, logs)
    undriven = [motion for joint, motion in motions.items() if joint not in driven]
    return Layout(
        guess.log,
        tuple(driven),
        tuple(reasons),
        guess.unused,
        motions,
        followed=any(motion.travel > FOLLOWED for motion in undriven),
        valves=valves,
        left_out=tuple(left_out),
        reach=reach,
        origin=origin,
        varied=varied,
    )


def _begin_in_motion(
    section: Plain,
    logs: Sequence[Log],
    valves: Mapping[int, JointStart],
    names: Sequence[str],
) -> Iterator[str]:
    """Let logs begin in motion where joints seem to, and say so.

    A joint without a delay or a lag also moves at once if it begins at rest.
    """
    joints = list[str]()
    for joint, valve in valves.items():
        # parts behind a gap may always do
        begins = any(log.speed_at_first[joint - 1] for log in logs if not log.begin)
        if begins and valve.delay + valve.lag > QUICKEST:
            joints.append(names[joint - 1])
    if joints:
        section["begins_in_motion"] = True
        yield f"{listed(joints)}: in motion already where a log begins (begins_in_motion)"


def _telling(logs: Sequence[Log], joint: int) -> JointMotion:
    """Return a joint's motion in the log that drives it most, or moves it farthest where
    none does: it may stand in the first one."""
    motions = [motion_of(log, joint) for log in logs]
    most = max(motions, key=lambda motion: motion.push)
    if most.push > 0.0:
        return most
    return max(motions, key=lambda motion: motion.travel)


def _disagreeing(
    logs: Sequence[Log], motions: Mapping[int, JointMotion], arm: Arm
) -> Iterator[str]:
    """Yield which logs turn a joint clearly the other way by its command than the log
    that drives it most."""
    for joint, motion in motions.items():
        one_way = motion.contradicts(backward=False)
        other_way = motion.contradicts(backward=True)
        others = list[str]()
        for log in logs:
            own = motion_of(log, joint)
            turns = own.contradicts(backward=one_way)
            if turns and one_way != other_way:
                others.append(log_file(log.source).name)
        if others:
            name = arm.joint_names[joint - 1]
            most = log_file(motion.log.source).name
            yield (
                f"{name} turns by its command the other way in {listed(sorted({*others}))} than in "
                f"{most}: record these logs alike"
            )


def _exchanged(
    motions: Mapping[int, JointMotion], driven: Sequence[int], names: Sequence[str]
) -> Iterator[str]:
    """Yield which joints follow the command of another joint and not their own."""
    for joint in driven:
        motion = motions[joint]
        if len(driven) < 2 or motion.log.duration < SHORTEST_LOG:
            continue
        others = {other: motion.following(other) for other in driven if other != joint}
        leader = max(others, key=lambda other: others[other])
        if others[leader] > FOLLOWS and motion.following(joint) < NOT_FOLLOWS:
            name, other = names[joint - 1], names[leader - 1]
            yield (
                f"{name} follows the command of {other} and not its own: exchange the angles or the "
                "commands of the two in log.joints of fit.yaml, and run init again with --config"
            )


def _with_command(entries: Mapping[int, Plain], joints: Sequence[int]) -> list[int]:
    return [joint for joint in joints if entries[joint]["command"] is not None]


def _forget_standing(
    entries: dict[int, Plain], joints: Sequence[int], logs: Sequence[Log]
) -> None:
    """Leave out the commands of joints that stand still: a guessed valve would swing a
    joint of which nothing is known."""
    for joint in joints:
        if stands_still(logs, joint):
            entries[joint]["command"] = None


def _mirrored(
    table: Table,
    arm: Arm,
    guess: ColumnGuess,
    others: Others,
    reasons: list[str],
    progress: Progress,
) -> tuple[LogSettings, list[Log]]:
    """Return the settings and logs of guessed columns, those turned round that count
    backwards."""
    settings = validate(guess.log, LogSettings, table.source)
    logs = read_first(table, settings, arm, reasons, progress, strict=False)
    backwards = mirror_sensors(logs, guess, arm, in_range=others.in_range)
    if backwards:
        reasons += backwards
        settings = validate(guess.log, LogSettings, table.source)
        # what it says of the log is the same
        logs = read_first(table, settings, arm, [], progress, strict=False)
    return settings, logs


def _given(table: Table, arm: Arm, given: LogSettings) -> ColumnGuess:
    """Return the columns that a person has named, which must be enough for a fit."""
    section = given_section(table, arm, given)
    missing = missing_column(section, targets=_has_targets(table))
    if missing:
        what = missing.replace("looks like", "is given as")
        raise LogError(what, table.source, "correct the log section")
    return ColumnGuess(section, (), ())


def _driven(
    joints: Sequence[int], logs: Sequence[Log], names: Sequence[str], reasons: list[str]
) -> list[int]:
    """Return the joints that any log drives, by more than the noise of a lever, and
    whose angle changes; of the others say so."""
    idle = list[int]()
    for joint in joints:
        if _largest_command(logs, joint) < LEAST_COMMAND:
            idle.append(joint)
    standing = [k for k in joints if stands_still(logs, k)]
    for left_out, why in ((idle, UNDRIVEN), (standing, STANDING)):
        if left_out:
            reasons.append(f"{listed([names[k - 1] for k in left_out])}: {why}")
    return [k for k in joints if k not in (*idle, *standing)]


def _largest_command(logs: Sequence[Log], joint: int) -> float:
    """Return the largest command of a joint in any log, of either sign [%]."""
    return float(max(np.abs(log.command_of(joint)).max() for log in logs))


def _turn_commands(
    entries: dict[int, Plain],
    motions: Mapping[int, JointMotion],
    reach: Mapping[int, Limits],
    arm: Arm,
    reasons: list[str],
) -> list[int]:
    """Turn commands that act against the angle, and say what else is odd in how joints
    move.

    Returns the joints whose commands were turned.
    """
    wrong = list[int]()
    for joint, motion in motions.items():
        is_wrong = motion.contradicts(backward=joint in arm.backward)
        reasons += _remarks(motion, reach[joint], arm.joint(joint), is_wrong)
        if is_wrong:
            entries[joint]["command"] = turned(entries[joint]["command"])
            wrong.append(joint)
    if wrong:
        reasons.append(REVERSED)
    return wrong


def _valves(
    logs: Sequence[Log],
    joints: Sequence[int],
    wrong: Sequence[int],
    progress: Progress,
) -> dict[int, JointStart]:
    """Return the valves of joints that follow their logged commands.

    `logs` have the commands as they were recorded, of which those of `wrong` joints are
    then turned.
    """
    valves = dict[int, JointStart]()
    for number, joint in enumerate(joints):
        progress("finding starts of valves: joint", number, len(joints))
        valve = fitted_valve(logs, joint)
        if valve is not None:
            valves[joint] = valve.turned if joint in wrong else valve
    return valves


def _lacking(entries: Mapping[int, Plain], names: Sequence[str]) -> Iterator[str]:
    """Yield for which joints the log has no angle, no command, or neither, and what
    that means for them."""
    lacking: dict[tuple[bool, bool], list[str]] = {key: [] for key in LACKING}
    for joint, name in enumerate(names, 1):
        entry = entries.get(joint, {})
        has = bool(entry.get("command")), bool(entry.get("angle"))
        if not all(has):
            lacking[has].append(name)
    for has, joints in lacking.items():
        if joints:
            yield LACKING[has].format(listed(joints))


def _has_targets(table: Table) -> bool:
    """Return whether a column seems to hold the position that a controller is to
    reach."""
    units = {
        name: column_unit(name, table.units.get(name, ""))
        for name in table.names
        if name
    }
    return any(kind_of(name, unit) == "target" for name, unit in units.items())


def _one_signal_per_row(table: Table) -> str:
    """Say that the rows of a table hold a signal's name and its value; "": its columns
    are not called so."""
    by_name = {name.strip().lower(): name for name in table.names}
    for called in SIGNALS:
        for value in VALUES:
            if called in by_name and value in by_name:
                pair = f"{by_name[called]} and {by_name[value]}"
                return (
                    f"a row holds one signal ({pair}), and each signal needs a column"
                )
    return ""


def _skeleton(table: Table, arm: Arm, guess: ColumnGuess, missing: str) -> Layout:
    """Return a layout that a person completes: all joints,
    with placeholders for what is not known."""
    entries = dict[int, Plain]()
    for number, joint in enumerate(arm.joints, 1):
        entry = dict(guess.log["joints"].get(number, {"command": None, "angle": None}))
        entry["command"] = entry["command"] or {"column": "COMMAND", "scale": 1}
        placeholder = {"column": "ANGLE", "unit": joint.shown.setting}
        entry["angle"] = entry["angle"] or placeholder
        entries[number] = entry
    placeholders = {
        "time": {"column": "TIME", "unit": "s"},
        "command": None,
        "angle": None,
    }
    return Layout(
        placeholders | guess.log | {"joints": entries},
        tuple(entries),
        guess.reasons,
        (),
        {},
        followed=False,
        missing=missing,
        candidates=column_lines(table),
    )


def _refuse_rest(
    table: Table, driven: Sequence[int], logs: Sequence[Log], names: Sequence[str]
) -> None:
    """Refuse logs in which no joint is driven, by more than the noise of a lever, and
    moves: nothing can be fitted to them."""
    travels = dict[int, float]()
    most = 0.0
    for joint in driven:
        largest = _largest_command(logs, joint)
        most = max(most, largest)
        moved = [motion_of(log, joint).travel for log in logs if log.drives(joint)]
        if moved and largest >= LEAST_COMMAND:
            travels[joint] = max(moved)
    if any(travel > MOVED for travel in travels.values()):
        return
    what = "no command is ever given"
    if travels:
        what = f"{listed([names[joint - 1] for joint in travels])} driven, but nothing moves"
    elif most > 0.0:
        what = f"the largest command is {most:.2g} %, and below {LEAST_COMMAND:g} % it is none"
        hint = "check the commands' unit and scale: 100 % is full command"
        raise LogError(f"no joint is driven and moves: {what}", table.source, hint)
    hint = (
        "give a log in which a joint moves; or, if its columns were guessed wrongly, write the "
        "project without --log, name them in `log` of its fit.yaml, and repeat init with --config"
    )
    raise LogError(f"no joint is driven and moves: {what}", table.source, hint)


def _remarks(
    motion: JointMotion, reach: Limits, joint: Joint, wrong: bool
) -> Iterator[str]:
    if not joint.continuous:
        yield from _beyond_range(reach, joint)
    if wrong:
        _, against = motion.directed
        share = f"on {max(against, 1 - against):.0%} of its way"
        yield f"{joint.name} moves against its command ({share}): the command's sign is reversed"


def _beyond_range(reach: Limits, joint: Joint) -> Iterator[str]:
    """Yield that what a joint does in the logs is not what the arm allows."""
    low, high = reach
    lowest, highest = joint.limits
    margin = angle_margin(lowest, highest)
    if low >= lowest - margin and high <= highest + margin:
        return
    shown = joint.shown
    ends = f"{shown.in_setting(low):.4g} to {shown.in_setting(high):.4g}"
    allowed = f"{joint.range[0]:.6g} to {joint.range[1]:.6g}"
    yield (
        f"{joint.name}: {shown.word}s in the logs run from {ends} {shown.setting}, but the arm "
        f"allows {allowed}: correct their scale (-1 if they count backwards) and offset, or the "
        "range in arm.xml"
    )


def turned(command: Plain) -> Plain:
    """Return the settings of a command of the other sign."""
    columns = command["column"]
    # the positive and the negative direction
    if isinstance(columns, list):
        return command | {"column": columns[::-1]}
    return of_other_sign(command)
