"""Refinement of an estimate: least squares over all channels, with the priors as further measurements."""

import logging
import time
from collections.abc import Callable, MutableMapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydroid.fitting import search
from hydroid.parameters import Array
from hydroid.posterior.noise import prior_weight
from hydroid.posterior.open_start import with_open_start
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import start, step
from hydroid.search.least_squares_state import Ending, State
from hydroid.settings.search import RefinementSettings

ROUNDS = 4
"""times at most that the noise is estimated, to weigh the logs against the priors"""
COARSE = 1e-2
"""`gain_tolerance` of the first of several rounds: the noise at the start weighs priors too heavily"""
SETTLED = 0.02
"""relative change of the noise below which another round would change nothing"""

Arrays = dict[str, NDArray[Any]]
Checkpoints = MutableMapping[str, Arrays]
"""how far refinements are, by name"""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Refinement:
    """Result of a refinement.

    Attributes:
        point: best point of the unit box of the free parameters, shape (p,).
        cost_before: half the sum of the squared residuals at the start; inf if it failed.
        cost: the same at `point`, never more than before.
        evaluations: candidates simulated.
        iterations: steps that lowered the cost.
        ending: why it ended.
    """

    point: Array
    cost_before: float
    cost: float
    evaluations: int
    iterations: int
    ending: Ending

    def __str__(self) -> str:
        cost = f"half the sum of squares {self.cost_before:.6g} to {self.cost:.6g}"
        return f"{cost} in {self.evaluations} simulations; {self.ending.value}"


@dataclass(frozen=True, eq=False)
class _Descent:
    """A refinement under way: least squares with the priors weighed by one estimate of the noise.

    weight: residual that a prior's standard deviation counts [rad]. anchor: point of the unit box at which
    the effect of open start angles was taken, shape (p,). rounds: estimates of both so far.
    evaluations, iterations, cost_before: of the rounds before this one, and of the first start.
    """

    state: State
    weight: float
    anchor: Array
    rounds: int
    evaluations: int
    iterations: int
    cost_before: float

    def arrays(self) -> Arrays:
        own = {n: np.asarray(v) for n, v in vars(self).items() if n != "state"}
        return {f"descent.{n}": v for n, v in own.items()} | self.state.arrays()

    @staticmethod
    def from_arrays(arrays: Arrays) -> "_Descent":
        kept = {n.removeprefix("descent."): v for n, v in arrays.items() if n.startswith("descent.")}
        own: dict[str, Any] = {n: v if v.ndim else v.item() for n, v in kept.items()}
        return _Descent(State.from_arrays(arrays), **own)

    def result(self) -> Refinement:
        s = self.state
        evaluations, iterations = self.evaluations + s.evaluations, self.iterations + s.iterations
        assert s.ending is not None
        return Refinement(s.point, self.cost_before, s.cost, evaluations, iterations, s.ending)


def refine(
    problem: Problem,
    theta: Array,
    settings: RefinementSettings,
    progress: Callable[[int, float], None],
    checkpoints: Checkpoints | None = None,
    name: str = "refined",
) -> Refinement:
    """Improve an estimate by bounded least squares.

    Priors join as residuals of (value - prior) / sd times what one standard deviation counts beside the logs'
    noise (`prior_weight`). The noise, and the effect of open start angles, are taken at the start and again
    at the result, until the noise settles.

    Args:
        problem: the problem.
        theta: where to start, shape (P,).
        settings: when to end.
        progress: takes the number of simulations and the rms error [rad] so far.
        checkpoints: where it continues from, and stores how far it is; a result is stored too.
        name: of this refinement among them.

    Raises:
        RunError: the checkpoint cannot be written.
    """
    checkpoints = {} if checkpoints is None else checkpoints
    stored = checkpoints.get(name)
    if stored is not None and "descent.weight" not in stored:
        values: dict[str, Any] = {n: v if v.ndim else v.item() for n, v in stored.items()}
        values["ending"] = Ending[values["ending"]]
        return Refinement(**values)
    descent = _begin(problem, theta) if stored is None else _Descent.from_arrays(stored)
    opened = _opened(problem, descent)
    saved, last = time.monotonic(), descent
    try:
        while (after := _next(opened, descent, settings)) is not None:
            opened = opened if after.rounds == descent.rounds else _opened(problem, after)
            descent = after
            error = problem.rms(descent.state.residual[None, : problem.measured.size])[0]
            progress(descent.evaluations + descent.state.evaluations, float(error))
            if time.monotonic() - saved > search.SAVE_EVERY:
                checkpoints[name] = descent.arrays()
                saved, last = time.monotonic(), descent
    except BaseException:
        if descent is not last:
            checkpoints[name] = descent.arrays()
        raise
    result = descent.result()
    _log.info("refinement of %d parameters: %s", result.point.size, result)
    values = asdict(result) | {"ending": result.ending.name}
    checkpoints[name] = {n: np.asarray(v) for n, v in values.items()}
    return result


def _begin(problem: Problem, theta: Array) -> _Descent:
    unit = problem.parameters.to_unit(theta[None])[0]
    row = with_open_start(problem, theta).residuals(theta[None])[0]
    weight = _weight(problem, row)
    state = start(unit, _with_priors(problem, row[None], unit[None], weight)[0])
    return _Descent(state, weight, unit, 1, 0, 0, state.cost)


def _opened(problem: Problem, descent: _Descent) -> Problem:
    return with_open_start(problem, problem.parameters.from_unit(descent.anchor[None])[0])


def _next(problem: Problem, descent: _Descent, settings: RefinementSettings) -> _Descent | None:
    """The refinement one step on; None where it has ended."""
    state, weight = descent.state, descent.weight
    first = descent.rounds == 1 and (len(problem.priors) > 0 or problem.leaves_start_open)
    if state.ending is None:

        def residuals(unit: Array) -> Array:
            rows = problem.residuals(problem.parameters.from_unit(unit))
            return _with_priors(problem, rows, unit, weight)

        if first and settings.gain_tolerance < COARSE:
            settings = settings.model_copy(update={"gain_tolerance": COARSE})
        return replace(descent, state=step(state, residuals, settings))
    row = state.residual[: problem.measured.size]
    again = _weight(problem, row)
    if descent.rounds == ROUNDS or not (first or abs(again - weight) > SETTLED * weight):
        return None
    # the next round starts from a row that is known, at no simulation, unless a start angle is open
    if problem.leaves_start_open:
        theta = problem.parameters.from_unit(state.point[None])
        row = with_open_start(problem, theta[0]).residuals(theta)[0]
    state = start(state.point, _with_priors(problem, row[None], state.point[None], again)[0])
    return replace(
        descent,
        state=replace(state, evaluations=0, cycle_evaluations=0),
        weight=again,
        anchor=state.point,
        rounds=descent.rounds + 1,
        evaluations=descent.evaluations + descent.state.evaluations,
        iterations=descent.iterations + descent.state.iterations,
    )


def _with_priors(problem: Problem, rows: Array, unit: Array, weight: float) -> Array:
    """Rows of residuals, (n, R), with the scores of the priors at points of the unit box, (n, p)."""
    if not len(problem.priors):
        return rows
    scores = problem.priors.scores(problem.parameters.from_unit(unit))
    return np.column_stack([rows, weight * scores])


def _weight(problem: Problem, row: Array) -> float:
    """What a prior's standard deviation counts beside the noise of a residual, shape (R,) [rad]."""
    if not (len(problem.priors) or problem.leaves_start_open):
        return 0.0
    return prior_weight(problem.channels, row, problem.settings.objective)
