"""The signals that a file's columns hold, and their values in SI units at the file's own rate."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hydroid.log.log import Finding, Floats, Level
from hydroid.log.table import Table
from hydroid.settings.log import SECONDS, LogSettings

_MAX_LISTED = 40  # column names in a message
_MAX_MISSING = 4  # missing columns in a message
_PRESSURES = (-5e5, 2e8)  # plausible pressures [Pa]: sensors have an offset, hoses burst


@dataclass(frozen=True)
class Signal:
    """One column in use: value = gain · cell + offset in [s], [%], [rad] or [Pa].

    `name` is that in the header, `joint` a number from 1, or 0 for the time; `sign` is −1 for the column of a
    command's negative direction; `chamber` of a pressure is 0 for A and 1 for B.
    """

    name: str
    kind: Literal["time", "command", "angle", "pressure"]
    joint: int = 0
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf
    sign: int = 1
    chamber: int = 0

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
        what: str,
        hint: str = "",
        rows: Sequence[int] | NDArray[np.int64] = (),
        signal: Signal | None = None,
        kind: str = "",
    ) -> Finding:
        """Make a finding at the first of `rows` that counts the others."""
        if len(rows) > 1:
            last = f"{self.file.place} {self.lines[rows[-1]]}"
            what += f" (and {len(rows) - 1} more row{'s' if len(rows) > 2 else ''}, to {last})"
        line = int(self.lines[rows[0]]) if len(rows) else None
        column = signal.name if signal else ""
        return Finding(level, what, self.file.source, hint, line, column, self.file.place, kind)

    def take(self, rows: NDArray[np.int64]) -> "Recording":
        """Return a copy with these rows, in this order."""
        return replace(self, values=self.values[rows], lines=self.lines[rows], ragged=self.ragged[rows])

    def signal(self, kind: str, joint: int) -> Signal:
        """Return the first signal of a joint of this kind."""
        return next(signal for signal in self.signals if (signal.kind, signal.joint) == (kind, joint))

    def text(self, row: int, column: int) -> str:
        """Return the cell of a row and a signal as it stands in the file."""
        name = self.signals[column].name
        return self.file.text(int(self.lines[row]), name)

    def motions(self, joints: int | None = None) -> tuple[Floats, Floats]:
        """Return command [%] and angle [rad], shapes (R, J): 0 where undriven, NaN where unmeasured."""
        joints = joints or max(signal.joint for signal in self.signals)
        command = np.zeros((len(self.values), joints))
        angle = np.full((len(self.values), joints), np.nan)
        for signal, values in zip(self.signals, self.values.T, strict=True):
            if signal.kind == "command":
                command[:, signal.joint - 1] += signal.sign * values
            elif signal.kind == "angle":
                angle[:, signal.joint - 1] = values
        return command, angle

    def pressures(self, joints: int) -> Floats | None:
        """Return chamber pressures [Pa], shape (R, J, 2), NaN where unmeasured; None: there are none."""
        pressure = np.full((len(self.values), joints, 2), np.nan)
        measured = [(c, v) for c, v in zip(self.signals, self.values.T, strict=True) if c.kind == "pressure"]
        for signal, values in measured:
            pressure[:, signal.joint - 1, signal.chamber] = values
        return pressure if measured else None


def map_signals(settings: LogSettings, ranges: Floats) -> list[Signal]:
    """Return the signals that the settings ask for, time first; joint ranges [rad], shape (J, 2)."""
    signals = [Signal(settings.time.column, "time", gain=SECONDS[settings.time.unit])]
    margin = np.deg2rad(settings.angle_margin_deg)
    for joint in range(1, len(ranges) + 1):
        if command := settings.command_of(joint):
            signs = zip(command.column, (1, -1), strict=False)
            lowest = -100.0 if len(command.column) == 1 else 0.0
            one = Signal("", "command", joint, command.scale, command.offset, lowest, 100.0)
            signals += [replace(one, name=name, sign=sign) for name, sign in signs]
    for joint, (low, high) in enumerate(ranges, 1):
        if angle := settings.angle_of(joint):
            unit = np.pi / 180 if angle.unit == "deg" else 1.0
            gain, offset = angle.scale * unit, angle.offset * unit
            signals.append(Signal(angle.column, "angle", joint, gain, offset, low - margin, high + margin))
    for joint in range(1, len(ranges) + 1):
        if pressure := settings.pressure_of(joint):
            unit = {"bar": 1e5, "Pa": 1.0, "MPa": 1e6}[pressure.unit]
            one = Signal("", "pressure", joint, pressure.scale * unit, pressure.offset * unit, *_PRESSURES)
            signals += [replace(one, name=name, chamber=k) for k, name in enumerate(pressure.column)]
    return signals


def absent_joints(file: Table, wanted: Sequence[Signal], needed: Collection[int]) -> list[int]:
    """Return the joints, other than those `needed`, of which the file has no column though it has others'.

    A column of a similar name speaks against it: it is rather misspelt.
    """
    free = sorted(set(file.names).difference(signal.name for signal in wanted))
    known = {s.joint for s in wanted if s.name in file.names or _hint(s.name, free)} - {0}
    return sorted({s.joint for s in wanted} - known - {0, *needed}) if known else []


def missing_columns(file: Table, wanted: Sequence[Signal]) -> list[Finding]:
    """Return the columns that are missing or ambiguous."""
    findings: list[Finding] = []
    lacking = [signal for signal in wanted if signal.name not in file.names]
    if lacking:
        free = sorted(set(file.names).difference(signal.name for signal in wanted))
        first = lacking[:_MAX_MISSING]
        names = ", ".join(f"{signal.name!r} ({signal}{_hint(signal.name, free)})" for signal in first)
        names += f" and {len(lacking) - _MAX_MISSING} more" if len(lacking) > _MAX_MISSING else ""
        have = [name for name in file.names if name]
        more = f" and {len(have) - _MAX_LISTED} more" if len(have) > _MAX_LISTED else ""
        keys = ", ".join(dict.fromkeys(f"log.{signal.kind}" for signal in lacking))
        hint = f"the columns are: {', '.join(have[:_MAX_LISTED])}{more}; set the right names in {keys}"
        if joints := [signal.joint for signal in lacking if signal.kind != "time"]:
            hint += (
                f"; for a joint that is not in the log set it to null, such as log.joints.{joints[-1]}=null"
            )
        if any(signal.kind == "time" for signal in lacking):
            hint += "; `hydroid convert LOG --out LOG.csv` guesses the columns"
        what = f"the {'header' if file.header else 'file'} lacks {names}"
        findings.append(
            Finding("error", what, file.source, hint, file.header, lacking[0].name, kind="missing column")
        )
    for name, count in Counter(file.names).items():
        if count > 1 and any(signal.name == name for signal in wanted):
            what = f"has {count} columns of this name"
            findings.append(
                Finding(
                    "error", what, file.source, "rename all but one", file.header, name, kind="column twice"
                )
            )
    for name, count in Counter(signal.name for signal in wanted).items():
        if count > 1:
            users = " and ".join(str(signal) for signal in wanted if signal.name == name)
            what, hint = f"one column cannot be {users}", "correct log.joints in the config"
            findings.append(Finding("error", what, file.source, hint, file.header, name))
    return findings


def read_recording(file: Table, signals: Sequence[Signal]) -> tuple[Recording, list[Finding]]:
    """Read the cells of the signals and scale them to SI; a number that is too large counts as none.

    Also returns notes on what the reader did.

    Raises:
        LogError: columns that cannot be read together.
    """
    held = {signal.name for signal in signals if signal.kind == "command"}
    cells = file.read([signal.name for signal in signals], held)
    gain = np.array([1.0 if signal.name in cells.clocks else signal.gain for signal in signals])
    with np.errstate(all="ignore"):
        values = cells.values * gain + np.array([signal.offset for signal in signals])
        values[~(np.abs(values) < 1e100)] = np.nan
    notes = [Finding("note", remark, file.source, kind=remark) for remark in (*file.remarks, *cells.remarks)]
    return Recording(file, tuple(signals), values, cells.rows, cells.ragged, cells.clocks), notes


def _hint(name: str, names: Sequence[str]) -> str:
    folded = {other.lower(): other for other in names}
    close = get_close_matches(name.lower(), folded, n=1, cutoff=0.75)
    return f", did you mean {folded[close[0]]!r}?" if close else ""
