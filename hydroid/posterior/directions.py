"""Directions: combinations of parameters that the data determine, or do not, with the reason.

A direction is a set of relative changes made together. Where its effect on the response is below the noise,
it is unidentifiable. Patterns with a known cause are tested first: a parameter without effect, the four coil
parameters, the currents' scale, a common scale of all parameters that the equation of motion is linear in.
Any other direction is described by its components.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.axes import RANK_TOLERANCE
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.posterior.patterns import DirectionKind, Pattern, patterns
from hydroid.problem.problem import Problem

MIN_COMPONENT = 0.1
"""components below this part of the largest are left out of a direction's parameters"""
EQUAL_WITHIN = 0.05
"""components that differ by less than this part of the largest are equal"""
NEW_ABOVE = 0.5
"""part of a pattern outside the directions already named, above which it is a new one"""


@dataclass(frozen=True, eq=False)
class Direction:
    """One unidentifiable direction, or several of one kind.

    Attributes:
        kind: why the data do not determine it.
        parameters: relative changes along the weakest, by name, of those that take part.
        changes: relative changes of the free parameters along each, the largest +1, shape (m, p).
        relative_sd: standard deviation of the largest relative change along the weakest; inf where the data
            do not depend on it.
        numbers: that stay identifiable, as in `Pattern`.
    """

    kind: DirectionKind
    parameters: Mapping[str, float]
    changes: Array
    relative_sd: float
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def flag(self) -> Flag:
        """Weakly identifiable, or not identifiable."""
        return flag_of(self.relative_sd)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The directions that the data determine, and those that they do not.

    Attributes:
        names: of the p free parameters.
        singular: singular values of the derivatives in units of the noise, largest first, shape (p,): the
            inverse of the relative standard deviation of each direction. 0: the data do not depend on it.
        axes: these directions, relative changes of unit length, shape (p, p), one a row.
        unidentifiable: the directions whose relative standard deviation is above WEAK_ABOVE.
    """

    names: tuple[str, ...]
    singular: Array
    axes: Array
    unidentifiable: tuple[Direction, ...]

    @property
    def rank(self) -> int:
        """Number of independent combinations with a relative standard deviation of at most WEAK_ABOVE."""
        return int(np.sum(self.singular >= 1 / WEAK_ABOVE))


def identifiability(problem: Problem, uncertainty: Uncertainty) -> Identifiability:
    """Return the directions that the data determine at an estimate, and those that they do not."""
    _, singular, axes = np.linalg.svd(uncertainty.root)
    axes *= np.where(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)] < 0, -1.0, 1.0)[:, None]
    singular = np.where(singular > RANK_TOLERANCE * singular.max(initial=0.0), singular, 0.0)
    names = tuple(n for n, free in zip(problem.parameters.names, uncertainty.free, strict=True) if free)
    named: list[Direction] = []
    rest = np.eye(len(names))  # a basis of the directions that no pattern has explained
    for pattern in patterns(problem, uncertainty):
        new = _new(pattern.changes, rest)
        # a single direction is kept whole, with what it shares with those before it
        single = len(pattern.changes) == len(new) == 1
        candidates = pattern.changes / np.linalg.norm(pattern.changes) if single else new
        weak = _weakest_first(uncertainty.root, candidates)
        if len(weak):
            named.append(_direction(pattern, names, uncertainty.root, weak))
            rest = _without(rest, new if single else weak)
    left = int(np.sum(singular < 1 / WEAK_ABOVE)) - (len(names) - len(rest))
    for changes in _weakest_first(uncertainty.root, rest)[: max(left, 0)]:
        pattern = _combination(names, _scaled(changes))
        named.append(_direction(pattern, names, uncertainty.root, pattern.changes))
    return Identifiability(names, singular, axes, tuple(named))


def _new(changes: Array, basis: Array) -> Array:
    """Orthonormal directions among `changes`, shape (m, p), that lie mostly in the span of a basis."""
    spanned = np.linalg.svd(changes, full_matrices=False)[2]
    _, part, inner = np.linalg.svd(spanned @ basis.T, full_matrices=False)
    return inner[part > NEW_ABOVE] @ basis


def _weakest_first(root: Array, basis: Array) -> Array:
    """Directions in the span of a basis, (m, p), whose standard deviation is above WEAK_ABOVE, (k, p)."""
    if not len(basis):
        return basis
    _, length, inner = np.linalg.svd(root @ basis.T)
    length = np.concatenate([length, np.zeros(len(basis) - len(length))])
    return (inner[length < 1 / WEAK_ABOVE] @ basis)[::-1]


def _without(basis: Array, taken: Array) -> Array:
    """Return an orthonormal basis, (m, p), without the directions taken, (k, p), in its span: (m - k, p)."""
    complement = np.linalg.svd(taken @ basis.T)[2][len(taken) :]
    return complement @ basis


def _direction(pattern: Pattern, names: tuple[str, ...], root: Array, changes: Array) -> Direction:
    changes = np.array([_scaled(one) for one in changes])
    length = np.linalg.norm(root @ changes.T, axis=0).min()
    relative = float(1 / length) if length > RANK_TOLERANCE * np.linalg.norm(root) else np.inf
    parameters = {name: float(changes[0, names.index(name)]) for name in pattern.parameters}
    return Direction(pattern.kind, parameters, changes, relative, pattern.numbers)


def _scaled(changes: Array) -> Array:
    return changes / changes[np.argmax(np.abs(changes))]


def _combination(names: tuple[str, ...], changes: Array) -> Pattern:
    """Describe a direction by its components, the largest first."""
    order = [int(i) for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= MIN_COMPONENT]
    kind = DirectionKind.COMBINATION
    if len(order) == 1:
        kind = DirectionKind.SINGLE
    elif all(abs(changes[i] - 1) < EQUAL_WITHIN for i in order):
        kind, order = DirectionKind.COMMON_SCALE, sorted(order)
    return Pattern(kind, tuple(names[i] for i in order), changes[None])
