"""How the arm of a rung rolls: the compiled rollout of each."""

from collections.abc import Callable

from hydroid.rungs import DYNAMIC, GAIN, QUASI_STATIC, Rung
from hydroid.simulation.quasi_static import roll_quasi_static
from hydroid.simulation.rollout import roll

ROLLS: dict[Rung, Callable[..., None]] = {
    GAIN: roll,
    QUASI_STATIC: roll_quasi_static,
    DYNAMIC: roll,
}
"""with the arguments of `roll`; a gain pushes joints, which are stepped as under oil"""
