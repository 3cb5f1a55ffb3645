"""Proportional amplifier (article 2.2): from a voltage to the current of the coil behind it."""

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable

FULL_SCALE = 10.0
"""voltage from which the current is I_max [V], equation (4)"""


@compilable
def coil_current(voltage: Any, current_max: Any, current_min: Any) -> Any:
    """Coil current [A], equation (4): I_min at 0 V, I_max from 10 V on, a straight line between."""
    share = np.minimum(np.maximum(voltage, 0.0), FULL_SCALE) / FULL_SCALE
    return current_min + share * (current_max - current_min)
