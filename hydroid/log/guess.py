"""A table of unknown columns -> a `log` section that maps them, with a reason for each
guess.

The unit of a column, or else the words of its name, tell what it is; without either,
the bare name of a joint or of what a command moves is its angle's. Its joint is the one
whose name or number its own name holds. Where no column of a kind has a joint they are
given to the joints in order; beside columns that have one, a column without is left out
and named.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.angle_columns import angle_entries
from hydroid.log.clues import (
    CLUES,
    column_unit,
    command_rank,
    is_counter,
    kind_of,
    words,
)
from hydroid.log.columns import Column, Entry, beside, rises, signal_columns
from hydroid.log.command_columns import command_entries
from hydroid.log.condition_columns import guess_conditions
from hydroid.log.joint_columns import Assignment, Joints, by_joint
from hydroid.log.rods import Rod
from hydroid.log.table import Signal, Table
from hydroid.units import UNITS, likely_time_unit
from hydroid.words import listed

PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""[s], of which a guess takes the nearest"""
NO_RODS: Mapping[int, Rod] = {}
NO_RANGES: Mapping[int, tuple[float, float]] = {}
NO_ANGLES: Mapping[int, Plain] = {}
NOTHING = Entry({}, "")
"""in place of a column that a joint does not have"""


class ColumnGuess(NamedTuple):
    """What the columns of a log seem to hold: the `log` section of a fit's settings,
    and the unused columns.

    A reason stands for each column that it uses, for what is uncertain, and for the
    others. `mirrored`: settings of the angles, by joint, whose sensors have no known
    scale, for sensors that count the other way.
    """

    log: Plain
    reasons: tuple[str, ...]
    unused: tuple[str, ...]
    mirrored: Mapping[int, Plain] = NO_ANGLES


def guess_columns(
    tables: Sequence[Table],
    joints: Sequence[str],
    *,
    links: Sequence[str] = (),
    slides: Sequence[int] = (),
    rods: Mapping[int, Rod] = NO_RODS,
    ranges: Mapping[int, tuple[float, float]] = NO_RANGES,
) -> ColumnGuess:
    """Guess which columns of the first table are time, commands and angles, of which
    joints, in which units.

    Columns may have the names of the links that the joints move instead; positions of
    joints (from 1) that slide are in m. Lengths of the cylinders of joints, `rods`,
    stand for their angles. Counts of an encoder or a converter are taken for the
    `ranges` of the joints [rad], from the lowest to the highest of all tables. A command
    that the first table does not give has the range of the first one that does.
    """
    table, *further = tables
    arm = Joints(joints, links, slides, rods, ranges)
    columns = beside(signal_columns(table, (*joints, *links)), further)
    time = _time_column(table, columns)
    step = usual_step(time.values)
    unit = time.unit or likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    reasons = [f"{time.name}: time in {unit}, every {step:.3g} s"]
    if kind_of(time.name, column_unit(time.name, "")) != "time":
        reasons[0] += ", by its values: no column is called a time"
    commands = by_joint(_of_kind(columns, "command"), arm, reasons)
    angles = by_joint(_of_kind(columns, "angle"), arm, reasons)
    of_commands = command_entries(tables, commands)
    of_angles = angle_entries(angles, arm)
    reasons += _joint_reasons(arm, (commands, of_commands), (angles, of_angles))
    reasons += _target_reasons(columns)
    unused = _unused(table, time, (*commands.values(), *angles.values()))
    used = {*table.names} - {*unused}
    conditions = _condition_settings(tables, (*joints, *links), used, reasons)
    taken = [settings["column"] for settings in conditions.values()]
    unused = tuple(name for name in unused if name not in taken)
    reasons += _direction_reasons(table, unused)
    if unused:
        reasons.append(f"not used: {listed(unused)}")
    log: Plain = {
        "time": {"column": time.name, "unit": unit},
        "command": None,
        "angle": None,
        **conditions,
        "period_s": nearest_period(step),
        "joints": _joint_settings(of_commands, of_angles),
    }
    return ColumnGuess(log, tuple(reasons), unused, _mirrored(of_angles))


def _target_reasons(columns: Sequence[Column]) -> list[str]:
    """Return why columns that hold a controller's targets are not used."""
    what = "a position target of a controller, not a valve's opening"
    return [f"{column.name}: {what}" for column in columns if column.kind == "target"]


def _direction_reasons(table: Table, unused: Sequence[str]) -> Iterator[str]:
    """Yield which unused columns of two values may hold the direction of a command."""
    for name in unused:
        if {*words(name)}.isdisjoint(CLUES["direction"]) or name not in table.columns:
            continue
        values = _numbers(table, name)
        if len(np.unique(values[np.isfinite(values)])) == 2:
            yield (
                f"{name}: like the direction of a command; no setting joins two columns so: write a "
                "column of signed commands"
            )


