"""The log as the rest of the program sees it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @property
    def first_command(self) -> int:
        """Index of the first sample with a command; 0 where there is none."""
        return int(np.argmax(np.any(self.command != 0, axis=1)))

    @property
    def start(self) -> Floats:
        """The start pose [rad], shape (J,): the mean of the angles while the arm still rests.

        A simulation starts there, and an error of its start stays in the whole response. A command moves
        nothing before the sample after it; of a log that begins with a command the first sample must do.
        """
        return self._mean_at_rest(self.angle)

    @property
    def start_pressure(self) -> Floats | None:
        """Chamber pressures before the first command, as `start` [Pa], shape (J, 2), NaN where unmeasured."""
        return None if self.pressure is None else self._mean_at_rest(self.pressure)

    @property
    def start_samples(self) -> Floats:
        """Independent samples whose mean `start` is as precise as, shape (J,): few if the rest drifts."""
        resting = self._at_rest(self.angle)
        if len(resting) < 3:
            return np.full(self.joints, float(len(resting)))
        off = resting - self.start
        square = np.sum(off**2, axis=0)
        with np.errstate(invalid="ignore"):
            correlation = np.where(square > 0, np.sum(off[1:] * off[:-1], axis=0) / square, 0.0).clip(0, 1)
        return len(resting) * (1 - correlation) / (1 + correlation)

    def moved(self, joint: int, angle: float) -> "Log":
        """Return the recording with all angles of one joint (number, from 1) turned by an angle [rad]."""
        return replace(self, angle=self.angle + angle * (np.arange(self.joints) == joint - 1))

    def driving(self, joint: int) -> "Log":
        """Return the recording without the commands of all joints but this one (number, from 1)."""
        rest = self.first_command if self.rest is None else self.rest
        return replace(self, command=self.command * (np.arange(self.joints) == joint - 1), rest=rest)

    def first(self, seconds: float) -> "Log":
        """Return the recording from its start to `seconds` after its first command."""
        end = self.first_command + 1 + max(round(seconds / self.period), 1)
        pressure = None if self.pressure is None else self.pressure[:end]
        cut = {"time": self.time[:end], "command": self.command[:end], "angle": self.angle[:end]}
        return replace(self, **cut, pressure=pressure)

    def part(self, first: int, end: int) -> "Log":
        """Return the samples from `first` to before `end`, which start where they were measured."""
        at = slice(first, end)
        pressure = None if self.pressure is None else self.pressure[at]
        own = {"command": self.command[at], "angle": self.angle[at], "pressure": pressure, "rest": 0}
        return replace(self, time=self.time[at] - self.time[first], **own)

    def _at_rest(self, signal: Floats) -> Floats:
        rest = self.first_command if self.rest is None else self.rest
        longest = round(2.0 / self.period)  # a leaking valve lets an arm sink
        return signal[: min(rest, longest) + 1]

    def _mean_at_rest(self, signal: Floats) -> Floats:
        resting = self._at_rest(signal)
        return resting[0] + (resting - resting[0]).mean(axis=0)  # of equal values to the last bit
