"""Compact Field Point (article 2.1): from the command in % to the voltage of each side's amplifier.

A and C lift the voltage over the valve's dead zone as soon as there is a command; B and D are the voltages at
full command. The article estimates A and C and does not print B and D: 10 V, the amplifier's full scale,
is ours, and lets the spool open over the whole range of the command.
"""

from typing import Any

from hydroid.hydraulics.elementwise import compilable, select


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
