"""From the command in % to the current of a coil: calibration (article 2.1) and amplifier (article 2.2).

The calibration of the Compact Field Point lifts the voltage over the valve's dead zone as soon as there is a
command: A and C are the voltages at the smallest command, B and D those at full command. The article
estimates A and C and does not print B and D. 10 V, the amplifier's full scale, is ours. It lets the spool
open over the whole range of the command.
"""

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable, select

FULL_SCALE = 10.0
"""voltage from which the current is I_max [V], equation (4)"""


@compilable
def side_voltage(command: Any, onset: Any, full: Any) -> Any:
    """Voltage of the amplifier that moves the joint in the command's positive direction, (2) and (3).

    For side A give (u, A, B), for side B (-u, C, D).

    Args:
        command: towards this side [%].
        onset: at the smallest command, A or C [V].
        full: at 100 %, B or D [V].

    Returns:
        Voltage [V]; 0 unless the command is positive.
    """
    return select(command > 0.0, onset + command * (full - onset) / 100.0, 0.0)


@compilable
def coil_current(voltage: Any, current_max: Any, current_min: Any) -> Any:
    """Coil current [A], equation (4): I_min at 0 V, I_max from 10 V on, a straight line between."""
    share = np.minimum(np.maximum(voltage, 0.0), FULL_SCALE) / FULL_SCALE
    return current_min + share * (current_max - current_min)
