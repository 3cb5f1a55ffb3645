"""The law of each rung: how its arm rolls, and how fast its joints move once they have
settled.

A law is made of `compilable` functions. Whoever needs them compiled in a loop makes
that loop for each law: numba's cache takes no function that is handed over, but knows
those in a closure.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from collections.abc import Callable
from typing import Any, NamedTuple

from hydroid.hydraulics.elementwise import compilable
from hydroid.rungs import DYNAMIC, GAIN, QUASI_STATIC, Rung
from hydroid.simulation.quasi_static import (
    lone_quasi_static,
    quasi_static_rod,
    roll_quasi_static,
)
from hydroid.simulation.rollout import roll
from hydroid.simulation.steady import dynamic_rod, is_pushed, lone_dynamic


@compilable
def is_as_fast(rod, c, w, wished: float, supply: float) -> bool:
    """Whether a rod moves at least as fast as wished [m/s], in that direction."""
    sign = 1.0 if wished > 0.0 else -1.0
    return sign * rod(c, w, supply)[0] >= abs(wished)


class Law(NamedTuple):
    """The law of a rung.

    Scratch space w has the valve's net opening `open_area` [m²] under a held command,
    and load, damping and lever of the pose, as `cylinder.weigh` writes them.

    Attributes:
        roll: the rollout, with the arguments of `rollout.roll`.
        rod: (c, w, supply) to the settled speed of a rod [m/s], above 0 towards A, and
            the flow that it takes from the line [m³/s], at the supply's pressure [Pa].
            None: commands lead to no speed.
        reaches: (rod, c, w, wished, supply) to whether the rod is at least as fast as
            wished [m/s]: where that is known without its speed.
        lone: (coefficients, pad, angle, loads) to the velocity [rad/s] of the only
            joint on the pump, at an angle [rad], under loads [N·m], (3,): NEAR before
            the angle, there, and behind. None: `rod` and the pump tell it.
    """

    roll: Callable[..., None]
    rod: Callable[..., Any] | None
    reaches: Callable[..., bool] = is_as_fast
    lone: Callable[..., float] | None = None


LAWS: dict[Rung, Law] = {
    # a gain pushes joints, which are stepped as under oil
    GAIN: Law(roll, rod=None),
    QUASI_STATIC: Law(roll_quasi_static, quasi_static_rod, lone=lone_quasi_static),
    DYNAMIC: Law(roll, dynamic_rod, is_pushed, lone_dynamic),
}
