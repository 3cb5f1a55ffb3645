"""Settings of a log -> the signals that are read, and which columns of a file they
are."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import get_args

import numpy as np

from hydroid.arrays import Limits
from hydroid.errors import LogError
from hydroid.log.conditions import condition_signals, is_condition
from hydroid.log.log import LogFinding, log_finding
from hydroid.log.rods import Rod, rods_of
from hydroid.log.table import Signal, Table
from hydroid.settings.arm import Arm
from hydroid.settings.log import LENGTHS, ColumnMap, Columns, Kind, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed

SHOWN = {"command": "%", "angle": "deg", "length": "mm", "pressure": "bar"}
"""units in which messages state what is measured"""
ALIKE = 0.75
"""least likeness of two names of which one may be the other misspelt, from 0 to 1"""
COMPARED = 10_000
"""columns of a file up to which misspelt names are looked for: no machine logs more,
and of a damaged file that takes long"""

Ranges = Mapping[str, Limits]
"""of all joints [rad, m], by their names"""


def map_signals(
    settings: LogSettings, ranges: Ranges, arm: Arm | None = None
) -> list[Signal]:
    """Return the signals that the settings ask for, time first.

    Raises LogError: lengths stand for the angles of a joint of the arm that no known
    cylinder turns.
    """
    rods: Mapping[int, Rod] = {}
    if arm and _has_lengths(settings):
        rods = rods_of(arm)
    time_unit = UNITS[settings.time.unit]
    # `Table.read` takes the first signal for the time
    time = Signal(
        settings.time.column, "time", gain=time_unit.factor, setting_unit=time_unit
    )
    signals = [time]
    for kind in get_args(Kind):
        for joint, owner in enumerate(ranges, 1):
            columns = settings.columns(kind, joint)
            if columns is None:
                continue
            unit = UNITS[columns.unit.lower()]
            shown = SHOWN[unit.quantity]
            rod = None
            # a length is the position of a joint that slides
            if unit.quantity == "length" and arm and joint not in arm.slides:
                shown = SHOWN["angle"]
                rod = rods.get(joint)
                if rod is None:
                    raise _no_cylinder(columns, owner, arm)
            low, high = _limits(kind, columns, *ranges[owner])
            signal = Signal(
                name="",
                kind=kind,
                joint=joint,
                gain=columns.scale * unit.factor,
                offset=columns.offset * unit.factor,
                low=low,
                high=high,
                unit=shown,
                owner=owner,
                rod=rod,
                setting=_setting(settings, kind, joint, owner),
                setting_unit=unit,
            )
            for part, name in enumerate(columns.column):
                signals.append(replace(signal, name=name, part=part))
    return [*signals, *condition_signals(settings)]


def _setting(settings: LogSettings, kind: Kind, joint: int, owner: str) -> str:
    """Return the key of the settings that name the columns of a joint: its own where it
    has any, as those of all joints do not replace them."""
    of_joint = settings.joints.get(joint)
    if of_joint and getattr(of_joint, kind) != Columns():
        return f"log.joints.{owner}.{kind}"
    return f"log.{kind}"


def angle_margin(low: float, high: float) -> float:
    """Return how far angles may lie outside a range [rad]: sensors are noisy at stops,
    and ranges rough."""
    return max(np.deg2rad(1.0), 0.02 * (high - low))


def _limits(kind: Kind, columns: ColumnMap, low: float, high: float) -> Limits:
    """Return the least and the largest value of a signal of a joint with a range."""
    if kind == "angle":
        margin = angle_margin(low, high)
        return low - margin, high + margin
    if kind == "pressure":
        return -5e5, 2e8  # sensors have an offset, hoses burst
    # each of two columns is for one direction
    if len(columns.column) > 1:
        return 0.0, 100.0
    return -100.0, 100.0


def _has_lengths(settings: LogSettings) -> bool:
    of_all = settings.angle
    of_joints = [columns and columns.angle for columns in settings.joints.values()]
    return any(columns and columns.unit in LENGTHS for columns in (of_all, *of_joints))


def _no_cylinder(columns: ColumnMap, owner: str, arm: Arm) -> LogError:
    names = listed(columns.column)
    what = f"{names} is a length, but no cylinder of {owner} is known"
    return LogError(what, arm.where, f"give {owner} a cylinder with its pivots there")


def measured_signals(table: Table, signals: Sequence[Signal]) -> list[Signal]:
    """Return signals without those of angles and pressures that a file lacks."""
    kept = list[Signal]()
    for signal in signals:
        is_asked = signal.kind in ("time", "command") or is_condition(signal)
        if is_asked or signal.name in table.names:
            kept.append(signal)
    return kept


def match_columns(
    table: Table,
    wanted: Sequence[Signal],
    needed: Collection[int],
    findings: list[LogFinding],
) -> list[Signal]:
    """Return the signals whose columns a file has.

    Joints that are not `needed` may be absent from a file that has columns of others. A
    column of a similar name speaks against it: it is rather misspelt.

    Raises LogError: a column is not there, or stands for several signals.
    """
    used = {signal.name for signal in wanted}
    unused = dict[str, str]()
    for name in sorted({*table.names} - used):
        unused[name.lower()] = name
    misspelt = _misspelt(used - {*table.names}, unused)
    absent = _absent_joints({*table.names, *misspelt}, wanted) - {*needed}
    if absent:
        owners = {signal.joint: signal.owner for signal in wanted}
        names = [owners[joint] for joint in sorted(absent)]
        findings.append(log_finding("note", "absent joints", table.source, *names))
    present = [signal for signal in wanted if signal.joint not in absent]
    for signal in present:
        if signal.name not in table.names:
            raise _lacks_columns(table, present, unused, misspelt)
        _refuse_shared(table, signal, present)
    return present


def _misspelt(names: Collection[str], unused: Mapping[str, str]) -> dict[str, str]:
    """Return, of names that are not in a file, what the file may call them.

    The unused names of the file are those by their lower case.
    """
    misspelt = dict[str, str]()
    if len(unused) > COMPARED:
        return misspelt
    for name in names:
        for alike in get_close_matches(name.lower(), unused, 1, ALIKE):
            misspelt[name] = unused[alike]
    return misspelt


def _absent_joints(names: Collection[str], wanted: Sequence[Signal]) -> set[int]:
    """Return the joints none of whose columns has one of the names.

    There are none in a file that has no column of any joint: it is another file than
    the settings describe.
    """
    joints = {signal.joint for signal in wanted} - {0}
    there = {signal.joint for signal in wanted if signal.name in names} - {0}
    if not there:
        return set()
    return joints - there


def _refuse_shared(table: Table, signal: Signal, wanted: Sequence[Signal]) -> None:
    """Refuse several columns of a name, or several signals in one column."""
    count = table.names.count(signal.name)
    if count > 1:
        what = f"has {count} columns {signal.name!r}"
        raise LogError(what, _header_of(table), "rename all but one")
    sharing = [str(other) for other in wanted if other.name == signal.name]
    if len(sharing) > 1:
        what = f"column {signal.name!r} cannot be {listed(sharing)}"
        hint = "correct log.joints in the config"
        raise LogError(what, _header_of(table), hint)


def _lacks_columns(
    table: Table,
    wanted: Sequence[Signal],
    unused: Mapping[str, str],
    misspelt: Mapping[str, str],
) -> LogError:
    """Return the error about all columns that a file lacks, misspelt ones first."""
    lacking = [signal for signal in wanted if signal.name not in table.names]
    if len(lacking) == len(wanted) and not misspelt and not table.holds_numbers:
        return LogError(
            "holds no table of numbers",
            table.source,
            "give the path of a log, such as a CSV file",
        )
    # only two are named, and those say most
    lacking.sort(key=lambda signal: signal.name not in misspelt)
    descriptions = list[str]()
    for signal in lacking:
        about = str(signal)
        if signal.name in misspelt:
            about += f", did you mean {misspelt[signal.name]!r}?"
        descriptions.append(f"{signal.name!r} ({about})")
    spare = [*filter(None, unused.values())] or ["none"]
    what = f"lacks {listed(descriptions, 2)}; columns without a use: {listed(spare, 3)}"
    settings = listed([*dict.fromkeys(_key(signal) for signal in lacking)])
    hint = (
        f"in the config, set {settings} to the right column, or to null if the log has "
        "none"
    )
    return LogError(what, _header_of(table), hint)


def _key(signal: Signal) -> str:
    """Return the key of the settings that name the column of a signal."""
    return signal.setting or f"log.{signal.kind.replace(' ', '_')}"


def _header_of(table: Table) -> str:
    """Return the place of the names in a file."""
    if table.header:
        return f"{table.source}, line {table.header}"
    return table.source
