"""The log as the rest of the program sees it, and what its reader noticed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import LogError

Floats = NDArray[np.float64]
Level = Literal["error", "warning", "note"]

_MAX_NAMED = 3  # logs by name in a line
LONGEST_REST = 2.0
"""of a rest before the first command, what counts for the start pose [s]: a leaking valve lets an arm sink"""


@dataclass(frozen=True, eq=False)
class Log:
    """What was commanded and what was measured, T samples of J joints.

    Attributes:
        source: the file it came from.
        time: [s], shape (T,), k · period from 0.
        command: [%], shape (T, J), in [-100, 100], held until the next sample; 0 where undriven.
        angle: [rad], shape (T, J); a column of NaN where unmeasured.
        period: [s].
        pressure: of chambers A and B [Pa], shape (T, J, 2), NaN where unmeasured; None: the log has none.
        rest: samples before the first command of the recording; None: before the first one in `command`.
    """

    source: str
    time: Floats
    command: Floats
    angle: Floats
    period: float
    pressure: Floats | None = None
    rest: int | None = None

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.command.shape[1]

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Joints that are ever commanded, shape (J,)."""
        return np.any(self.command != 0, axis=0)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Joints whose angle the log holds, shape (J,)."""
        return ~np.isnan(self.angle[0])

    @property
    def start(self) -> Floats:
        """The start pose [rad], shape (J,): the mean of the angles while the arm still rests.

        A simulation starts there, and an error of its start stays in the whole response. A command moves
        nothing before the sample after it; of a log that begins with a command the first sample must do.
        """
        return self._at_rest(self.angle)

    @property
    def start_samples(self) -> Floats:
        """Independent samples whose mean `start` is as precise as, shape (J,): few if the rest drifts."""
        resting = self._resting(self.angle)
        if len(resting) < 3:
            return np.full(self.joints, float(len(resting)))
        off = resting - self._at_rest(self.angle)
        square = np.sum(off**2, axis=0)
        with np.errstate(invalid="ignore"):
            last = np.where(square > 0, np.sum(off[1:] * off[:-1], axis=0) / square, 0.0)
        return len(resting) * (1 - np.clip(last, 0, 1)) / (1 + np.clip(last, 0, 1))

    def moved(self, joint: int, angle: float) -> "Log":
        """Return the recording with all angles of one joint (number, from 1) turned by an angle [rad]."""
        return replace(self, angle=self.angle + angle * (np.arange(self.joints) == joint - 1))

    @property
    def start_pressure(self) -> Floats | None:
        """Chamber pressures before the first command, as `start` [Pa], shape (J, 2), NaN where unmeasured."""
        return None if self.pressure is None else self._at_rest(self.pressure)

    def _at_rest(self, signal: Floats) -> Floats:
        resting = self._resting(signal)
        return resting[0] + (resting - resting[0]).mean(axis=0)  # of equal values to the last bit

    def _resting(self, signal: Floats) -> Floats:
        return signal[: min(self._rest, round(LONGEST_REST / self.period)) + 1]

    @property
    def _rest(self) -> int:
        """Samples before the first command."""
        return int(np.argmax(np.any(self.command != 0, axis=1))) if self.rest is None else self.rest

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    def driving(self, joint: int) -> "Log":
        """Return the recording without the commands of all joints but this one (number, from 1)."""
        command = np.where(np.arange(self.joints) == joint - 1, self.command, 0.0)
        return replace(self, command=command, rest=self._rest)

    def first(self, seconds: float) -> "Log":
        """Return the recording from its start to `seconds` after its first command."""
        begins = int(np.argmax(np.any(self.command != 0, axis=1)))
        part = slice(begins + 1 + max(round(seconds / self.period), 1))
        return replace(
            self,
            time=self.time[part],
            command=self.command[part],
            angle=self.angle[part],
            pressure=None if self.pressure is None else self.pressure[part],
        )


@dataclass(frozen=True)
class Finding:
    """What is wrong or worth knowing, where, and what to do.

    An error: the log cannot be used; a warning: look at it; a note: what the reader did. `line` [1-based] is
    that of the first place, and `column` its name in the header, where there is one. Binary formats have rows
    instead of lines (`place`). `kind` is the same for the same finding in other logs.
    """

    level: Level
    what: str
    source: str
    hint: str = ""
    line: int | None = None
    column: str = ""
    place: str = "line"
    kind: str = ""

    @property
    def where(self) -> str:
        """The file, and the line and column where known."""
        line = f", {self.place} {self.line}" if self.line else ""
        return self.source + line + (f", column {self.column}" if self.column else "")

    def error(self) -> LogError:
        """Return the finding as the error that ends a command."""
        return LogError(self.what, where=self.where, hint=self.hint)

    def __str__(self) -> str:
        return str(self.error())


Warn = Callable[[Finding], None]
"""receives warnings and notes about a log"""


def grouped(findings: Sequence[Finding]) -> list[tuple[Finding, list[str]]]:
    """Return the first finding of each kind, in order, with the other logs that have it too."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.level, finding.kind or finding.what, finding.column), []).append(finding)
    first = [(group[0], dict.fromkeys(f.source for f in group)) for group in groups.values()]
    return [(finding, [log for log in logs if log != finding.source]) for finding, logs in first]


def in_one_line(finding: Finding, others: Sequence[str]) -> str:
    """Return a finding and how many `others` logs have it too, as `grouped` gives them."""
    if not others:
        return str(finding)
    names = ", ".join(Path(log).name for log in others[:_MAX_NAMED])
    names += ", ..." if len(others) > _MAX_NAMED else ""
    return f"{finding} (and in {len(others)} more log{'s' if len(others) > 1 else ''}: {names})"


def numbered(joints: Sequence[int]) -> str:
    """Return "joint 2" or "joints 2, 3"."""
    return f"joint{'' if len(joints) == 1 else 's'} {', '.join(map(str, joints))}"
