"""Which combinations of the parameters the data determine, and each direction that they do not, by name.

A direction is a set of relative changes made together. Where the response to it drowns in the noise, nothing
in the data speaks against it, however small the output error is. Known patterns are tried first: a parameter
without effect, the solenoid's four numbers, the currents' scale, a common scale of all that the arm's
equation of motion is linear in; what is left over is told by its components.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.uncertainty.covariance import RANK_TOLERANCE, Uncertainty
from hydroid.uncertainty.flags import WEAK_ABOVE, Flag, flag_of
from hydroid.uncertainty.patterns import DirectionKind, Pattern, patterns

SHOWN = 0.1
"""components below this part of the largest are left out of a direction's name"""
EQUAL = 0.05
"""components that differ by less than this part of the largest are called equal"""
MOSTLY = 0.5
"""a pattern of which less than this part is left beside those already told is not told again"""


@dataclass(frozen=True, eq=False)
class Direction:
    """One direction, or several of one kind, that the data determine weakly or not at all.

    Attributes:
        kind: why it is not determined.
        parameters: relative changes along the weakest, by name, of those that take part.
        changes: relative changes of the free parameters along each, the largest +1, shape (m, p).
        relative_sd: standard deviation of the largest relative change along the weakest; inf where the data
            do not depend on it.
        numbers: what stays determined, as in `Pattern`.
    """

    kind: DirectionKind
    parameters: Mapping[str, float]
    changes: Array
    relative_sd: float
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def flag(self) -> Flag:
        """Weakly identifiable, or not."""
        return flag_of(self.relative_sd)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What the data tell apart.

    Attributes:
        names: of the p free parameters.
        singular: singular values of the derivatives in units of the noise, largest first, shape (p,): the
            inverse of the relative standard deviation of each direction. 0: the data do not feel it.
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


def identifiability(problem: Problem, found: Uncertainty) -> Identifiability:
    """Return what the data tell apart at an estimate."""
    _, singular, axes = np.linalg.svd(found.root)
    axes *= np.where(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)] < 0, -1.0, 1.0)[:, None]
    singular = np.where(singular > RANK_TOLERANCE * singular.max(initial=0.0), singular, 0.0)
    names = tuple(n for n, free in zip(problem.parameters.names, found.free, strict=True) if free)
    named: list[Direction] = []
    rest = np.eye(len(names))  # a basis of the directions that no pattern has taken
    for pattern in patterns(problem, found):
        new = _new(pattern.changes, rest)
        # one direction is told whole, what it shares with those before it included: its name says what it is
        whole = (
            pattern.changes / np.linalg.norm(pattern.changes)
            if len(pattern.changes) == len(new) == 1
            else new
        )
        unfelt = _weakest_first(found.root, whole)
        if len(unfelt):
            named.append(_direction(pattern, names, found.root, unfelt))
            rest = _without(rest, new if whole is not new else unfelt)
    left = int(np.sum(singular < 1 / WEAK_ABOVE)) - (len(names) - len(rest))
    for changes in _weakest_first(found.root, rest)[: max(left, 0)]:
        named.append(_direction(_combination(names, _scaled(changes)), names, found.root, changes[None]))
    return Identifiability(names, singular, axes, tuple(named))


def _new(changes: Array, basis: Array) -> Array:
    """Orthonormal directions among `changes`, shape (m, p), that lie mostly in the span of a basis."""
    spanned = np.linalg.svd(changes, full_matrices=False)[2]
    _, part, inner = np.linalg.svd(spanned @ basis.T, full_matrices=False)
    return inner[part > MOSTLY] @ basis


def _weakest_first(root: Array, basis: Array) -> Array:
    """Directions in the span of an orthonormal basis, (m, p), whose deviation is above WEAK_ABOVE, (k, p)."""
    if not len(basis):
        return basis
    _, felt, inner = np.linalg.svd(root @ basis.T)
    felt = np.concatenate([felt, np.zeros(len(basis) - len(felt))])
    return (inner[felt < 1 / WEAK_ABOVE] @ basis)[::-1]


def _without(basis: Array, taken: Array) -> Array:
    """Return an orthonormal basis, (m, p), without the directions taken, (k, p), in its span: (m - k, p)."""
    complement = np.linalg.svd(taken @ basis.T)[2][len(taken) :]
    return complement @ basis


def _direction(pattern: Pattern, names: tuple[str, ...], root: Array, changes: Array) -> Direction:
    changes = np.array([_scaled(one) for one in changes])
    felt = np.linalg.norm(root @ changes.T, axis=0).min()
    relative = float(1 / felt) if felt > RANK_TOLERANCE * np.linalg.norm(root) else np.inf
    parameters = {name: float(changes[0, names.index(name)]) for name in pattern.parameters}
    return Direction(pattern.kind, parameters, changes, relative, pattern.numbers)


def _scaled(changes: Array) -> Array:
    return changes / changes[np.argmax(np.abs(changes))]


def _combination(names: tuple[str, ...], changes: Array) -> Pattern:
    """Name a direction by its components, the largest first."""
    order = [int(i) for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= SHOWN]
    kind = DirectionKind.COMBINATION
    if len(order) == 1:
        kind = DirectionKind.SINGLE
    elif all(abs(changes[i] - 1) < EQUAL for i in order):
        kind, order = DirectionKind.COMMON_SCALE, sorted(order)
    return Pattern(kind, tuple(names[i] for i in order), changes[None])
