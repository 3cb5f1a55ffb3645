"""How the arm of a rung rolls: the compiled rollout of each."""

from collections.abc import Callable

from hydroid.rungs import DYNAMIC, GAIN, QUASI_STATIC, Rung
from hydroid.simulation.quasi_static import roll_quasi_static
from hydroid.simulation.rollout import roll

# a gain pushes the joints of the same steps
_ROLLS: dict[Rung, Callable[..., None]] = {
    GAIN: roll,
    QUASI_STATIC: roll_quasi_static,
    DYNAMIC: roll,
}


def roll_of(rung: Rung) -> Callable[..., None]:
    """Return the compiled rollout of a rung, which takes the arguments of `roll`."""
    return _ROLLS[rung]
