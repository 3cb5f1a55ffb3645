"""Which combinations of the parameters the data determine, and each direction that they do not, by name.

A direction is a set of relative changes made together. Where the response to it drowns in the noise, nothing
in the data speaks against it, however small the output error is. Known patterns are tried first: a parameter
without effect, the solenoid's four numbers, the currents' scale, a common scale of all that the arm's
equation of motion is linear in; what is left over is told by its components.
"""

from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.uncertainty.covariance import KNOWN, LOST, ZERO, Uncertainty
from hydroid.uncertainty.patterns import patterns

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
        name: in words, such as "K, D and S scale together".
        changes: relative changes of the free parameters along each, the largest +1, shape (m, p).
        relative: standard deviation of the largest relative change along the weakest; inf where nothing is
            felt.
    """

    name: str
    changes: Array
    relative: float

    @property
    def words(self) -> str:
        """The direction and how far it is open."""
        count = f", {len(self.changes)} directions" if len(self.changes) > 1 else ""
        if self.relative > LOST:
            return f"{self.name}: not determined (±∞{count})"
        return f"{self.name}: only to ±{_percent(self.relative)} %{count}"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What the data tell apart.

    Attributes:
        names: of the p free parameters.
        singular: singular values of the derivatives in units of the noise, largest first, shape (p,): the
            inverse of the relative standard deviation of each direction. 0: the data do not feel it.
        axes: these directions, relative changes of unit length, shape (p, p), one a row.
        weak: the directions whose relative standard deviation is above KNOWN, in words.
    """

    names: tuple[str, ...]
    singular: Array
    axes: Array
    weak: tuple[Direction, ...]

    @property
    def rank(self) -> int:
        """How many independent combinations the data determine, to a relative standard deviation of KNOWN."""
        return int(np.sum(self.singular >= 1 / KNOWN))


def identifiability(problem: Problem, found: Uncertainty) -> Identifiability:
    """Return what the data tell apart at an estimate."""
    _, singular, axes = np.linalg.svd(found.root)
    axes *= np.where(axes[np.arange(len(axes)), np.argmax(np.abs(axes), axis=1)] < 0, -1.0, 1.0)[:, None]
    singular = np.where(singular > ZERO * singular.max(initial=0.0), singular, 0.0)
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
            named.append(_direction(pattern.name, found.root, unfelt))
            rest = _without(rest, new if whole is not new else unfelt)
    left = int(np.sum(singular < 1 / KNOWN)) - (len(names) - len(rest))
    for changes in _weakest_first(found.root, rest)[: max(left, 0)]:
        named.append(_direction(_combination(names, _scaled(changes)), found.root, changes[None]))
    return Identifiability(names, singular, axes, tuple(named))


def _new(changes: Array, basis: Array) -> Array:
    """Orthonormal directions among `changes`, shape (m, p), that lie mostly in the span of a basis."""
    spanned = np.linalg.svd(changes, full_matrices=False)[2]
    _, part, inner = np.linalg.svd(spanned @ basis.T, full_matrices=False)
    return inner[part > MOSTLY] @ basis


def _weakest_first(root: Array, basis: Array) -> Array:
    """Directions in the span of an orthonormal basis, (m, p), whose deviation is above KNOWN, (k, p)."""
    if not len(basis):
        return basis
    _, felt, inner = np.linalg.svd(root @ basis.T)
    felt = np.concatenate([felt, np.zeros(len(basis) - len(felt))])
    return (inner[felt < 1 / KNOWN] @ basis)[::-1]


def _without(basis: Array, taken: Array) -> Array:
    """Return an orthonormal basis, (m, p), without the directions taken, (k, p), in its span: (m - k, p)."""
    complement = np.linalg.svd(taken @ basis.T)[2][len(taken) :]
    return complement @ basis


def _direction(name: str, root: Array, changes: Array) -> Direction:
    changes = np.array([_scaled(one) for one in changes])
    felt = np.linalg.norm(root @ changes.T, axis=0).min()
    return Direction(name, changes, float(1 / felt) if felt > ZERO * np.linalg.norm(root) else np.inf)


def _scaled(changes: Array) -> Array:
    return changes / changes[np.argmax(np.abs(changes))]


def _combination(names: tuple[str, ...], changes: Array) -> str:
    """A direction by its components, the largest first."""
    order = [i for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= SHOWN]
    if len(order) == 1:
        return f"{names[order[0]]} alone"
    if all(abs(changes[i] - 1) < EQUAL for i in order):
        together = [names[i] for i in sorted(order)]
        return f"{', '.join(together[:-1])} and {together[-1]} scale together"
    first, *others = (f"{changes[i]:+.2g} % {names[i]}".replace("-", "−") for i in order)
    return f"{first} with {', '.join(others)}"


def _percent(relative: float) -> str:
    return f"{100 * relative:.2g}" if relative < 0.1 else f"{100 * relative:.0f}"
