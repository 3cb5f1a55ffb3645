"""Directions: combinations of parameters that the logs and priors do not determine.

A direction is a set of relative changes made together. Where its effect on the response is below the noise,
it is unidentifiable. Parameters that are so by themselves come first; the other directions are the axes of
what is left.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.posterior.posterior import WEAK_PRIOR
from hydroid.problem.problem import Problem

MIN_COMPONENT = 0.1
"""components below this part of the largest are left out of a direction's parameters"""
EQUAL_WITHIN = 0.05
"""components that differ by less than this part of the largest are equal"""


class DirectionKind(StrEnum):
    """What an unidentifiable direction consists of."""

    NO_EFFECT = "no effect"
    """one parameter that the outputs do not depend on"""
    SINGLE = "single parameter"
    """one parameter whose effect is below the noise"""
    COMMON_SCALE = "common scale"
    """parameters that may all change by one factor"""
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
    _, values, axes = np.linalg.svd(root[:, ~alone], full_matrices=False)
    others = [name for name, each in zip(names, alone, strict=True) if not each]
    weak = axes[values < 1 / WEAK_ABOVE][::-1]
    named += [_combination(others, one, root[:, ~alone]) for one in weak]
    return Identifiability(names, len(names) - len(named), tuple(named))


def _combination(names: list[str], changes: Array, root: Array) -> Direction:
    """Describe a direction by its components, the largest first."""
    changes = changes / changes[np.argmax(np.abs(changes))]
    order = [int(i) for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= MIN_COMPONENT]
    kind = DirectionKind.SINGLE if len(order) == 1 else DirectionKind.COMBINATION
    if len(order) > 1 and all(abs(changes[i] - 1) < EQUAL_WITHIN for i in order):
        kind, order = DirectionKind.COMMON_SCALE, sorted(order)
    return Direction(kind, {names[i]: float(changes[i]) for i in order}, _deviation(root, changes))


def _deviation(root: Array, changes: Array) -> float:
    """Standard deviation along a direction; infinite where it is no less than the weak prior's."""
    found = 1 / float(np.linalg.norm(root @ changes))
    return found if found * np.linalg.norm(changes) < 0.9 * WEAK_PRIOR else np.inf
