"""Bounded least squares on the unit box: Levenberg-Marquardt with an explicit state.

    descent = start(point, row)
    while not descent.ended:
        descent = step(descent, residuals, settings)

`step` is a pure function of a `Descent`: a stored one continues to the same bits.

One step is one of two things. *Without a Jacobian* it takes one, by finite differences
in one batch, and ends where the linear model promises no gain. *With one* it tries a
step s that minimises

    |r + J s|² + λ |D s|²

inside the box, D the lengths of J's columns. Where it helps, the damping λ falls by
Nielsen's rule; where it does not, λ rises by the same factor each time. (Nielsen's
factor doubles from one failure to the next. A step costs one simulation, a Jacobian
many: a λ that is passed over may cost the optimum.)

What else differs from a textbook:

- A Jacobian of p simulations is expensive. After a step it is updated from that step
  (C. G. Broyden, 1965) as long as the updated one lowers the logarithm of the cost by
  as much per simulation as the one before did.
- Beside each step from a new Jacobian a second one is tried, corrected for the
  curvature of the residual along the first (geodesic acceleration, M. K. Transtrum and
  J. P. Sethna, 2012). It follows the curved valleys of problems whose parameters
  compensate each other.
- A response may have an edge: a machine that just leaves its stop, or does not. Steps
  that lead over it do not help, however short, although the linear model promises much.
  Before least squares ends so, it tries steps that hold one parameter each where it
  is. With the one that leads over the edge held, the others move on.
- A parameter without effect stays where it is: its column of J is zero, or rounding
  noise (`derivatives`).
- A candidate whose simulation fails is a step that does not help.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array
from hydroid.search.axes import Function
from hydroid.search.descent import (
    DAMPING,
    NONE,
    Descent,
    Ending,
    LinearModel,
    State,
    costs,
    derivatives,
    start,
    with_jacobian,
    without_jacobian,
)
from hydroid.settings.search import RefinementSettings

UNDAMPED = 1e-14
"""λ of the step that tells what a Jacobian promises at most"""
HARDER = 4.0
"""factor of λ after a step that does not help"""
PROBE = 0.1
"""part of a step after which the curvature along it is measured"""
CURVED = 2.0
"""a correction this many times longer than the step itself is not believed"""
TRUSTED = 0.3
"""part of the promised gain that a step must bring for its Jacobian to be updated"""
PROMISING = 0.1
"""part of the cost that is promised beside an edge; near an optimum it is far less"""
FIRM = (1e-2, 1.0)
"""λ of the steps that hold a parameter"""
SHORTEST = 1e-14
"""relative length below which a step is none"""
EXACT = 1e-24
"""part of the first cost at which nothing is left to explain"""
SLOW_STEPS = 2
"""steps in a row that may gain less than the tolerance"""


class _Try(NamedTuple):
    """A step, and the parameter that it holds, if any."""

    step: Array
    held: int = NONE


def least_squares(
    start_at: Array, residuals: Function, settings: RefinementSettings
) -> Descent:
    """Minimise the sum of squared residuals from a point of the unit box, shape (p,);
    return the last state.

    Its point is the best one evaluated, and its ending says whether that is an optimum.
    """
    descent = start(start_at, residuals(start_at[None])[0])
    while not descent.ended:
        descent = step(descent, residuals, settings)
    return descent


def step(now: State, residuals: Function, settings: RefinementSettings) -> State:
    """Return a descent that has not ended after taking a Jacobian, or after trying a
    step."""
    simulated = 0

    def counted(points: Array) -> Array:
        nonlocal simulated
        simulated += len(points)
        return residuals(points)

    has_jacobian = len(now.jacobian) > 0
    move = _advance if has_jacobian else _differentiate
    after = move(now, counted, settings)
    return replace(after, evaluations=now.evaluations + simulated)


def _differentiate(
    now: State, residuals: Function, settings: RefinementSettings
) -> State:
    """Take the Jacobian; end where it promises no gain."""
    columns = derivatives(residuals, now.point, now.residual)
    if not np.isfinite(columns).all():
        return replace(now, ending=Ending.JACOBIAN_FAILED)
    # against these a later, updated Jacobian is measured
    cycle = (now.cost, now.evaluations)
    after = replace(with_jacobian(now, columns.T), fresh=True, cycle=cycle)
    model = LinearModel(after)
    # no damped step promises more than the undamped one
    most = model.gain(model.step(UNDAMPED))
    if most > settings.gain_tolerance * now.cost:
        return after
    return replace(after, ending=Ending.GAIN)


def _advance(now: State, residuals: Function, settings: RefinementSettings) -> State:
    """Try a step, or several; take the best one if it helps."""
    model = LinearModel(now)
    tried = _tried(now, model, residuals)
    first = tried[0].step
    # inside the box, so that a step may be shorter than it was solved for
    points = np.array([model.reach(one.step) for one in tried])
    moved = np.linalg.norm(points[0] - now.point)
    if moved <= SHORTEST * np.linalg.norm(now.point):
        return _no_step(now)
    # in one batch: they are simulated at the same time
    rows = residuals(points)
    cost = costs(rows)
    best = np.argmin(cost)
    if not cost[best] < now.cost:
        return _without_gain(now, model, residuals, settings)
    taken = tried[best]
    promised = model.gain(first)
    if taken.held != NONE:
        promised = model.gain(taken.step)
    ratio = 0.0
    if promised > 0:
        ratio = (now.cost - cost[best]) / promised
    after = _moved(now, points[best], rows[best], ratio, settings)
    after = replace(after, held=taken.held)
    if after.ended or not _keeps_jacobian(now, after, ratio):
        return after
    return with_jacobian(after, _updated(now, after))


def _tried(now: Descent, model: LinearModel, residuals: Function) -> list[_Try]:
    """Return the steps that are tried: the damped one, where the Jacobian is new its
    correction, and where the last step held a parameter one that holds it too."""
    first = model.step(now.damping)
    tried = [_Try(first)]
    if now.fresh and np.linalg.norm(first) > SHORTEST:
        corrected = _corrected(now, model, first, residuals)
        if corrected is not None:
            tried.append(_Try(corrected))
    if now.held != NONE:
        tried.append(_Try(model.step(now.damping, held=now.held), now.held))
    return tried


def _corrected(
    now: Descent, model: LinearModel, first: Array, residuals: Function
) -> Array | None:
    """Return a step corrected for the curvature of the residual along it.

    None: that cannot be measured, or the correction is too large to be believed.
    """
    origin = model.reach(np.zeros_like(first))
    probe = model.reach(PROBE * first)
    slope = (residuals(probe[None])[0] - now.residual) / PROBE
    linear = now.jacobian @ ((probe - origin) / PROBE)
    curvature = 2 / PROBE * (slope - linear)
    if not np.isfinite(curvature).all():
        return None
    corrected = model.step(now.damping, now.residual + 0.5 * curvature)
    change = np.linalg.norm(model.scale * (corrected - first))
    length = np.linalg.norm(model.scale * first)
    return corrected if change < CURVED * length else None


def _without_gain(
    now: State,
    model: LinearModel,
    residuals: Function,
    settings: RefinementSettings,
) -> State:
    """Take a new Jacobian, or a shorter step, after a step that does not help."""
    if not now.fresh:
        return without_jacobian(now)
    after = replace(now, damping=HARDER * now.damping)
    promised = model.gain(model.step(after.damping))
    if promised >= settings.gain_tolerance * now.cost:
        return after
    if model.gain(model.step(UNDAMPED)) < PROMISING * now.cost:
        return _no_step(now)
    return _beside_an_edge(now, model, residuals, settings)


def _beside_an_edge(
    now: State,
    model: LinearModel,
    residuals: Function,
    settings: RefinementSettings,
) -> State:
    """Take the best of the steps that hold one parameter each; end where none helps."""
    tried = [(held, damping) for damping in FIRM for held in model.moving.tolist()]
    steps = [model.step(damping, held=held) for held, damping in tried]
    points = np.array([model.reach(s) for s in steps])
    rows = residuals(points)
    cost = costs(rows)
    best = np.argmin(cost)
    if now.cost - cost[best] < settings.gain_tolerance * now.cost:
        return _no_step(now)
    held, damping = tried[best]
    ratio = (now.cost - cost[best]) / model.gain(steps[best])
    from_here = replace(now, damping=damping, held=held)
    return _moved(from_here, points[best], rows[best], ratio, settings)


def _keeps_jacobian(now: Descent, after: Descent, ratio: float) -> bool:
    """Return whether the next step may begin with an updated Jacobian.

    A new one must have promised well. Of an updated one the logarithm of the cost must
    fall by as much in this one simulation as it has on average since the last new one.
    """
    if now.fresh:
        return bool(ratio > TRUSTED)
    cost, evaluations = now.cycle
    simulated = now.evaluations + 1 - evaluations
    mean = np.log(cost / after.cost) / simulated
    return bool(np.log(now.cost / after.cost) >= mean)


def _updated(now: Descent, after: Descent) -> Array:
    """Return Broyden's update: the Jacobian nearest to the present one, by its own
    scale, that explains the step."""
    move = after.point - now.point
    scaled = np.sum(now.jacobian**2, axis=0) * move
    expected = now.jacobian @ move
    unexplained = after.residual - now.residual - expected
    return now.jacobian + np.outer(unexplained / (scaled @ move), scaled)


def _moved(
    now: State, point: Array, row: Array, ratio: float, settings: RefinementSettings
) -> State:
    """Move to a better point, whose gain is `ratio` times the promised one;
    the Jacobian is to be taken."""
    cost = costs(row[None])[0]
    gained_little = now.cost - cost < settings.gain_tolerance * now.cost
    slow = 0
    if gained_little:
        slow = now.slow + 1
    ending = Ending.UNDER_WAY
    if cost <= EXACT * now.cost_before:
        ending = Ending.EXACT
    elif slow >= SLOW_STEPS:
        ending = Ending.SLOW
    elif now.iterations + 1 >= settings.iterations:
        ending = Ending.ITERATIONS
    # Nielsen's rule
    shrinking = max(1 / 3, 1 - (2 * ratio - 1) ** 3)
    return replace(
        without_jacobian(now),
        point=point,
        residual=row,
        cost=cost,
        fresh=False,
        damping=max(now.damping * shrinking, UNDAMPED),
        slow=slow,
        iterations=now.iterations + 1,
        ending=ending,
    )


def _no_step(now: State) -> State:
    """End where no step is left, or first take anew a Jacobian that was updated."""
    if now.fresh:
        return replace(now, ending=Ending.NO_IMPROVEMENT)
    return replace(without_jacobian(now), damping=DAMPING)