def _condition_settings(
    tables: Sequence[Table],
    names: Sequence[str],
    used: Collection[str],
    reasons: list[str],
) -> dict[str, Plain]:
    """Return the settings of the columns that hold what the machine works under, by
    quantity, and add the reasons.

    `names`: of joints and links; columns that are `used` hold something else.
    """
    conditions = dict[str, Plain]()
    for guess in guess_conditions(tables, names, used):
        reasons.append(guess.reason)
        if guess.settings:
            conditions[guess.name] = guess.settings
    return conditions


def _mirrored(angles: Mapping[int, Entry]) -> dict[int, Plain]:
    """Return the settings of angles that may be counted the other way, by joint."""
    mirrored = dict[int, Plain]()
    for joint, angle in angles.items():
        if angle.mirrored:
            mirrored[joint] = angle.mirrored
    return mirrored


def _unused(
    table: Table, time: Column, assigned: Sequence[Assignment]
) -> tuple[str, ...]:
    """Return the names of the columns that are neither the time nor a joint's."""
    used = {time.name}
    for assignment in assigned:
        used.update(column.name for column in assignment.columns)
    return tuple(name for name in table.names if name and name not in used)


def _joint_reasons(
    arm: Joints, *kinds: tuple[Mapping[int, Assignment], Mapping[int, Entry]]
) -> list[str]:
    """Return why columns of some kinds, here commands and angles, are taken for what
    they are, joint by joint."""
    joints = set[int]()
    for assigned, _ in kinds:
        joints.update(assigned)
    reasons = list[str]()
    for joint in sorted(joints):
        for assigned, entries in kinds:
            if joint in assigned:
                why = assigned[joint].reason
                reasons.append(entries[joint].reason(arm.names[joint - 1], why))
    return reasons


def _joint_settings(
    commands: Mapping[int, Entry], angles: Mapping[int, Entry]
) -> dict[int, Plain]:
    """Return the settings of the joints' columns, by joint; null: it has none, or one
    of which nothing tells the scale."""
    settings = dict[int, Plain]()
    for joint in sorted({*commands, *angles}):
        command = commands.get(joint, NOTHING)
        angle = angles.get(joint, NOTHING)
        settings[joint] = {
            "command": command.settings or None,
            "angle": angle.settings or None,
        }
    return settings


def usual_step(times: Array) -> float:
    """Return the median of the differences of times, (T,), that are numbers; 0 where
    there is none."""
    steps = np.diff(times)
    known = steps[np.isfinite(steps)]
    return float(np.median(known)) if known.size else 0.0


def nearest_period(step: float) -> float:
    """Return the usual period that is most like a log's [s]."""

    def ratio(period: float) -> float:
        # a step may be 0 where the clock is coarse
        smaller = max(min(period, step), 1e-9)
        return max(period, step) / smaller

    return min(PERIODS, key=ratio)


def _time_column(table: Table, columns: Sequence[Column]) -> Column:
    """Return the first column of times that rises, or else the first one.

    Raises LogError: there is none.
    """
    times = [column for column in columns if column.kind == "time"]
    if not times:
        hint = "; ".join(counter_reasons(table))
        hint = hint or f"it has {listed([*filter(None, table.names)], 6)}"
        if not any(map(len, table.columns.values())):
            hint = "no rows of numbers follow the names of its columns"
        raise LogError("has no column that looks like a time", table.source, hint)
    return max(times, key=lambda column: rises(column.values))


def _numbers(table: Table, name: str) -> Array:
    """Return the cells of a column, (R,); none where it holds no numbers."""
    try:
        return table.read([Signal(name, "command")]).time
    except LogError:
        return np.zeros(0)


def counter_reasons(table: Table) -> Iterator[str]:
    """Yield why columns that count samples or cycles are no times."""
    for name in table.names:
        unit = column_unit(name, table.units.get(name, ""))
        if name not in table.columns or not is_counter(name, unit):
            continue
        # an encoder's counts do not only rise
        if rises(_numbers(table, name)):
            yield (
                f"{name} counts, and nothing tells the time of a count: log a time, or add its unit "
                f"to the name, such as {name}_ms where a count is 1 ms"
            )


def _of_kind(columns: Sequence[Column], kind: str) -> list[Column]:
    """Return the columns of a kind, those first that a joint rather has: what reaches a
    valve before what a person asks for; lengths last, for a joint whose angle is there
    needs none."""
    alike = [column for column in columns if column.kind == kind]
    if kind == "command":
        return sorted(alike, key=lambda column: command_rank(column.name))
    return sorted(alike, key=lambda column: column.is_length)
