"""Patterns: directions that the equations suggest, and the numbers that stay identifiable along them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from hydroid.hydraulics.solenoid import curve_exists, force_curve
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.problem.problem import Problem
from hydroid.settings.problem import MECHANICAL_UNITS

COIL = ("force_1", "force_2", "stroke_1", "stroke_2")
CURRENTS = ("current_max", "current_min")
RATED = "rated_current"
STEP = 1e-5
"""relative step of the differences in `_null`"""
NULL_TOLERANCE = 1e-6
"""singular values below this part of the largest are zero there"""


class DirectionKind(StrEnum):
    """Why the logs cannot determine a combination of parameters."""

    NO_EFFECT = "no effect"
    """one parameter that the outputs do not depend on"""
    SINGLE = "single parameter"
    """one parameter whose effect is below the noise"""
    COMMON_SCALE = "common scale"
    """all parameters change by one factor; masses may deviate to compensate for a fixed one"""
    SOLENOID = "solenoid combination"
    """the four coil parameters act through two numbers only"""
    CURRENT_SCALE = "current scale"
    """the coil parameters compensate for a common factor of the currents"""
    COMBINATION = "combination"
    """any other combination"""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Directions to test.

    Attributes:
        kind: the reason.
        parameters: names of those that take part.
        changes: relative changes of the p free parameters along each direction, shape (m, p).
        numbers: that stay identifiable, by symbol: `delta` [mm]; `k_i0`, `k_imax`, `k_imin`, each a k·i²
            [N·mm²].
    """

    kind: DirectionKind
    parameters: tuple[str, ...]
    changes: Array
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])


def patterns(problem: Problem, uncertainty: Uncertainty) -> Iterator[Pattern]:
    """Yield the directions to test, the simplest first."""
    names = [n for n, free in zip(problem.parameters.names, uncertainty.free, strict=True) if free]
    yield from _alone(uncertainty, names)
    yield from _solenoids(problem, uncertainty, names)
    yield from _common_scale(problem, uncertainty, names)


def _alone(uncertainty: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """Parameters without effect, and those whose own effect is below the noise."""
    idle = uncertainty.jacobian.without_effect[uncertainty.free]
    weak = ~idle & (np.linalg.norm(uncertainty.root, axis=0) < 1 / WEAK_ABOVE)
    for kind, suspects in ((DirectionKind.NO_EFFECT, idle), (DirectionKind.SINGLE, weak)):
        for i in np.flatnonzero(suspects).tolist():
            yield Pattern(kind, (names[i],), np.eye(len(names))[[i]])


def _common_scale(problem: Problem, uncertainty: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """A common factor on all parameters that the equation of motion (1) is linear in.

    A fixed mass, such as the jaws', keeps its value. The free masses then deviate from the common factor so
    that they compensate for it best.
    """
    settings, idle = problem.settings.parameters, uncertainty.jacobian.without_effect[uncertainty.free]
    linear = np.array([settings[name].quantity in MECHANICAL_UNITS for name in names]) & ~idle
    mass = np.array([settings[name].quantity == "mass" for name in names]) & linear
    if linear.sum() < 2:
        return
    changes = linear.astype(float)
    if mass.any():
        # least squares with a penalty: a change of 100 % from the common factor counts as much as the noise
        matrix = np.vstack([uncertainty.root[:, mass], np.eye(mass.sum())])
        target = np.append(-uncertainty.root @ changes, np.zeros(mass.sum()))
        changes[mass] += np.linalg.lstsq(matrix, target)[0]
    order = [*np.flatnonzero(linear & ~mass).tolist(), *np.flatnonzero(mass).tolist()]
    yield Pattern(DirectionKind.COMMON_SCALE, tuple(names[i] for i in order), changes[None])


def _solenoids(problem: Problem, uncertainty: Uncertainty, names: Sequence[str]) -> Iterator[Pattern]:
    """F1, F2, x1 and x2 act through δ and k i0² alone; with the currents through δ and k i²."""
    if problem.settings.stage != "hyd":
        return
    settings = problem.settings.parameters
    values = dict(zip(problem.parameters.names, uncertainty.theta, strict=True))
    for joints in {tuple(p.joints or ()) for p in settings.values() if p.quantity in COIL}:
        mine = {p.quantity: n for n, p in settings.items() if tuple(p.joints or ()) == joints}
        nominal = problem.settings.hydraulics.model_dump()
        at = {q: float(values[mine[q]] if q in mine else nominal[q]) for q in (*COIL, *CURRENTS, RATED)}
        if not curve_exists(*(at[q] for q in COIL)):
            continue
        numbers: dict[str, float] = dict(zip(("delta", "k_i0", "k_imax", "k_imin"), _acting(at), strict=True))
        coil = [q for q in COIL if mine.get(q) in names]
        free = coil + [q for q in CURRENTS if mine.get(q) in names]
        cases = [(DirectionKind.SOLENOID, coil, [0, 1])]
        cases += [(DirectionKind.CURRENT_SCALE, free, [0, 2, 3])] if len(free) > len(coil) else []
        for kind, quantities, held in cases:
            if len(trade := _null(at, quantities, held)):
                who = tuple(mine[q] for q in quantities)
                yield Pattern(kind, who, _spread(trade, who, names), numbers)


def _acting(at: Mapping[str, float]) -> list[float]:
    """Return δ [mm], k i0², k I_max², k I_min² [N·mm²], through which coil and currents act."""
    k, gap = force_curve(at["force_1"], at["force_2"], at["stroke_1"], at["stroke_2"], at[RATED])
    return [float(gap), *(float(k) * at[q] ** 2 for q in (RATED, *CURRENTS))]


def _null(at: Mapping[str, float], free: Sequence[str], held: Sequence[int]) -> Array:
    """Relative changes of `free` that leave the numbers `held` of `_acting` as they are, (m, len(free))."""
    if not free:
        return np.empty((0, 0))
    changed = [[{**at, q: at[q] * (1 + step)} for q in free] for step in (STEP, -STEP)]
    high, low = (np.log([_acting(one) for one in side])[:, held] for side in changed)
    _, values, directions = np.linalg.svd((high - low).T / (2 * STEP))
    return directions[int(np.sum(values > NULL_TOLERANCE * values[0])) :]


def _spread(changes: Array, parameters: Sequence[str], names: Sequence[str]) -> Array:
    """Return changes of some parameters, shape (m, k), as changes of all free ones, shape (m, p)."""
    out = np.zeros((len(changes), len(names)))
    out[:, [names.index(name) for name in parameters]] = changes
    return out
