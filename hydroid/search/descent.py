"""Where least squares stands: the state between two steps, and why it ended."""

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

DAMPING = 1e-3
"""λ at the start"""


class Ending(Enum):
    """Why least squares ended, if it has."""

    UNDER_WAY = "under way"
    GAIN = "no step promises a gain above the tolerance"
    SLOW = "the last steps gained less than the tolerance"
    EXACT = "the residual is zero up to rounding"
    NO_IMPROVEMENT = "no step improves the fit any further"
    ITERATIONS = "it reached the iteration limit"
    START_FAILED = "the start could not be simulated"
    JACOBIAN_FAILED = "simulations failed on both sides of the best point"

    @property
    def converged(self) -> bool:
        """Whether a local optimum was reached, as far as tolerance and rounding show it."""
        return self in (Ending.GAIN, Ending.SLOW, Ending.EXACT, Ending.NO_IMPROVEMENT)


@dataclass(frozen=True, eq=False)
class Descent:
    """Least squares under way, or ended.

    Attributes:
        point: best point so far, shape (p,), within [0, 1].
        residual: there, shape (R,).
        cost: half the sum of its squares. cost_before: that of the start.
        jacobian: shape (R, p), or (0, p) where it is to be taken.
        fresh: whether the Jacobian is one of finite differences, not an updated one.
        cycle: cost, and number of evaluations, when the Jacobian was taken, shape (2,).
        damping: λ. growth: factor of λ after the next step that fails.
        slow: steps in a row with gains below the tolerance.
        evaluations: candidates simulated. iterations: steps that helped.
        ending: why it ended, or UNDER_WAY.
    """

    point: Float
    residual: Float
    cost: float
    cost_before: float
    jacobian: Float
    fresh: bool = False
    cycle: Float | tuple[float, int] = (np.inf, 0)
    damping: float = DAMPING
    growth: float = 2.0
    slow: int = 0
    evaluations: int = 1
    iterations: int = 0
    ending: Ending = Ending.UNDER_WAY

    @property
    def ended(self) -> bool:
        """Whether there is no further step."""
        return self.ending is not Ending.UNDER_WAY

    @property
    def converged(self) -> bool:
        """Whether it has ended at an optimum."""
        return self.ending.converged

    def __str__(self) -> str:
        cost = f"half the sum of squares {self.cost_before:.6g} to {self.cost:.6g}"
        return f"{cost} in {self.evaluations} simulations; {self.ending.value}"

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return arrays by name, to be stored; without the residual once it has ended."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        values["ending"] = self.ending.name
        if self.ended:
            values["residual"] = []  # the Jacobian is where the uncertainty begins
        return {name: np.asarray(value) for name, value in values.items()}

    @staticmethod
    def from_arrays(arrays: dict[str, NDArray[Any]]) -> "Descent":
        """Return the descent that `arrays` stored."""
        stored = {f.name: arrays[f.name] for f in fields(Descent)}
        values: dict[str, Any] = {n: a if a.ndim else a.item() for n, a in stored.items()}
        values["ending"] = Ending[values["ending"]]
        return Descent(**values)


def start(point: Float, residual: Float) -> Descent:
    """Return the descent from a point, shape (p,), whose residual was simulated, shape (R,)."""
    cost = float(costs(residual[None])[0])
    ending = Ending.UNDER_WAY if np.isfinite(cost) else Ending.START_FAILED
    return Descent(point, residual, cost, cost, no_jacobian(point), ending=ending)


def costs(rows: Float) -> Float:
    """Half the sum of squares of each row; inf where it is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        costs = 0.5 * np.sum(rows**2, axis=1)
    return np.where(np.isfinite(costs), costs, np.inf)


def no_jacobian(point: Float) -> Float:
    """Return the Jacobian of a descent whose next step takes one."""
    return np.empty((0, point.size))
