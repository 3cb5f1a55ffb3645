"""Directions: combinations of parameters that the logs and priors do not determine.

A direction is a set of relative changes made together. Where its effect on the response is below the noise,
it is unidentifiable. Parameters that are so by themselves come first; the other directions are the axes of
what is left.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.posterior.posterior import WEAK_PRIOR
from hydroid.problem.problem import Problem
from hydroid.quantity_table import MECHANICAL

MIN_COMPONENT = 0.1
"""components below this part of the largest are left out of a direction's parameters"""

NEW_ABOVE = 0.5
"""part of a common scale outside the parameters already named, above which it is a direction of its own"""

Flags = NDArray[np.bool_]


class DirectionKind(StrEnum):
    """What an unidentifiable direction consists of."""

    NO_EFFECT = "no effect"
    """one parameter that the outputs do not depend on"""
    SINGLE = "single parameter"
    """one parameter whose effect is below the noise"""
    COMMON_SCALE = "common scale"
    """all parameters of the arm change by one factor; masses may deviate to make up for a fixed one"""
    COMBINATION = "combination"
    """any other combination"""


@dataclass(frozen=True, eq=False)
class Direction:
    """One unidentifiable direction.

    Attributes:
        kind: what it consists of.
        parameters: relative changes by name of those that take part, the largest +1.
        relative_sd: standard deviation of the largest relative change; inf where nothing limits it.
    """

    kind: DirectionKind
    parameters: Mapping[str, float]
    relative_sd: float

    @property
    def flag(self) -> Flag:
        """Weakly identifiable, or not identifiable."""
        return flag_of(self.relative_sd)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The directions that are determined, and those that are not.

    Attributes:
        names: of the p parameters that vary.
        rank: number of independent combinations with a relative standard deviation of at most WEAK_ABOVE.
        unidentifiable: the other directions, the least determined first.
    """

    names: tuple[str, ...]
    rank: int
    unidentifiable: tuple[Direction, ...]


def identifiability(problem: Problem, uncertainty: Uncertainty) -> Identifiability:
    """Return the directions that are determined at an estimate, and those that are not."""
    root, varied = uncertainty.posterior.root, uncertainty.posterior.box.varied
    names = tuple(n for n, each in zip(problem.parameters.names, varied, strict=True) if each)
    idle = uncertainty.jacobian.without_effect[varied]
    alone = np.linalg.norm(root, axis=0) < 1 / WEAK_ABOVE
    named = [
        Direction(kind, {names[i]: 1.0}, _deviation(root, np.eye(len(names))[i]))
        for kind, which in ((DirectionKind.NO_EFFECT, alone & idle), (DirectionKind.SINGLE, alone & ~idle))
        for i in np.flatnonzero(which)
    ]
    basis = np.eye(len(names))[~alone]  # of the directions that are not named yet
    scale = _common_scale(problem, names, root, (idle, alone))
    if scale is not None:
        named.append(_combination(names, scale, root, DirectionKind.COMMON_SCALE))
        basis = np.linalg.svd((scale @ basis.T)[None])[2][1:] @ basis
    _, values, axes = np.linalg.svd(root @ basis.T, full_matrices=False)
    weak = (axes @ basis)[values < 1 / WEAK_ABOVE][::-1]
    named += [_combination(names, one, root) for one in weak]
    return Identifiability(names, len(names) - len(named), tuple(named))


def _common_scale(
    problem: Problem, names: tuple[str, ...], root: Array, flags: tuple[Flags, Flags]
) -> Array | None:
    """A common factor on all parameters that the equation of motion (1) is linear in, shape (p,).

    A fixed mass, such as the jaws', keeps its value. The free masses then deviate from the common factor so
    that they compensate for it best. None where the data determine the factor, or where most of it is named.
    `flags`: which parameters have no effect, and which are named by themselves.
    """
    idle, named = flags
    quantities = [problem.settings.parameters[name].quantity for name in names]
    linear = np.array([q in MECHANICAL for q in quantities]) & ~idle
    mass = np.array([q == "mass" for q in quantities]) & linear
    if linear.sum() < 2:
        return None
    changes = linear.astype(float)
    if mass.any():
        # a change of 100 % from the common factor counts as much as the noise
        matrix = np.vstack([root[:, mass], np.eye(mass.sum())])
        target = np.append(-root @ changes, np.zeros(mass.sum()))
        changes[mass] += np.linalg.lstsq(matrix, target)[0]
    weak = np.linalg.norm(root @ changes) < np.linalg.norm(changes) / WEAK_ABOVE
    new = np.linalg.norm(changes[~named]) > NEW_ABOVE * np.linalg.norm(changes)
    return changes if weak and new else None


def _combination(
    names: tuple[str, ...], changes: Array, root: Array, kind: DirectionKind = DirectionKind.COMBINATION
) -> Direction:
    """Describe a direction by its components, the largest first; those of a common scale in their order."""
    changes = changes / changes[np.argmax(np.abs(changes))]
    order = [int(i) for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= MIN_COMPONENT]
    if kind is DirectionKind.COMMON_SCALE:
        order = [int(i) for i in np.flatnonzero(changes)]
    elif len(order) == 1:
        kind = DirectionKind.SINGLE
    return Direction(kind, {names[i]: float(changes[i]) for i in order}, _deviation(root, changes))


def _deviation(root: Array, changes: Array) -> float:
    """Standard deviation along a direction; infinite where it is no less than the weak prior's."""
    found = 1 / float(np.linalg.norm(root @ changes))
    return found if found * np.linalg.norm(changes) < 0.9 * WEAK_PRIOR else np.inf
