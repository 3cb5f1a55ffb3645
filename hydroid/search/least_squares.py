"""Refinement: bounded least squares from a search's estimate, on `mujoco.minimize.least_squares`.

MuJoCo's Gauss-Newton / Levenberg-Marquardt works on the box of the parameters. Simulated residuals need
some things more, which are here:

- Where derivatives fail on both sides of a point (see `derivatives`), the refinement ends.
- A parameter without effect stays where it is. Its column of the Jacobian is zero or rounding noise, and
  noise scaled to unit length would send it to a bound. It gets a pseudo-measurement of its present value
  instead: a residual that is always zero, with derivative one. The rest of the problem does not change.
- The residual is scaled up. MuJoCo's solver of the box-bounded step takes any gradient below 1e-16 for
  none, whatever its unit; in directions that the data hardly determine it is smaller long before they are
  found.
- Steps that cannot help are not simulated: after a failed step MuJoCo tries shorter ones, down to nothing.
- Where no step helps, derivatives are taken again over wider differences, and then over narrow ones. A joint
  that meets its stop makes small jumps in the response, and narrow differences see nothing but the jumps.
- The best point evaluated is returned, whatever ended the refinement, and with it the reason by name.
- Nothing is printed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from mujoco import minimize
from numpy.typing import NDArray

from hydroid.search.derivatives import derivatives
from hydroid.settings.search import RefinementSettings

Float = NDArray[np.float64]

LARGE = 2.0**40
"""Norm to which the residual is scaled at the start."""
NEGLIGIBLE = 1e-15
"""Share of the cost that is no more than the cost's own rounding: a smaller gain could not be seen."""


WIDTHS = (2.0**6, 2.0**12, 1.0)
"""Widths of the differences, in units of `derivatives.STEP`, that follow where narrow ones lead nowhere."""
SOLVED = 1e-20
"""Share of the first cost at which nothing is left to explain."""


class Ending(Enum):
    """Why a refinement ended."""

    STEP = "the steps became shorter than the tolerance"
    GRADIENT = "no direction inside the bounds improves the fit"
    NO_IMPROVEMENT = "no step improves the fit any further"
    ITERATIONS = "the iterations ran out before it converged"
    START_FAILED = "the start itself could not be simulated"
    JACOBIAN_FAILED = "simulations failed on both sides of the best point"

    @property
    def converged(self) -> bool:
        """Whether a local optimum was reached, as far as rounding lets it be seen."""
        return self in (Ending.STEP, Ending.GRADIENT, Ending.NO_IMPROVEMENT)


@dataclass(frozen=True, eq=False)
class Refinement:
    """What a refinement found.

    Attributes:
        point: best point of the unit box, shape (p,).
        cost_before: half the sum of the squared residuals at the start; inf if it failed.
        cost_after: the same at `point`, never more than before.
        evaluations: candidates simulated.
        iterations: steps accepted.
        ending: why it ended.
    """

    point: Float
    cost_before: float
    cost_after: float
    evaluations: int
    iterations: int
    ending: Ending


def least_squares(
    start: Float, residuals: Callable[[Float], Float], settings: RefinementSettings
) -> Refinement:
    """Improve a point of the unit box by bounded least squares.

    Args:
        start: shape (p,), within [0, 1].
        residuals: points (n, p) -> residuals (n, R); a row that is not finite is a failed candidate.
        settings: when to end.

    Returns:
        The best point evaluated, at least as good as the start.
    """
    course = _Course(residuals, start, settings.step_tolerance)
    ending, iterations = _descend(course, settings)
    for width in WIDTHS:
        left = settings.iterations - iterations
        if ending is not Ending.NO_IMPROVEMENT or left < 1 or course.cost < SOLVED * course.cost_before:
            break
        course.look_again(width)
        ending, more = _descend(course, settings.model_copy(update={"iterations": left}))
        iterations += more
    return Refinement(
        point=course.point,
        cost_before=course.cost_before,
        cost_after=course.cost,
        evaluations=course.evaluations,
        iterations=iterations,
        ending=ending,
    )


def _descend(course: "_Course", settings: RefinementSettings) -> tuple[Ending, int]:
    """MuJoCo's least squares from the course's best point; why it ended, and the steps accepted."""
    start, jacobians = course.point, course.jacobians
    try:
        _, trace = minimize.least_squares(
            start,
            course.residual,
            bounds=(np.zeros_like(start), np.ones_like(start)),
            jacobian=course.jacobian,
            x_scale="jac",
            xtol=settings.step_tolerance,
            gtol=0.0,  # NEGLIGIBLE, which has no unit, takes its place
            max_iter=settings.iterations,
            verbose=minimize.Verbosity.SILENT,
        )
    except _StopError as stop:
        return stop.ending, max(course.jacobians - jacobians - 1, 0)
    return course.ending([log.candidate[:, 0] for log in trace], settings), len(trace) - 1


