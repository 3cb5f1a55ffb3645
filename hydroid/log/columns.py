"""The columns that settings ask for, and what is wrong with those of a file."""

from collections.abc import Collection, Sequence
from difflib import get_close_matches
from typing import get_args

import numpy as np

from hydroid.log.finding import LogFinding, found
from hydroid.log.log import Floats
from hydroid.log.table import Signal, Table
from hydroid.settings.log import Kind, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed


def map_signals(settings: LogSettings, ranges: Floats) -> list[Signal]:
    """Return the signals that the settings ask for, time first; joint ranges [rad], shape (J, 2)."""
    signals = [Signal(settings.time.column, "time", gain=UNITS[settings.time.unit].factor)]
    margin = np.deg2rad(settings.angle_margin_deg)
    for kind in get_args(Kind):
        for joint, (low, high) in enumerate(ranges, 1):
            if columns := settings.columns(kind, joint):
                unit = UNITS[columns.unit.lower()].factor
                limits = {
                    "command": (-100.0 if len(columns.column) == 1 else 0.0, 100.0),
                    "angle": (low - margin, high + margin),
                    "pressure": (-5e5, 2e8),  # sensors have an offset, hoses burst
                }[kind]
                gain, offset = columns.scale * unit, columns.offset * unit
                signals += [
                    Signal(name, kind, joint, part, gain, offset, *limits)
                    for part, name in enumerate(columns.column)
                ]
    return signals


def match_signals(
    table: Table, wanted: Sequence[Signal], needed: Collection[int]
) -> tuple[list[Signal], list[LogFinding]]:
    """Return the signals whose columns a file has, and what is wrong with its columns.

    Joints that are not `needed` may be absent from a file that has columns of others. A column of a similar
    name speaks against it: it is rather misspelt.
    """
    place, findings = ("line", table.header, ""), list[LogFinding]()
    free = {name.lower(): name for name in sorted({*table.names} - {signal.name for signal in wanted})}
    missing = [signal for signal in wanted if signal.name not in table.names]
    close = {s.name: get_close_matches(s.name.lower(), free, n=1, cutoff=0.75) for s in missing}
    there = {signal.joint for signal in wanted if signal not in missing or close[signal.name]} - {0}
    absent = {signal.joint for signal in wanted} - there - {0, *needed} if there else set()
    if absent:
        findings.append(found("note", "absent joints", table.source, sorted(absent)))
    if missing := [signal for signal in missing if signal.joint not in absent]:
        guesses = {name: f", did you mean {free[names[0]]!r}?" for name, names in close.items() if names}
        named = [f"{s.name!r} ({s}{guesses.get(s.name, '')})" for s in missing]
        joints = [signal.joint for signal in missing if signal.joint]
        remedy = "; for a joint that is not in the log set it to null, such as log.joints.{}=null"
        guess = "; `hydroid convert LOG --out LOG.csv` guesses the columns"
        numbers = {
            "part": "header" if table.header else "file",
            "missing": listed(named, 4),
            "columns": listed([name for name in table.names if name], 40),
            "settings": ", ".join(dict.fromkeys(f"log.{signal.kind}" for signal in missing)),
            "remedy": (remedy.format(joints[-1]) if joints else "")
            + (guess if len(joints) < len(missing) else ""),
        }
        place = ("line", table.header, missing[0].name)
        findings.append(found("error", "missing column", table.source, (), place, **numbers))
    wanted = [signal for signal in wanted if signal.joint not in absent]
    for name in dict.fromkeys(signal.name for signal in wanted):
        place, count = ("line", table.header, name), table.names.count(name)
        if count > 1:
            findings.append(found("error", "column twice", table.source, (), place, count=count))
        if len(shared := [signal for signal in wanted if signal.name == name]) > 1:
            findings.append(found("error", "shared column", table.source, shared, place))
    return [signal for signal in wanted if signal.name in table.names], findings
