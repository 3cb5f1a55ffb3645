"""A table of unknown columns -> a `log` section that maps them, with a reason for each
guess.

The unit of a column, or else the words of its name, tell what it is; without either,
the bare name of a joint or of what a command moves is its angle's. Its joint is the one
whose name or number its own name holds. Where no column of a kind has a joint they are
given to the joints in order; beside columns that have one, a column without is left out
and named.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import LogError
from hydroid.files import Plain
from hydroid.log.angle_columns import angle_entries
from hydroid.log.clues import column_unit, kind_of
from hydroid.log.columns import Column, rises, signal_columns
from hydroid.log.command_columns import command_entries
from hydroid.log.joint_columns import Joints, by_joint
from hydroid.log.rods import Rod
from hydroid.log.table import Table
from hydroid.units import UNITS, likely_time_unit
from hydroid.words import listed

PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""[s], of which a guess takes the nearest"""
NO_RODS: Mapping[int, Rod] = {}
NO_RANGES: Mapping[int, tuple[float, float]] = {}
NO_ANGLES: Mapping[int, Plain] = {}


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
    table: Table,
    joints: Sequence[str],
    *,
    links: Sequence[str] = (),
    slides: Sequence[int] = (),
    rods: Mapping[int, Rod] = NO_RODS,
    ranges: Mapping[int, tuple[float, float]] = NO_RANGES,
) -> ColumnGuess:
    """Guess which columns are time, commands and angles, of which joints, in which
    units.

    Columns may have the names of the links that the joints move instead; positions of
    joints (from 1) that slide are in m. Lengths of the cylinders of joints, `rods`,
    stand for their angles. Counts of an encoder or a converter are taken for the
    `ranges` of the joints [rad].
    """
    arm = Joints(joints, links, slides, rods, ranges)
    columns = signal_columns(table, (*joints, *links))
    time = _time_column(table, columns)
    step = usual_step(time.values)
    unit = time.unit or likely_time_unit(step) or "s"
    step *= UNITS[unit].factor
    reasons = [f"{time.name}: time in {unit}, every {step:.3g} s"]
    if kind_of(time.name, column_unit(time.name, "")) != "time":
        reasons[0] += ", by its values: no column is called a time"
    commands = by_joint(_of_kind(columns, "command"), arm, reasons)
    angles = by_joint(_of_kind(columns, "angle"), arm, reasons)
    of_commands = command_entries(table, commands)
    of_angles = angle_entries(angles, arm)
    entries = dict[int, Plain]()
    mirrored = dict[int, Plain]()
    for joint in sorted({*angles, *commands}):
        name = arm.names[joint - 1]
        entries[joint] = {"command": None, "angle": None}
        if joint in commands:
            command = of_commands[joint]
            entries[joint]["command"] = command.settings
            reasons.append(command.reason(name, commands[joint].reason))
        if joint in angles:
            angle = of_angles[joint]
            # nothing tells the scale of some sensors: they are left out
            entries[joint]["angle"] = angle.settings or None
            reasons.append(angle.reason(name, angles[joint].reason))
            if angle.mirrored:
                mirrored[joint] = angle.mirrored
    for column in columns:
        if column.kind == "target":
            reasons.append(
                f"{column.name}: a target of a position, no valve's opening; a controller lies between"
            )
    used = {time.name}
    for joint_columns in (*commands.values(), *angles.values()):
        used.update(column.name for column in joint_columns.columns)
    unused = tuple(name for name in table.names if name and name not in used)
    if unused:
        reasons.append(f"not used: {listed(unused)}")
    log: Plain = {
        "time": {"column": time.name, "unit": unit},
        "command": None,
        "angle": None,
        "period_s": nearest_period(step),
        "joints": entries,
    }
    return ColumnGuess(log, tuple(reasons), unused, mirrored)


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
        hint = f"it has {listed([*filter(None, table.names)], 6)}"
        raise LogError("has no column that looks like a time", table.source, hint)
    return max(times, key=lambda column: rises(column.values))


def _of_kind(columns: Sequence[Column], kind: str) -> list[Column]:
    """Return the columns of a kind; lengths last, for a joint whose angle is there
    needs none."""
    alike = [column for column in columns if column.kind == kind]
    return sorted(alike, key=lambda column: column.is_length)
