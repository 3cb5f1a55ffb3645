"""Where least squares stands: the state between two steps, why it ended,
and the residual's linear model."""

from dataclasses import field, fields, replace
from enum import Enum
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hydroid.arrays import Array, Ints, record
from hydroid.search.axes import Function

WIDTH = 2.0**-26  # of the differences: the root of the rounding unit
# how much wider the step is that tells a weak effect from rounding noise
WIDER = 2.0**10
# a column this much shorter than the longest one may be noise, and is taken twice
SUSPECT = 1e-3
TOLERANCE = 1e-12
"""of the box-constrained minimum: slope, in units of a column and the residual,
that is only rounding"""
DAMPING = 1e-3  # λ at the start
NONE = -1
"""parameter held where none is"""
BLOCK = 4096  # rows of a tall matrix that are factorised at a time


class Ending(Enum):
    """Why least squares ended, if it has."""

    UNDER_WAY = "under way"
    GAIN = "no step promises a gain above the tolerance"
    SLOW = "the last steps gained less than the tolerance"
    EXACT = "the residual is zero up to rounding"
    NO_IMPROVEMENT = "no step improves the fit any further"
    ITERATIONS = "it reached the iteration limit"
    TIME = "its time was up"
    START_FAILED = "the start could not be simulated"
    JACOBIAN_FAILED = "simulations failed on both sides of the best point"

    @property
    def converged(self) -> bool:
        """Whether a local optimum was reached, as far as tolerance and rounding show
        it."""
        return self in (Ending.GAIN, Ending.SLOW, Ending.EXACT, Ending.NO_IMPROVEMENT)


