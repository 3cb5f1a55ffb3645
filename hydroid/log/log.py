"""The log as the rest of the program sees it: commands and angles at one period."""

from dataclasses import dataclass

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
    """

    source: str
    time: Floats
    command: Floats
    angle: Floats
    period: float
    pressure: Floats | None = None

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
