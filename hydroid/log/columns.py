"""The signals that a file's columns hold, and their values in SI units at the file's own rate."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from hydroid.findings import Level
from hydroid.log.finding import LogFinding, Place
from hydroid.log.log import Floats
from hydroid.log.table import Table
from hydroid.settings.log import Kind, LogSettings
from hydroid.units import UNITS
from hydroid.words import listed

MAX_LISTED = 40  # column names in a message
MAX_MISSING = 4  # missing columns in a message
PRESSURES = (-5e5, 2e8)  # plausible pressures [Pa]: sensors have an offset, hoses burst


@dataclass(frozen=True)
class Signal:
    """One column in use: value = gain · cell + offset in [s], [%], [rad] or [Pa].

    `name` is that in the header, `joint` a number from 1, or 0 for the time. `part` is 0, or 1 for the column
    of a command's negative direction and of the pressure in chamber B.
    """

    name: str
    kind: Literal["time", "command", "angle", "pressure"]
    joint: int = 0
    part: int = 0
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf

    def __str__(self) -> str:
        return f"{self.kind} of joint {self.joint}" if self.joint else self.kind


@dataclass(frozen=True, eq=False)
class Recording:
    """The used columns of one file, R rows of C signals, time first.

    Values are in [s], [%], [rad] or [Pa], shape (R, C), NaN where the file holds no number. `lines`, (R,), is
    the line or row of the file [1-based] of each; `ragged`, (R,), marks rows whose number of cells is wrong.
    `clocks` are the columns of times of day.
    """

    file: Table
    signals: tuple[Signal, ...]
    values: Floats
    lines: NDArray[np.int64]
    ragged: NDArray[np.bool_]
    clocks: frozenset[str] = frozenset()

    @property
    def time(self) -> Floats:
        """Time [s], shape (R,)."""
        return self.values[:, 0]

    def finding(
        self,
        level: Level,
        kind: str,
        rows: Sequence[int] | NDArray[np.int64] = (),
        signal: Signal | None = None,
        **numbers: Any,
    ) -> LogFinding:
        """Make a finding about a signal at the first of `rows`; its number `rows` counts the others."""
        more = ""
        if len(rows) > 1:
            last = f"{self.file.place} {self.lines[rows[-1]]}"
            more = f" (and {len(rows) - 1} more row{'s' if len(rows) > 2 else ''}, to {last})"
        line = int(self.lines[rows[0]]) if len(rows) else None
        place = Place(self.file.source, line, signal.name if signal else "", self.file.place)
        return place.finding(level, kind, [signal] if signal else [], rows=more, **numbers)

    def take(self, rows: NDArray[np.int64]) -> "Recording":
        """Return a copy with these rows, in this order."""
        return replace(self, values=self.values[rows], lines=self.lines[rows], ragged=self.ragged[rows])

    def text(self, row: int, column: int) -> str:
        """Return the cell of a row and a signal as it stands in the file."""
        return self.file.text(int(self.lines[row]), self.signals[column].name)

    def of(self, kind: Kind, joints: int) -> Floats:
        """Return the values of one kind by joint and part, shape (R, J, 2), NaN where the file has none."""
        values = np.full((len(self.values), joints, 2), np.nan)
        for signal, column in zip(self.signals, self.values.T, strict=True):
            if signal.kind == kind:
                values[:, signal.joint - 1, signal.part] = column
        return values


def map_signals(settings: LogSettings, ranges: Floats) -> list[Signal]:
    """Return the signals that the settings ask for, time first; joint ranges [rad], shape (J, 2)."""
    signals = [Signal(settings.time.column, "time", gain=UNITS[settings.time.unit].factor)]
    margin = np.deg2rad(settings.angle_margin_deg)
    for kind in get_args(Kind):
        for joint, (low, high) in enumerate(ranges, 1):
            if columns := settings.columns(kind, joint):
                unit = UNITS[columns.unit.lower()].factor
                lowest = -100.0 if len(columns.column) == 1 else 0.0
                limits = {"command": (lowest, 100.0), "angle": (low - margin, high + margin)}
                signals += [
                    Signal(
                        name,
                        kind,
                        joint,
                        part,
                        columns.scale * unit,
                        columns.offset * unit,
                        *limits.get(kind, PRESSURES),
                    )
                    for part, name in enumerate(columns.column)
                ]
    return signals


def absent_joints(file: Table, wanted: Sequence[Signal], needed: Collection[int]) -> list[int]:
    """Return the joints, other than those `needed`, of which the file has no column though it has others'.

    A column of a similar name speaks against it: it is rather misspelt.
    """
    free = _free(file, wanted)
    there = {s.joint for s in wanted if s.name in file.names or _nearest(s.name, free)} - {0}
    return sorted({s.joint for s in wanted} - there - {0, *needed}) if there else []


def column_faults(file: Table, wanted: Sequence[Signal]) -> list[LogFinding]:
    """Return the columns that are missing or ambiguous."""

    def fault(kind: str, column: str, subjects: Sequence[object] = (), **numbers: float | str) -> LogFinding:
        return Place(file.source, file.header, column).finding("error", kind, subjects, **numbers)

    findings = [_missing(file, wanted)] if any(signal.name not in file.names for signal in wanted) else []
    for name, count in Counter(file.names).items():
        if count > 1 and any(signal.name == name for signal in wanted):
            findings.append(fault("column twice", name, count=count))
    for name, count in Counter(signal.name for signal in wanted).items():
        if count > 1:
            findings.append(fault("shared column", name, [s for s in wanted if s.name == name]))
    return findings


def _missing(file: Table, wanted: Sequence[Signal]) -> LogFinding:
    missing, free = [signal for signal in wanted if signal.name not in file.names], _free(file, wanted)
    named = [f"{signal.name!r} ({signal}{_nearest(signal.name, free)})" for signal in missing]
    joints = [signal.joint for signal in missing if signal.joint]
    remedy = "; for a joint that is not in the log set it to null, such as log.joints.{}=null"
    guess = "; `hydroid convert LOG --out LOG.csv` guesses the columns"
    return Place(file.source, file.header, missing[0].name).finding(
        "error",
        "missing column",
        part="header" if file.header else "file",
        missing=listed(named, MAX_MISSING),
        columns=listed([name for name in file.names if name], MAX_LISTED),
        settings=", ".join(dict.fromkeys(f"log.{signal.kind}" for signal in missing)),
        remedy=(remedy.format(joints[-1]) if joints else "") + (guess if len(joints) < len(missing) else ""),
    )


def read_recording(file: Table, signals: Sequence[Signal]) -> tuple[Recording, list[LogFinding]]:
    """Read the cells of the signals and scale them to SI; a number that is too large counts as none.

    Also returns notes on what the reader did.

    Raises:
        LogError: columns that cannot be read together.
    """
    cells = file.read([s.name for s in signals], {s.name for s in signals if s.kind == "command"})
    gain = np.array([1.0 if signal.name in cells.clocks else signal.gain for signal in signals])
    with np.errstate(all="ignore"):
        values = cells.values * gain + np.array([signal.offset for signal in signals])
        values[~(np.abs(values) < 1e100)] = np.nan
    remarks, place = (*file.remarks, *cells.remarks), Place(file.source)
    notes = [place.finding("note", "layout", what=remark) for remark in remarks]
    return Recording(file, tuple(signals), values, cells.rows, cells.ragged, cells.clocks), notes


def _free(file: Table, wanted: Sequence[Signal]) -> list[str]:
    return sorted(set(file.names).difference(signal.name for signal in wanted))


def _nearest(name: str, names: Sequence[str]) -> str:
    folded = {other.lower(): other for other in names}
    close = get_close_matches(name.lower(), folded, n=1, cutoff=0.75)
    return f", did you mean {folded[close[0]]!r}?" if close else ""
