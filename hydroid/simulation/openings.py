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
    *(
        "pump_flow",
        "pump_droop",
        "pump_limit",
        "pump_exponent",
        "pump_bypass",
        "supply_pressure",
        "relief",
    ),
]
BEHIND_PORT = ["area", "draw", "return_"]
"""what a valve's opening does not depend on, of a joint and of its sides; the others
are taken to matter"""

ValveKey = tuple[int, bytes]
"""a joint, and what its opening depends on"""


@njit(cache=True, nogil=True, error_model="numpy")
def _open(valve: Plugin, rest, commands, opening, source: int = SOURCE) -> None:
    """Write the mean opening of one joint's valve in each step, (steps,), from its
    state at rest, (1,)."""
    c = valve.coefficients[0]
    z = rest[0]
    w = np.zeros(1, SCRATCH)[0]
    past = commands.size - opening.size
    for k in range(opening.size):
        opening[k] = mean_opening(c, z, w, commands, past + k, valve)


def _valve_keys(coefficients: Structs) -> list[list[ValveKey]]:
    """Return what the openings of every candidate's joints depend on, of COEFFICIENTS,
    (n, J)."""
    alike = coefficients.copy()
    alike[BEHIND_VALVE] = 0.0
    alike["a"][BEHIND_PORT] = 0.0
    alike["b"][BEHIND_PORT] = 0.0
    keys: list[list[ValveKey]] = []
    for candidate in alike:
        valves = [valve.tobytes() for valve in candidate]
        keys.append([*enumerate(valves)])
    return keys


def valve_openings(
    plugin: Plugin, states: Structs, commands: Array, run: Callable[..., Iterable[None]]
) -> list[Array]:
    """Return the mean opening of n candidates' valves in each step [m²], shape (steps,
    J) each.

    `states` are those of the start, shape (n, J), and `commands` those of a `Course`.
    `run` is that of a pool. No bit depends on the other candidates.
    """
    keys = _valve_keys(plugin.coefficients)
    # the last candidate that has a valve
    owners: dict[ValveKey, int] = {}
    for i, row in enumerate(keys):
        owners |= dict.fromkeys(row, i)
    steps = len(commands) - plugin.past
    openings = {key: np.zeros(steps) for key in owners}

    def open_valve(key: ValveKey) -> None:
        i = owners[key]
        j = key[0]
        valve = plugin._replace(coefficients=plugin.coefficients[i, j : j + 1])
        # the rollout begins from the same state
        rest = states[i, j : j + 1].copy()
        _open(valve, rest, commands[:, j], openings[key])

    driven = set(plugin.order[plugin.idle :].tolist())
    wanted = [key for key in openings if key[0] in driven]
    # the deque takes what the pool returns, so that errors are raised here
    deque(run(open_valve, wanted), maxlen=0)
    return [np.column_stack([openings[key] for key in row]) for row in keys]
