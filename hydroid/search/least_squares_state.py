"""State of a least-squares fit between two steps, and why it ended."""

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


class Ending(Enum):
    """Why least squares ended."""

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
class State:
    """Where least squares stands: everything that the next step depends on.

    Attributes:
        point: best point so far, shape (p,), within [0, 1].
        residual: there, shape (R,).
        jacobian: shape (R, p), or (0, p) where it is to be taken.
        fresh: whether the Jacobian is one of finite differences, not an updated one.
        damping: λ. growth: factor of λ after the next step that fails.
        width: index into WIDTHS.
        slow: steps in a row from new Jacobians with gains below the tolerance.
        cycle_cost, cycle_evaluations: cost and evaluations when the Jacobian was last to be taken.
        cost_before: half the sum of the squared residuals at the start. cost: at `point`.
        evaluations: candidates simulated. iterations: steps that helped.
        ending: why it ended; None while it has not.
    """

    point: Float
    residual: Float
    jacobian: Float
    fresh: bool
    damping: float
    growth: float
    width: int
    slow: int
    cycle_cost: float
    cycle_evaluations: int
    cost_before: float
    cost: float
    evaluations: int
    iterations: int
    ending: Ending | None

    @property
    def converged(self) -> bool:
        """Whether it has ended at an optimum."""
        return self.ending is not None and self.ending.converged

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state as arrays by name, to be stored."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: np.asarray(v) for n, v in (values | {"ending": getattr(self.ending, "name", "")}).items()}

    @staticmethod
    def from_arrays(arrays: dict[str, NDArray[Any]]) -> "State":
        """Return the state that `arrays` stored."""
        values: dict[str, Any] = {
            f.name: arrays[f.name] if arrays[f.name].ndim else arrays[f.name].item() for f in fields(State)
        }
        values["ending"] = Ending[values["ending"]] if values["ending"] else None
        return State(**values)
