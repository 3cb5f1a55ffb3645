"""Bounded least squares on the unit box: Levenberg-Marquardt with an explicit state.

    state = start(point, row)
    while state.ending is None:
        state = step(state, residuals, settings)

A state is a frozen record of numbers and arrays; `step` is a pure function of it. So a state is also the
checkpoint: a run that continues from a stored state ends with the same bits.

One step is one of two things. *Without a Jacobian* it takes one, by finite differences in one batch, and
ends where the linear model promises no gain. *With one* it tries a step s that minimises
|r + J s|² + λ |D s|² inside the box, D the lengths of J's columns, with Nielsen's rule for the damping λ.
What differs from a textbook:

- A Jacobian of p simulations is expensive. After a step it is updated from that step (C. G. Broyden, 1965) as
  long as the updated one lowers the logarithm of the cost by as much per simulation as the one before did.
- Beside each step from a new Jacobian a second one is tried, corrected for the curvature of the residual
  along the first (geodesic acceleration, M. K. Transtrum and J. P. Sethna, 2012). It follows the curved
  valleys of problems whose parameters compensate each other.
- A parameter without effect stays where it is: its column of J is zero, or rounding noise, see `derivatives`.
- Where no step helps, the Jacobian is taken over wider differences: a joint that meets its stop makes small
  jumps in the response, and narrow differences see nothing but the jumps.
- A candidate whose simulation fails is a step that does not help.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hydroid.search.derivatives import Residuals, derivatives
from hydroid.search.least_squares_state import Ending, State
from hydroid.search.linear_model import LinearModel
from hydroid.settings.search import RefinementSettings

Float = NDArray[np.float64]

WIDTHS = (2.0**-26, 2.0**-20, 2.0**-14)
"""finite differences in the unit box: the root of the rounding unit, and wider where that leads nowhere"""
DAMPING = 1e-3
"""λ at the start, and after the differences became wider"""
UNDAMPED = 1e-14
"""λ of the step that tells what a Jacobian promises at most"""
PROBE = 0.1
"""part of a step after which the curvature along it is measured"""
CURVED = 2.0
"""a correction this many times longer than the step itself is not believed"""
TRUSTED = 0.3
"""part of the promised gain that a step must bring for its Jacobian to be updated"""
SHORTEST = 1e-14
"""relative length below which a step is none"""
EXACT = 1e-24
"""part of the first cost at which nothing is left to explain"""
SLOW_STEPS = 2
"""steps in a row from new Jacobians that may gain less than the tolerance"""


def least_squares(start_at: Float, residuals: Residuals, settings: RefinementSettings) -> State:
    """Minimise the sum of squared residuals from a point of the unit box, shape (p,).

    Returns:
        The last state. Its point is the best one evaluated, and its ending says whether that is an optimum.
    """
    state = start(start_at, residuals(start_at[None])[0])
    while state.ending is None:
        state = step(state, residuals, settings)
    return state


def start(point: Float, residual: Float) -> State:
    """Return the state at a point, shape (p,), whose residual was simulated, shape (R,)."""
    cost = _costs(residual[None])[0]
    return State(
        point=point,
        residual=residual,
        jacobian=np.empty((0, point.size)),
        fresh=False,
        damping=DAMPING,
        growth=2.0,
        width=0,
        slow=0,
        cycle_cost=cost,
        cycle_evaluations=1,
        cost_before=cost,
        cost=cost,
        evaluations=1,
        iterations=0,
        ending=None if np.isfinite(cost) else Ending.START_FAILED,
    )


def step(state: State, residuals: Residuals, settings: RefinementSettings) -> State:
    """Return the state after taking a Jacobian, or after trying a step. A state that has ended stays."""
    if state.ending is not None:
        return state
    count = _Counter(residuals)
    after = (
        _differentiate(state, count, settings)
        if not len(state.jacobian)
        else _advance(state, count, settings)
    )
    return replace(after, evaluations=state.evaluations + count.evaluations)


def _differentiate(state: State, residuals: Residuals, settings: RefinementSettings) -> State:
    """Take the Jacobian; end where it promises no gain."""
    columns = derivatives(residuals, state.point, state.residual, WIDTHS[state.width])
    if not np.isfinite(columns).all():
        return replace(state, ending=Ending.JACOBIAN_FAILED)
    after = replace(
        state,
        jacobian=columns.T,
        fresh=True,
        cycle_cost=state.cost,
        cycle_evaluations=state.evaluations,
    )
    model = _model(after)
    if model.gain(model.step(UNDAMPED)) <= settings.gain_tolerance * state.cost:
        return replace(after, ending=Ending.GAIN)
    return after


def _advance(state: State, residuals: "_Counter", settings: RefinementSettings) -> State:
    """Try a step, or two; take the better one if it helps."""
    model = _model(state)
    steps = [model.step(state.damping)]
    promised = model.gain(steps[0])
    if state.fresh and np.linalg.norm(steps[0]) > SHORTEST:
        steps += _corrected(model, steps[0], state.damping, residuals)
    points = np.array([model.reach(s) for s in steps])
    if np.linalg.norm(points[0] - state.point) <= SHORTEST * np.linalg.norm(state.point):
        return _no_step(state)
    rows = residuals(points)
    costs = _costs(rows)
    best = int(np.argmin(costs))
    if not costs[best] < state.cost:
        return _damped(state, model, settings)
    return _accepted(state, points[best], rows[best], promised, residuals.evaluations, settings)


def _accepted(
    state: State, point: Float, row: Float, promised: float, simulated: int, settings: RefinementSettings
) -> State:
    """Move to a better point; update the Jacobian if that is cheaper than a new one."""
    cost = _costs(row[None])[0]
    gain = state.cost - cost
    ratio = gain / promised if promised > 0 else 0.0
    after = replace(
        state,
        point=point,
        residual=row,
        jacobian=np.empty((0, point.size)),
        fresh=False,
        damping=max(state.damping * max(1 / 3, 1 - (2 * ratio - 1) ** 3), UNDAMPED),
        growth=2.0,
        slow=state.slow + 1 if gain < settings.gain_tolerance * state.cost else 0,
        cost=cost,
        iterations=state.iterations + 1,
    )
    if cost <= EXACT * state.cost_before:
        return replace(after, ending=Ending.EXACT)
    if after.slow >= SLOW_STEPS:
        return replace(after, ending=Ending.SLOW)
    if after.iterations >= settings.iterations:
        return replace(after, ending=Ending.ITERATIONS)
    if state.fresh:
        pays = ratio > TRUSTED
    else:
        spent = state.evaluations + simulated - state.cycle_evaluations
        pays = np.log(state.cost / cost) / simulated >= np.log(state.cycle_cost / cost) / spent
    return replace(after, jacobian=_updated(state, point, row)) if pays else after


def _updated(state: State, point: Float, row: Float) -> Float:
    """Broyden's update: the Jacobian nearest to the present one, by its own scale, that explains the step."""
    move = point - state.point
    scaled = np.sum(state.jacobian**2, axis=0) * move
    return state.jacobian + np.outer((row - state.residual - state.jacobian @ move) / (scaled @ move), scaled)


