"""How far the valves of a population open in each step of a quasi-static rollout.

What a valve opens follows from its command alone, whatever the arm does. So the
openings of a population are computed before its arms move, and once for all candidates
whose valve is the same: of two candidates that differ in one parameter, those are all
joints but one.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from collections import deque
from collections.abc import Callable, Iterable

import numpy as np
from numba import njit

from hydroid.arrays import Array, Structs
from hydroid.hydraulics.joint import mean_opening
from hydroid.hydraulics.kernel import SOURCE, Plugin
from hydroid.hydraulics.records import SCRATCH

BEHIND_VALVE = [
    *(
        "damping",
        "stiffness",
        "friction",
        "dry_friction",
        "lever_slope",
        "lever_bend",
        "compensation",
    ),
    *("oil_frequency", "oil_damping", "oil_damping_share"),
    *("ring_cosine", "ring_sine"),
    *("pump_flow", "pump_droop", "pump_limit", "supply_pressure", "relief"),
]
BEHIND_PORT = ["area", "draw", "return_"]
"""what a valve's opening does not depend on, of a joint and of its sides; the others
are taken to matter"""


@njit(cache=True, nogil=True, error_model="numpy")
def _open(valve: Plugin, rest, commands, opening, source: int = SOURCE) -> None:
    """Write the mean opening of one joint's valve in each step, (steps,), from its
    state at rest, (1,)."""
    c, z, w, past = (
        valve.coefficients[0],
        rest[0],
        np.zeros(1, SCRATCH)[0],
        commands.size - opening.size,
    )
    for k in range(opening.size):
        opening[k] = mean_opening(c, z, w, commands, past + k, valve)


def valve_openings(
    plugin: Plugin, states: Structs, commands: Array, run: Callable[..., Iterable[None]]
) -> list[Array]:
    """Return the mean opening of n candidates' valves in each step [m²], shape (steps,
    J) each.

    `states` are those of the start, shape (n, J), and `commands` those of a `Course`.
    `run` is that of a pool. No bit depends on the other candidates.
    """
    alike = plugin.coefficients.copy()
    alike[BEHIND_VALVE] = alike["a"][BEHIND_PORT] = alike["b"][BEHIND_PORT] = 0.0
    keys = [[(j, valve.tobytes()) for j, valve in enumerate(row)] for row in alike]
    owners = {key: i for i, row in enumerate(keys) for key in row}
    curves = {key: np.zeros(len(commands) - plugin.past) for key in owners}

    def open_one(key: tuple[int, bytes]) -> None:
        i, j = owners[key], key[0]
        valve = plugin._replace(coefficients=plugin.coefficients[i, j : j + 1])
        _open(valve, states[i, j : j + 1].copy(), commands[:, j], curves[key])

    driven = set(plugin.order[plugin.idle :].tolist())
    deque(run(open_one, (key for key in curves if key[0] in driven)), maxlen=0)
    return [np.column_stack([curves[key] for key in row]) for row in keys]
