"""The start of a run: chamber pressures that hold the arm (the article does not say)."""

from typing import Any

import numpy as np


def holding_pressures(
    force: Any, area_a: Any, area_b: Any, supply: Any, tank: Any, level: Any
) -> tuple[Any, Any]:
    """Pressures p_A, p_B [Pa] with A_A p_A − A_B p_B = force, elementwise.

    Balance leaves their common level open: p_B is `level`, raised or lowered until both pressures lie between
    tank and supply. A load too heavy for that gets the pressures nearest to it that hold, one of them above
    supply.

    Args:
        force: on the rod [N]; of a rotary actuator the torque [N·m].
        area_a: A_A [m²], or D_m [m³/rad].
        area_b: A_B, likewise.
        supply: p_S [Pa].
        tank: p_T [Pa].
        level: wanted p_B [Pa].
    """
    low = np.maximum(tank, (area_a * tank - force) / area_b)
    high = np.minimum(supply, (area_a * supply - force) / area_b)
    pressure_b = np.maximum(low, np.minimum(high, level))
    return (force + area_b * pressure_b) / area_a, pressure_b