def _damped(state: State, model: LinearModel, settings: RefinementSettings) -> State:
    """After a step that did not help: a new Jacobian, or a shorter step, or wider differences."""
    if not state.fresh:
        return replace(state, jacobian=np.empty((0, state.point.size)))
    after = replace(state, damping=state.damping * 2 * state.growth, growth=2 * state.growth)
    if model.gain(model.step(after.damping)) < settings.gain_tolerance * state.cost:
        return _no_step(state)
    return after


def _no_step(state: State) -> State:
    """Where no step is left: take the Jacobian anew, over wider differences if it is new; or end."""
    again = replace(state, jacobian=np.empty((0, state.point.size)), damping=DAMPING, growth=2.0)
    if not state.fresh:
        return again
    if state.width + 1 < len(WIDTHS):
        return replace(again, width=state.width + 1)
    return replace(state, ending=Ending.NO_IMPROVEMENT)


def _model(state: State) -> LinearModel:
    return LinearModel(state.point, state.residual, state.jacobian)


def _corrected(model: LinearModel, s: Float, damping: float, residuals: Residuals) -> list[Float]:
    """The same step corrected for the curvature along it; none where that cannot be measured."""
    origin, probe = model.reach(np.zeros_like(s)), model.reach(PROBE * s)
    slope = (residuals(probe[None])[0] - model.residual) / PROBE
    curvature = 2 / PROBE * (slope - model.jacobian @ ((probe - origin) / PROBE))
    if not np.isfinite(curvature).all():
        return []
    corrected = model.step(damping, model.residual + 0.5 * curvature)
    return [corrected] if model.length(corrected - s) < CURVED * model.length(s) else []


class _Counter:
    """Residuals whose candidates are counted."""

    def __init__(self, residuals: Residuals) -> None:
        self._residuals, self.evaluations = residuals, 0

    def __call__(self, points: Float) -> Float:
        self.evaluations += len(points)
        return self._residuals(points)


def _costs(rows: Float) -> Float:
    """Half the sum of squares of each row; inf where it is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        costs = 0.5 * np.sum(rows**2, axis=1)
    return np.where(np.isfinite(costs), costs, np.inf)