@record
class Descent:
    """Least squares under way, or ended.

    Attributes:
        point: best point so far, shape (p,), within [0, 1].
        residual: there, shape (R,).
        cost: half the sum of its squares. cost_before: that of the start.
        jacobian: shape (R, p), or (0, p) where it is to be taken.
        triangle: of the Jacobian's m columns with effect and the residual beside each
            other, shape (m + 1, m + 1); (0, 0) without a Jacobian. It is not stored.
        fresh: whether the Jacobian is one of finite differences, not an updated one.
        cycle: cost, and number of evaluations, when the Jacobian was taken, shape (2,).
        damping: λ.
        held: parameter that the last step held where it was; NONE: none.
        slow: steps in a row with gains below the tolerance.
        evaluations: candidates simulated. iterations: steps that helped.
        ending: why it ended, or UNDER_WAY.
    """

    point: Array
    residual: Array
    cost: float
    cost_before: float
    jacobian: Array
    triangle: Array = field(default_factory=lambda: np.empty((0, 0)))
    fresh: bool = False
    cycle: Array | tuple[float, int] = (np.inf, 0)
    damping: float = DAMPING
    held: int = NONE
    slow: int = 0
    evaluations: int = 1
    iterations: int = 0
    ending: Ending = Ending.UNDER_WAY

    @property
    def ended(self) -> bool:
        """Whether there is no further step."""
        return self.ending is not Ending.UNDER_WAY

    def __str__(self) -> str:
        cost = f"half the sum of squares {self.cost_before:.6g} to {self.cost:.6g}"
        return f"{cost} in {self.evaluations} simulations; {self.ending.value}"

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return arrays by name, to be stored; without the residual once it has
        ended."""
        values = {name: getattr(self, name) for name in self._stored()}
        values["ending"] = self.ending.name
        if self.ended:
            # the Jacobian is where the uncertainty begins
            values["residual"] = []
        return {name: np.asarray(value) for name, value in values.items()}

    @classmethod
    def _stored(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "triangle"]

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> Self:
        """Return the descent that `arrays` stored; what a former version stored
        besides is left out."""
        values: dict[str, Any] = {}
        for name in cls._stored():
            array = arrays[name]
            values[name] = array if array.ndim else array.item()
        values["ending"] = Ending[values["ending"]]
        stored = cls(**values)
        if stored.ended or not len(stored.jacobian):
            return stored
        return with_jacobian(stored, stored.jacobian)


State = TypeVar("State", bound=Descent)


def start(point: Array, residual: Array) -> Descent:
    """Return the descent from a point, shape (p,), whose residual was simulated, shape
    (R,)."""
    cost = costs(residual[None])[0]
    ending = Ending.UNDER_WAY if np.isfinite(cost) else Ending.START_FAILED
    return Descent(point, residual, cost, cost, no_jacobian(point), ending=ending)


def costs(rows: Array) -> Array:
    """Half the sum of squares of each row; inf where it is not finite."""
    with np.errstate(all="ignore"):
        costs = 0.5 * np.sum(rows**2, axis=1)
    return np.where(np.isfinite(costs), costs, np.inf)


def no_jacobian(point: Array) -> Array:
    """Return the Jacobian of a descent whose next step takes one."""
    return np.empty((0, point.size))


def without_jacobian(now: State) -> State:
    """Return a descent whose next step takes a Jacobian."""
    return replace(now, jacobian=no_jacobian(now.point), triangle=np.empty((0, 0)))


def with_jacobian(now: State, jacobian: Array) -> State:
    """Return a descent with the Jacobian at its point, shape (R, p)."""
    moving = np.any(jacobian != 0.0, axis=0)
    # factorised together with the residual: Q is then never formed
    both = np.column_stack([jacobian[:, moving], now.residual])
    return replace(now, jacobian=jacobian, triangle=triangle(both))


class LinearModel:
    """The linear model r + J s of the residual around a descent's point,
    for the parameters with effect.

    A column of J of a parameter without effect is 0. `moving` has the numbers of the
    others, and `scale` the lengths of their columns.
    """

    def __init__(self, at: Descent) -> None:
        self.at = at
        self.moving = np.flatnonzero(np.any(at.jacobian != 0.0, axis=0))
        m = len(self.moving)
        self._triangle = at.triangle[:m, :m]
        self._right = at.triangle[:m, m]
        self.scale = np.linalg.norm(self._triangle, axis=0)

    def _right_of(self, row: Array) -> Array:
        """Return the vector b such that |row + J s|² is |b + R s|² and a constant.

        By the normal equations: what a row has beyond the residual need not be known
        to the last digit.
        """
        slopes = (row - self.at.residual) @ self.at.jacobian[:, self.moving]
        # R may be singular, and flat where the residual has few rows
        beyond = np.linalg.lstsq(self._triangle.T, slopes, rcond=None)[0]
        return self._right + beyond

    def step(
        self, damping: float, row: Array | None = None, *, held: int = NONE
    ) -> Array:
        """Minimise |row + J s|² + damping |D s|² inside the box; s of shape (moving,).

        A parameter that is held does not move.
        """
        right = self._right
        if row is not None:
            right = self._right_of(row)
        size = np.linalg.norm(right)
        if not size:
            return np.zeros_like(right)
        # in lengths of the columns and of the residual, in which the solver's
        # tolerances mean something
        unit = self.scale / size
        point = self.at.point[self.moving]
        damped = np.sqrt(damping) * np.eye(len(unit))
        effects = np.where(self.moving == held, 0.0, self._triangle / self.scale)
        matrix = np.vstack([effects, damped])
        target = np.append(-right / size, np.zeros(len(unit)))
        lower = -point * unit
        upper = (1 - point) * unit
        limits = (lower, upper)
        # changes of the active set: far more than it takes
        most = 20 * len(unit) + 20
        solved = lsq_linear(
            matrix, target, limits, method="bvls", tol=TOLERANCE, max_iter=most
        )
        return solved.x / unit

    def gain(self, s: Array) -> float:
        """Part of the cost that the linear model promises to save by a step."""
        after = self._right + self._triangle @ s
        cost = self._right @ self._right
        return 0.5 * float(cost - after @ after)

    def reach(self, s: Array) -> Array:
        """Return the point of the box that a step leads to, shape (p,)."""
        point = self.at.point.copy()
        reached = point[self.moving] + s
        # rounding leads out of the box
        point[self.moving] = np.clip(reached, 0.0, 1.0)
        return point


def triangle(rows: Array) -> Array:
    """Return the upper triangle R, (p, p), of Q R = rows, shape (m, p).

    Tall matrices are factorised block by block, which keeps each block in the cache:
    four times as fast.
    """
    blocks = np.array_split(rows, max(len(rows) // BLOCK, 1))
    if len(blocks) > 1:
        triangles = [np.linalg.qr(block, mode="r") for block in blocks]
        rows = np.vstack(triangles)
    return np.asarray(np.linalg.qr(rows, mode="r"))


def derivatives(residuals: Function, point: Array, row: Array) -> Array:
    """Return derivatives by each parameter at a point of the box, (p,), with its
    residuals, (R,): shape (p, R).

    They are 0 without effect. All differences are one batch. Those that fail are taken
    to the other side in a second batch; where that fails too, they are not finite.
    """

    def quotients(which: Ints, width: float) -> Array:
        has_room = point + abs(width) <= 1.0
        inwards = np.where(has_room, width, -width)
        steps = inwards[which]
        points = np.tile(point, (len(which), 1))
        points[np.arange(len(which)), which] += steps
        # rounding leads out of the box
        moved = np.clip(points, 0.0, 1.0)
        with np.errstate(all="ignore"):
            return (residuals(moved) - row) / steps[:, None]

    columns = quotients(np.arange(point.size), WIDTH)
    has_failed = ~np.isfinite(columns).all(axis=1)
    failed = np.flatnonzero(has_failed)
    if len(failed):
        columns[failed] = quotients(failed, -WIDTH)
    length = np.linalg.norm(columns, axis=1)
    is_weak = (length > 0) & (length < SUSPECT * length.max())
    suspect = np.flatnonzero(is_weak)
    if len(suspect):
        # a derivative does not depend on the step; rounding noise divided by a wider
        # step becomes smaller
        again = quotients(suspect, WIDER * WIDTH)
        wider = np.linalg.norm(again, axis=1)
        noise = wider < 0.1 * length[suspect]
        columns[suspect[noise]] = 0.0
    return columns