class _StopError(Exception):
    """The way out of MuJoCo's loop."""

    def __init__(self, ending: Ending) -> None:
        self.ending = ending
        super().__init__(ending.value)


class _Course:
    """The course of one refinement: what MuJoCo asks for, counted, and the best point so far.

    MuJoCo works with columns: points (p, 1), residuals (R + p, 1). The last p residuals are the
    pseudo-measurements, always zero; the others are scaled, see LARGE.
    """

    def __init__(self, residuals: Callable[[Float], Float], start: Float, tolerance: float) -> None:
        self._residuals = residuals
        self._tolerance = tolerance
        self.point = start
        self.cost = self.cost_before = np.inf
        self.evaluations = 0
        self.jacobians = 0
        self._scale = 0.0  # a power of two, so that scaling rounds nothing; 0 before the start is known
        self._linear: _Linear | None = None  # the model at the present point
        self._tried = False  # a step since the last Jacobian
        self._width = 1.0
        self._best_row: Float | None = None  # residual at the best point

    def look_again(self, width: float) -> None:
        """Begin again from the best point, with differences of another width."""
        self._width, self._linear, self._tried = width, None, False

    def residual(self, x: Float) -> Float:
        """Scaled residual at the start or at a trial step; inf throughout where it failed."""
        point = np.clip(x[:, 0], 0.0, 1.0)  # MuJoCo's steps overshoot the bounds by a rounding
        if self._linear is not None:
            self._worth_trying(point, self._linear)
        self._tried = self._linear is not None
        again = self._linear is None  # at the start, which a further look knows already
        row = self._best_row if again and self._best_row is not None else self._simulate(point)
        return np.concatenate((self._scale * row, np.zeros(point.size)))[:, None]

    def jacobian(self, x: Float, r: Float) -> Float:
        """Derivatives by finite differences, shape (R + p, p), with the pseudo-measurements' below."""
        self.jacobians += 1
        self._tried = False
        point, row = np.clip(x[:, 0], 0.0, 1.0), r[: -x.size, 0] / self._scale
        columns, effective = derivatives(self._evaluate, point, row, self._width)
        if not np.isfinite(columns).all():
            raise _StopError(Ending.JACOBIAN_FAILED)
        columns[~effective] = 0.0
        self._linear = _Linear(point, row, columns)
        pseudo = np.diag((~effective).astype(float))
        return np.concatenate((self._scale * columns.T, pseudo))

    def ending(self, points: list[Float], settings: RefinementSettings) -> Ending:
        """The reason for which MuJoCo ended by itself, which it only prints."""
        if not self._tried:
            return Ending.GRADIENT
        if len(points) > 1 and self._short(points[-1], points[-2]):
            return Ending.STEP
        return Ending.ITERATIONS if len(points) > settings.iterations else Ending.NO_IMPROVEMENT

    def _worth_trying(self, point: Float, linear: "_Linear") -> None:
        """End where the step, or what it can be expected to gain, is nothing."""
        if self._short(point, linear.point):
            raise _StopError(Ending.STEP)
        if abs(linear.gain(point)) < NEGLIGIBLE:
            raise _StopError(Ending.NO_IMPROVEMENT)

    def _short(self, point: Float, origin: Float) -> bool:
        length = np.linalg.norm(point - origin)
        return bool(length < self._tolerance * (self._tolerance + np.linalg.norm(origin)))

    def _simulate(self, point: Float) -> Float:
        """Residual at a point, remembered if it is the best; inf throughout where it failed."""
        row = self._evaluate(point[None])[0]
        with np.errstate(over="ignore", invalid="ignore"):
            cost = 0.5 * float(row @ row)
        if not np.isfinite(self.cost_before):
            self.cost_before = cost if np.isfinite(cost) else np.inf
            if not np.isfinite(cost):
                raise _StopError(Ending.START_FAILED)
            self._scale = LARGE / 2.0 ** np.frexp(np.sqrt(cost))[1]
        if cost < self.cost:
            self.cost, self.point, self._best_row = cost, point, row
        return row if np.isfinite(cost) else np.full(row.size, np.inf)

    def _evaluate(self, points: Float) -> Float:
        self.evaluations += len(points)
        return self._residuals(points)


@dataclass(frozen=True, eq=False)
class _Linear:
    """The linear model of the residual around a point: residual (R,) there, derivatives (p, R)."""

    point: Float
    residual: Float
    derivatives: Float

    def gain(self, point: Float) -> float:
        """Share of the cost that the way to another point is expected to save."""
        expected = self.residual + (point - self.point) @ self.derivatives
        before = float(self.residual @ self.residual)
        return (before - float(expected @ expected)) / before
