"""The columns that settings ask for, and what is wrong with those of a file."""

from collections.abc import Collection, Sequence
from difflib import get_close_matches
from typing import get_args

import numpy as np

from hydroid.log.finding import LogFinding, log_finding
from hydroid.log.log import Floats
from hydroid.log.table import Signal, Table
from hydroid.settings.log import Kind, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed

SHOWN = {"command": "%", "angle": "deg", "length": "mm", "pressure": "bar"}
"""units in which messages state what is measured"""


def map_signals(settings: LogSettings, ranges: Floats) -> list[Signal]:
    """Return the signals that the settings ask for, time first; joint ranges [rad, m], shape (J, 2)."""
    signals = [Signal(settings.time.column, "time", gain=UNITS[settings.time.unit].factor)]
    for kind in get_args(Kind):
        for joint, (low, high) in enumerate(ranges.tolist(), 1):
            if columns := settings.columns(kind, joint):
                margin = angle_margin(low, high)
                limits = {
                    "command": (-100.0 if len(columns.column) == 1 else 0.0, 100.0),
                    "angle": (low - margin, high + margin),
                    "pressure": (-5e5, 2e8),  # sensors have an offset, hoses burst
                }[kind]
                unit = UNITS[columns.unit.lower()]
                gain, offset = columns.scale * unit.factor, columns.offset * unit.factor
                shown = SHOWN[unit.quantity]
                signals += [
                    Signal(name, kind, joint, part, gain, offset, *limits, shown)
                    for part, name in enumerate(columns.column)
                ]
    return signals


def angle_margin(low: float, high: float) -> float:
    """Return how far angles may lie outside a range [rad]: sensors are noisy at stops, and ranges rough."""
    return max(float(np.deg2rad(1.0)), 0.02 * (high - low))


def match_signals(
    table: Table, wanted: Sequence[Signal], needed: Collection[int], findings: list[LogFinding]
) -> list[Signal]:
    """Return the signals whose columns a file has, and add what is wrong with its columns.

    Joints that are not `needed` may be absent from a file that has columns of others. A column of a similar
    name speaks against it: it is rather misspelt.
    """
    free = {name.lower(): name for name in sorted({*table.names} - {signal.name for signal in wanted})}
    missing = [signal for signal in wanted if signal.name not in table.names]
    close = {s.name: free[n] for s in missing for n in get_close_matches(s.name.lower(), free, 1, 0.75)}
    there = {signal.joint for signal in wanted if signal not in missing or signal.name in close} - {0}
    absent = {signal.joint for signal in wanted} - there - {0, *needed} if there else set()
    if absent:
        findings.append(log_finding("note", "absent joints", table.source, sorted(absent)))
    wanted = [signal for signal in wanted if signal.joint not in absent]

    def error(kind: str, column: str, subjects: Sequence[Signal] = (), **numbers: float | str) -> None:
        place = ("line", table.header, column)
        findings.append(log_finding("error", kind, table.source, subjects, place, **numbers))

    if missing := [signal for signal in missing if signal.joint not in absent]:
        guess = {name: f", did you mean {other!r}?" for name, other in close.items()}
        error(
            "missing column",
            missing[0].name,
            missing=listed([f"{s.name!r} ({s}{guess.get(s.name, '')})" for s in missing], 2),
            columns=listed([name for name in table.names if name], 6),
            settings=", ".join(dict.fromkeys(f"log.{signal.kind}" for signal in missing)),
        )
    for name in dict.fromkeys(signal.name for signal in wanted):
        if (count := table.names.count(name)) > 1:
            error("column twice", name, count=count)
        if len(shared := [signal for signal in wanted if signal.name == name]) > 1:
            error("shared column", name, shared)
    return [signal for signal in wanted if signal.name in table.names]
