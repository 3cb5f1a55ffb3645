"""How far the valves of a population open in each step of a quasi-static rollout.

What a valve opens follows from its command alone, whatever the arm does. So the
openings of a population are computed before its arms move, and once for all candidates
whose valve is the same: of two candidates that differ in one parameter, those are all
joints but one. What moves the plunger of a side is computed first, once for all whose
plunger and coil are the same, whatever the spool opens.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from collections import deque
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
from numba import njit

from hydroid.arrays import Array, Structs
from hydroid.hydraulics.joint import (
    command,
    mean_opening,
    move_plunger,
    spool_opening,
)
from hydroid.hydraulics.kernel import SOURCE, Plugin
from hydroid.hydraulics.records import SCRATCH
from hydroid.hydraulics.valve import KNOTS

HELD = 4.0
"""for which a command has been held before a log that begins in motion [s]"""
Run = Callable[..., Iterable[None]]
"""a pool's: runs a function for each of some values, maybe at the same time"""
BEHIND_VALVE = [
    *(
        "damping",
        "stiffness",
        "friction",
        "dry_friction",
        "lever_slope",
        "lever_bend",
        "compensation",
        "by_command",
    ),
    *("engine_exponent", "temperature_effect"),
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

BEHIND_PLUNGER = ["opening_keep", "opening_steps", "lag_of_speed"]
BEHIND_SPOOL = [
    *("opening", "opening_exponent", "overlap", "slot_width", "lagging", "has_curve"),
    *(f"curve_{k}" for k in range(1, len(KNOTS) + 1)),
    *(f"knot_{k}" for k in range(1, len(KNOTS) + 1)),
]
"""what the strokes of its plungers do not depend on besides, of a joint and of its
sides"""


@njit(cache=True, nogil=True, error_model="numpy")
def _push(
    valve: Plugin, rest, commands, side_a: bool, strokes, source: int = SOURCE
) -> None:
    """Write the mean strokes of the plunger of side A, or B, in each sub-step, (steps,
    sub-steps), from a joint's state at rest, (1,)."""
    c = valve.coefficients[0]
    z = rest[0]
    w = np.zeros(1, SCRATCH)[0]
    step = valve.period / valve.substeps
    past = commands.size - strokes.shape[0]
    for k in range(strokes.shape[0]):
        command(c, z, w, commands, past + k)
        for i in range(valve.substeps):
            if side_a:
                strokes[k, i] = move_plunger(c, c.a, z.a, w.a, i, step)
            else:
                strokes[k, i] = move_plunger(c, c.b, z.b, w.b, i, step)


@njit(cache=True, nogil=True, error_model="numpy")
def _open(
    valve: Plugin, rest, strokes_a, strokes_b, opening, source: int = SOURCE
) -> None:
    """Write the mean opening of one joint's valve in each step, (steps,), from the
    strokes of its plungers, (steps, sub-steps)."""
    c = valve.coefficients[0]
    z = rest[0]
    for k in range(opening.size):
        net = 0.0
        for i in range(valve.substeps):
            net += spool_opening(c, z, strokes_a[k, i] - strokes_b[k, i])
        opening[k] = net / valve.substeps


@njit(cache=True, nogil=True, error_model="numpy")
def _hold(plugin: Plugin, state, held, steps: int, source: int = SOURCE) -> None:
    """Advance the valves of one candidate's driven joints, in state, (J,), under
    commands that are held [%], (past + 1, J), for some steps."""
    pad = np.zeros(1, SCRATCH)
    for a in range(plugin.idle, plugin.order.size):
        j = plugin.order[a]
        if held[0, j] != 0.0:
            for _ in range(steps):
                mean_opening(
                    plugin.coefficients[j],
                    state[j],
                    pad[0],
                    held[:, j],
                    held.shape[0] - 1,
                    plugin,
                )


def hold_valves(plugin: Plugin, states: Structs, command: Array) -> None:
    """Let the valves of n candidates settle under commands [%], (J,), held for HELD:
    changes their states at rest, (n, J), of joints whose command is not 0."""
    if not command.any():
        return
    held = np.tile(command, (plugin.past + 1, 1))
    for i, state in enumerate(states):
        _hold(plugin.candidate(i), state, held, round(HELD / plugin.period))


def _valves(coefficients: Structs) -> Structs:
    """Return what the openings of every candidate's joints depend on, of COEFFICIENTS,
    (n, J), alone: all else is 0."""
    valves = coefficients.copy()
    valves[BEHIND_VALVE] = 0.0
    for side in "ab":
        valves[side][BEHIND_PORT] = 0.0
    return valves


def _plungers(valves: Structs, side: str) -> Structs:
    """Return the same for the strokes of one side's plungers."""
    plungers = valves.copy()
    plungers[BEHIND_PLUNGER] = 0.0
    plungers[side][BEHIND_SPOOL] = 0.0
    plungers["b" if side == "a" else "a"] = 0.0
    return plungers


def _of_each(
    depends_on: Structs,
    driven: set[int],
    make: Callable[[int, int], Array],
    run: Run,
) -> list[list[Array | None]]:
    """Return what `make` gives for every candidate's driven joints, by both numbers:
    once for those of a joint that are alike in what it depends on, (n, J) of
    COEFFICIENTS."""
    keys = [[*enumerate(one.tobytes() for one in row)] for row in depends_on]
    # the last candidate that has it
    owners = dict[tuple[int, bytes], int]()
    for i, row in enumerate(keys):
        owners |= {key: i for key in row if key[0] in driven}
    made = dict[tuple[int, bytes], Array]()

    def make_once(key: tuple[int, bytes]) -> None:
        made[key] = make(owners[key], key[0])

    # the deque takes what the pool returns, so that errors are raised here
    deque(run(make_once, owners), maxlen=0)
    return [[made.get(key) for key in row] for row in keys]


def valve_openings(
    plugin: Plugin, states: Structs, commands: Array, run: Run
) -> list[Array]:
    """Return the mean opening of n candidates' valves in each step [m²], shape (steps,
    J) each.

    `states` are those of the start, shape (n, J), and `commands` those of a `Course`.
    `run` is that of a pool. No bit depends on the other candidates.
    """
    driven = set(plugin.order[plugin.idle :].tolist())
    steps = len(commands) - plugin.past
    # of one layout, for which `_push` is compiled once
    by_joint = np.ascontiguousarray(commands.T)
    valves = _valves(plugin.coefficients)

    def of_joint(i: int, j: int) -> tuple[Plugin, Structs]:
        """Return the valve of a candidate's joint, and its state at rest."""
        valve = plugin._replace(coefficients=plugin.coefficients[i, j : j + 1])
        # the rollout begins from the same state
        return valve, states[i, j : j + 1].copy()

    def push(i: int, j: int, side: str) -> Array:
        strokes = np.empty((steps, plugin.substeps))
        _push(*of_joint(i, j), by_joint[j], side == "a", strokes)
        return strokes

    strokes_a, strokes_b = (
        _of_each(_plungers(valves, side), driven, partial(push, side=side), run)
        for side in "ab"
    )

    def open_valve(i: int, j: int) -> Array:
        opening = np.zeros(steps)
        _open(*of_joint(i, j), strokes_a[i][j], strokes_b[i][j], opening)
        return opening

    shut = np.zeros(steps)
    openings = _of_each(valves, driven, open_valve, run)
    return [
        np.column_stack([shut if one is None else one for one in row])
        for row in openings
    ]
