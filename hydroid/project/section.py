"""The `log` section of a fit's settings: guessed from a log, or as a person gave it, joint by joint."""

from collections.abc import Sequence

import numpy as np

from hydroid.errors import LogError, SettingsError
from hydroid.files import Plain
from hydroid.log import ColumnGuess, Table, guess_columns
from hydroid.log.guess import nearest_period
from hydroid.log.rods import rods_of
from hydroid.log.table import Signal
from hydroid.project.columns import holds_numbers
from hydroid.settings.arm import Arm
from hydroid.settings.log import ColumnMap, LogSettings
from hydroid.units import UNITS

PERIOD = 0.02  # of a simulation of quick logs [s]


def guessed_section(table: Table, arm: Arm, order: Sequence[str]) -> ColumnGuess:
    """Guess the columns; joints have the numbers of the arm."""
    names = arm.joint_names
    for name in order:
        if name not in names:
            raise SettingsError(f"no joint {name!r}", "--joints", f"the arm's joints: {', '.join(names)}")
    places = [names.index(name) for name in order or names]
    slides = [k for k, place in enumerate(places, 1) if arm.joints[place].slides]
    rods = rods_of(arm)
    own_rods = {k: rods[place + 1] for k, place in enumerate(places, 1) if place + 1 in rods}
    limited = {k: arm.joints[place] for k, place in enumerate(places, 1) if not arm.joints[place].continuous}
    ranges = {k: joint.limits for k, joint in limited.items()}
    links = [arm.link_names[place] for place in places]
    try:
        section, reasons, unused = guess_columns(
            table, order or names, links=links, slides=slides, rods=own_rods, ranges=ranges
        )
    except LogError:
        if not holds_numbers(table):
            raise
        return ColumnGuess({"joints": {}}, (), ())
    section["period_s"] = _period(section["period_s"])
    entries = {places[k - 1] + 1: entry for k, entry in section["joints"].items()}
    section["joints"] = dict(sorted(entries.items()))
    return ColumnGuess(section, reasons, unused)


def _period(period: float) -> float:
    """Return the period of a simulation [s] for a log's.

    A slow log is simulated in two steps a sample; what a fast one adds is not seen on such machines.
    """
    if period < 0.03:
        return max(period, PERIOD)
    return PERIOD if period < 0.1 else 0.05


def given_section(table: Table, arm: Arm, given: LogSettings) -> Plain:
    """Return what a person says of the columns, joint by joint."""
    entries = dict[int, Plain]()
    for joint in range(1, len(arm.joints) + 1):
        maps = {kind: given.columns(kind, joint) for kind in ("command", "angle", "pressure")}
        own = {kind: _entry(columns) for kind, columns in maps.items() if columns is not None}
        if own:
            entries[joint] = {"command": None, "angle": None} | own
    section = given.model_dump(mode="json", exclude_defaults=True) | {"joints": entries}
    section |= {"time": given.time.model_dump(), "command": None, "angle": None}
    section |= {"pressure": None} if given.pressure is not None else {}
    if "period_s" not in given.model_fields_set:
        (time,) = table.read([Signal(given.time.column, "time", gain=UNITS[given.time.unit].factor)]).values.T
        section["period_s"] = _period(nearest_period(float(np.nanmedian(np.diff(time)))))
    return section


def _entry(columns: ColumnMap) -> Plain:
    one = columns.column[0] if len(columns.column) == 1 else [*columns.column]
    entry: Plain = {"column": one}
    if columns.unit != "%":
        entry["unit"] = columns.unit
    numbers = {"scale": (columns.scale, 1.0), "offset": (columns.offset, 0.0)}
    return entry | {key: value for key, (value, usual) in numbers.items() if value != usual}


def missing_column(section: Plain, *, targets: bool) -> str:
    """Say what no column looks like; empty: there is all that a fit needs. `targets`: there are such."""
    if "time" not in section:
        return "no column looks like a time"
    entries = section["joints"].values()
    for kind in "angle", "command":
        if not any(entry[kind] for entry in entries):
            what = f"no column looks like {'an' if kind == 'angle' else 'a'} {kind}"
            if targets and kind == "command":
                what += ", only like targets of positions: hydroid fits valves"
            return what
    both = any(entry["angle"] and entry["command"] for entry in entries)
    return "" if both else "no joint has both a command and an angle"
