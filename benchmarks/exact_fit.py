"""What is possible: a machine's own equations, fitted to its logs from the true values.

Such a fit loses nothing to its model, its search or its choices, and shows what
statistics alone leave. Its least squares are of innovations: the error of a joint is
taken for a drift in noise.
"""

from collections.abc import Sequence
from copy import copy
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from stranger import Machine, Recording, errors

from hydroid.arrays import Array

GAIN = 0.02
"""part of the drift that each sample shows"""
SHIFTS = {"dead": 1.0, "delay": 0.01, "friction": 0.02, "lever": 0.05}
"""numbers of a machine to which a step of 1 adds this, in their units"""
FACTORS = (
    "exponent",
    "full",
    "lag",
    "load",
    "stiff",
    "ratio",
    "draw",
    "droop",
    "rises",
)
"""numbers of a machine that a step of 1 multiplies by exp(0.1)"""
LIMITS = {"dead": (0.0, 90.0), "friction": (0.0, 0.9), "lever": (-0.9, 0.9)}
"""A delay has none: below 0, a command acts before the sample that first shows it."""
# step of a derivative: the supply is solved by halves, and has no smaller ones
DIFFERENCE = 0.1
SETTLED = 1e-3
"""relative fall of the sum of squares below which a fit ends"""
MOST_STEPS = 20

Place = tuple[str, tuple[int, ...]]
"""of one number in a machine: name and index"""


def exact_fit(truth: Machine, recordings: Sequence[Recording]) -> Machine:
    """Fit a machine's numbers to recordings of it, from the truth."""
    places = numbers(truth)
    weights = [1.0 / np.std(innovations(truth, one), axis=0) for one in recordings]

    def residual(steps: Array) -> Array:
        machine = moved(truth, places, steps)
        rows = [
            w * innovations(machine, one)
            for w, one in zip(weights, recordings, strict=True)
        ]
        return np.concatenate([row.ravel() for row in rows])

    def jacobian(steps: Array) -> Array:
        here = residual(steps)
        changes = DIFFERENCE * np.eye(len(steps))
        return (
            np.column_stack([residual(steps + change) - here for change in changes])
            / DIFFERENCE
        )

    end = least_squares(
        residual,
        np.zeros(len(places)),
        cast(Any, jacobian),  # scipy's types know no function here
        bounds=np.transpose([limits(truth, place) for place in places]),
        ftol=SETTLED,
        max_nfev=MOST_STEPS,
    )
    return moved(truth, places, end.x)


def respond(machine: Machine, recording: Recording) -> Array:
    """Angles of STEP [rad], (S, J), under a log's commands, interpolated: they depend
    smoothly on delays."""
    commands = [
        np.interp(recording.grid - delay, recording.time, command)
        for delay, command in zip(machine.delay, recording.command.T, strict=True)
    ]
    prompt = copy(machine)
    prompt.delay = np.zeros(machine.joints)
    return prompt.simulate(np.column_stack(commands), recording.start)


def innovations(machine: Machine, recording: Recording) -> Array:
    """What is new in each error of a recording [rad], (T, J): r_k = (1 - K) r_{k-1} +
    e_k - e_{k-1}."""
    error = errors(respond(machine, recording), recording.time, recording.angle)
    return np.asarray(lfilter([1.0, -1.0], [1.0, GAIN - 1.0], error, axis=0))


def numbers(m: Machine) -> list[Place]:
    """The numbers that a machine has."""
    every = [
        (name, place)
        for name in (*SHIFTS, *FACTORS)
        for place in np.ndindex(np.shape(getattr(m, name)))
    ]
    return [(name, place) for name, place in every if is_there(m, name, place)]


def is_there(m: Machine, name: str, place: tuple[int, ...]) -> bool:
    """Whether a number of a machine acts: no lever of a rotary actuator, no load of an
    upright axis.

    Where a valve has a bent curve, that of every valve is sought.
    """
    if name == "draw":
        return m.droop > 0
    if name == "load":
        return not m.vertical[place]
    if name == "rises":
        return m.is_bent
    of = {"ratio": "stiff"}.get(name, name)
    return (
        name not in ("lever", "stiff", "ratio", "droop")
        or np.asarray(getattr(m, of))[place] != 0
    )


def moved(truth: Machine, places: Sequence[Place], steps: Array) -> Machine:
    """Return a machine whose numbers at P places are P steps, (P,), from the true
    ones."""
    names = (*SHIFTS, *FACTORS)
    values = {name: np.array(getattr(truth, name), float) for name in names}
    for (name, place), step in zip(places, steps, strict=True):
        if name in SHIFTS:
            values[name][place] += SHIFTS[name] * step
        else:
            values[name][place] *= np.exp(0.1 * step)
    machine = copy(truth)
    for name in names:
        setattr(machine, name, values[name])
    machine.droop = float(machine.droop)
    return machine


def limits(truth: Machine, place: Place) -> Array:
    """Smallest and largest step of a number from the truth, (2,)."""
    name, index = place
    ends = LIMITS.get(name)
    if ends is None:
        return np.array([-np.inf, np.inf])
    return (np.array(ends) - getattr(truth, name)[index]) / SHIFTS[name]
