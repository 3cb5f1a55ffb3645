"""Functions written once for Python and for a compiled loop.

A component's law is a plain Python function of floats; one that no branch depends on
takes arrays that broadcast, too (population axis first). Marked `compilable`, the very
same function is compiled into the kernel.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba.extending import register_jitable

from hydroid.arrays import Array

F = TypeVar("F", bound=Callable[..., Any])


def compilable(function: F) -> F:
    """Let compiled code call `function`; for Python it stays what it is."""
    return register_jitable(function)


@compilable
def implicit_weight(speed) -> Any:
    """Weight of the new state in a linearised step, from rate times step
    (dimensionless).

    One half, the second-order trapezoidal rule, while the step resolves the rate;
    towards one, backward Euler, where it does not, which is the least weight that keeps
    a decay free of overshoot.
    """
    return 1.0 - 1.0 / np.maximum(speed, 2.0)


@compilable
def kept(steps) -> Any:
    """Part of its error that a first-order lag of so many steps leaves after one."""
    # no lag: exp(-1e300) is 0, and nothing divides by 0
    return np.exp(-1.0 / np.maximum(steps, 1e-300))


def ringing(frequency: Array, ratio: Array, step: float) -> tuple[Array, Array]:
    """What a damped oscillation leaves after a step [s]: factors C and S [s] that
    `overshoot` takes.

    frequency: without damping [Hz]; of an infinite one they mean nothing. ratio: of the
    damping, below 1.
    """
    pace = 2.0 * np.pi * np.where(np.isfinite(frequency), frequency, 0.0)
    turn = pace * np.sqrt(1.0 - ratio**2) * step
    decay = np.exp(-ratio * pace * step)
    sine = decay * step * np.sinc(turn / np.pi)
    cosine = decay * np.cos(turn) - ratio * pace * sine
    return cosine, sine
