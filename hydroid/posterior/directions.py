"""Directions: combinations of parameters that the logs and priors do not determine.

A direction is a set of relative changes made together. Where its effect on the response is below the noise,
it is unidentifiable. Parameters that are so by themselves come first; the other directions are the axes of
what is left.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.problem.problem import Problem
from hydroid.quantity_table import MECHANICAL


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
    """One unidentifiable direction: the relative changes of those that take part, the largest +1."""

    kind: DirectionKind
    parameters: dict[str, float]


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
    names = tuple(np.array(problem.parameters.names)[varied].tolist())
    idle = uncertainty.jacobian.without_effect[varied]
    alone = np.linalg.norm(root, axis=0) < 1 / WEAK_ABOVE
    order = [*np.flatnonzero(alone & idle), *np.flatnonzero(alone & ~idle)]
    kinds = [DirectionKind.NO_EFFECT if idle[i] else DirectionKind.SINGLE for i in order]
    named = [Direction(kind, {names[i]: 1.0}) for kind, i in zip(kinds, order, strict=True)]
    basis = np.eye(len(names))[~alone]  # of the directions that are not named yet
    quantities = np.array([problem.settings.parameters[name].quantity for name in names])
    scale = _common_scale(root, np.isin(quantities, list(MECHANICAL)) & ~idle, quantities == "mass")
    # a weak one is new if most of it lies outside the parameters that are named already
    if _weak(root, scale) and np.linalg.norm(scale[~alone]) > 0.5 * np.linalg.norm(scale):
        scale /= scale[np.argmax(np.abs(scale))]
        parts = {names[i]: float(scale[i]) for i in np.flatnonzero(scale)}
        named.append(Direction(DirectionKind.COMMON_SCALE, parts))
        basis = np.linalg.svd((scale @ basis.T)[None])[2][1:] @ basis
    axes = np.linalg.svd(root @ basis.T, full_matrices=False)[2] @ basis
    named += [_combination(names, axis) for axis in axes[::-1] if _weak(root, axis)]
    return Identifiability(names, len(names) - len(named), tuple(named))


def _weak(root: Array, changes: Array) -> bool:
    """Whether the standard deviation along a direction is above WEAK_ABOVE."""
    return bool(np.linalg.norm(root @ changes) < np.linalg.norm(changes) / WEAK_ABOVE)


def _common_scale(root: Array, linear: NDArray[np.bool_], mass: NDArray[np.bool_]) -> Array:
    """A common factor on all parameters that the equation of motion (1) is linear in, shape (p,).

    A fixed mass, such as the jaws', keeps its value. The free masses then deviate from the common factor so
    that they compensate for it best. 0 where there are fewer than two such parameters.
    """
    changes, mass = linear.astype(float), linear & mass
    if linear.sum() < 2:
        return np.zeros(len(linear))
    if mass.any():
        # a change of 100 % from the common factor counts as much as the noise
        matrix = np.vstack([root[:, mass], np.eye(mass.sum())])
        target = np.append(-root @ changes, np.zeros(mass.sum()))
        changes[mass] += np.linalg.lstsq(matrix, target)[0]
    return changes


def _combination(names: tuple[str, ...], changes: Array) -> Direction:
    """Describe a direction by its components of a tenth of the largest or more, the largest first."""
    changes = changes / changes[np.argmax(np.abs(changes))]
    order = [i for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= 0.1]
    kind = DirectionKind.SINGLE if len(order) == 1 else DirectionKind.COMBINATION
    return Direction(kind, {names[i]: float(changes[i]) for i in order})
