"""Chromosomes: the codings of equation (23), article 4.1 and 5.4, and roulette,
crossover and mutation, 4.1.

A chromosome is a row of genes; each element of equation (23), one parameter, owns
`width` of them. Both codings divide a parameter's range into the same 65,535 steps,
ends included.

- Gray: the article's multivariable binary string. An element is 16 bits, highest first,
  in Gray code: neighbouring values differ in one bit, so a flipped bit or a cut through
  an element need not jump.
- Integer: an element is one number from 0 to 65,535; operators never cut through a
  parameter.

The operators work on whole populations, leave their arguments alone,
and draw from the generator passed in.
"""

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.arrays import Array, Ints, Mask, record
from hydroid.settings.search import GeneticSettings

# Chromosomes, shape (n, length): bits (uint8) or integers (uint16).
Genes = NDArray[Any]

BITS = 16
STEPS = 2**BITS - 1


@record
class GrayCoding:
    """16 Gray-coded bits per element (MVBS)."""

    parameters: int
    width: int = BITS

    def random(self, n: int, rng: Generator) -> Genes:
        """Uniform bits, hence uniform points: shape (n, parameters * width)."""
        return rng.integers(0, 2, (n, self.parameters * BITS), dtype=np.uint8)

    def decode(self, chromosomes: Genes) -> Array:
        """Return points of the unit box, shape (n, parameters)."""
        gray = chromosomes.reshape(-1, self.parameters, BITS)
        bits = np.bitwise_xor.accumulate(gray, axis=-1)
        # the first bit counts most
        powers = 2.0 ** np.arange(BITS - 1, -1, -1)
        return bits @ powers / STEPS

    def encode(self, points: Array) -> Genes:
        """Chromosomes of the nearest points of the grid."""
        value = _nearest(points)
        gray = value ^ (value >> 1)
        places = np.arange(BITS - 1, -1, -1)
        bits = gray[..., None] >> places & 1
        return bits.astype(np.uint8).reshape(len(points), -1)

    def altered(self, chromosomes: Genes, rng: Generator) -> Genes:
        """Flip one random bit of every element."""
        which = rng.integers(0, BITS, (len(chromosomes), self.parameters, 1))
        flips = which == np.arange(BITS)
        return chromosomes ^ flips.reshape(chromosomes.shape).astype(np.uint8)


@record
class IntegerCoding:
    """One integer from 0 to 65,535 per element."""

    parameters: int
    width: int = 1

    def random(self, n: int, rng: Generator) -> Genes:
        """Uniform integers, shape (n, parameters)."""
        return rng.integers(
            0, STEPS, (n, self.parameters), dtype=np.uint16, endpoint=True
        )

    def decode(self, chromosomes: Genes) -> Array:
        """Points of the unit box, shape (n, parameters)."""
        return chromosomes / float(STEPS)

    def encode(self, points: Array) -> Genes:
        """Chromosomes of the nearest points of the grid."""
        return _nearest(points).astype(np.uint16)

    def altered(self, chromosomes: Genes, rng: Generator) -> Genes:
        """Redraw every element uniformly."""
        return self.random(len(chromosomes), rng)


def _nearest(points: Array) -> Ints:
    inside = np.clip(points, 0, 1)
    return np.rint(inside * STEPS).astype(np.int64)


CUTS = 2  # of the pointwise crossover (ours; the article gives none)


def roulette(objectives: Array, count: int, rng: Generator) -> Ints:
    """Indices of `count` parents from the weighted roulette wheel, with replacement,
    by objectives J, (n, 1).

    The wheel needs a fitness to be proportional to, and the objective is to be small:
    the fitness is the distance to the worst feasible candidate of this population,
    max(J) - J. The worst itself and infeasible candidates, whose J is not finite, are
    never drawn; among equals, and where no candidate is feasible, all are equally
    likely.
    """
    objective = objectives[:, 0]
    feasible = np.isfinite(objective)
    fitness = np.zeros(len(objective))
    if feasible.any():
        fitness[feasible] = objective[feasible].max() - objective[feasible]
    if not fitness.any():
        equals = feasible if feasible.any() else ...
        fitness[equals] = 1.0
    # Divided by the largest first: the sum of huge fitnesses must not overflow.
    relative = fitness / fitness.max()
    chance = relative / relative.sum()
    return rng.choice(len(objective), size=count, p=chance)


def pointwise_swaps(pairs: int, length: int, points: int, rng: Generator) -> Mask:
    """Genes that n-point crossover swaps, (pairs, length):
    every other stretch between randomly placed cuts.

    Cuts are distinct, between genes and uniformly placed;
    a string has no more than length - 1 of them.
    """
    order = rng.random((pairs, length - 1)).argsort(axis=1)
    # a stretch starts behind each cut, and gene 0 starts none
    first_genes = 1 + order[:, :points]
    starts = np.zeros((pairs, length), dtype=bool)
    np.put_along_axis(starts, first_genes, values=True, axis=1)
    stretch = np.cumsum(starts, axis=1)
    return stretch % 2 == 1


def crossover(parents: Genes, settings: GeneticSettings, rng: Generator) -> Genes:
    """Children of neighbouring parents (0 with 1, 2 with 3, ...), shape (n, length), n
    even, as the parents'.

    At each gene the two children of a pair hold what its two parents held.
    """
    first = parents[0::2]
    second = parents[1::2]
    pairs, length = first.shape
    if settings.crossover == "pointwise":
        swaps = pointwise_swaps(pairs, length, CUTS, rng)
    else:  # uniform: a child has half of each parent's genes
        swaps = rng.random((pairs, length)) < 0.5
    swaps &= rng.random((pairs, 1)) < settings.crossover_rate
    children = np.empty_like(parents)
    children[0::2] = np.where(swaps, second, first)
    children[1::2] = np.where(swaps, first, second)
    return children


def mutate(
    chromosomes: Genes,
    rate: float,
    coding: GrayCoding | IntegerCoding,
    rng: Generator,
) -> Genes:
    """Mutate each element (each parameter) of each chromosome, (n, length),
    with chance P_m = `rate`.

    What changes in an element is the coding's: one random bit flips (binary),
    or it is redrawn (integer).
    """
    hit = rng.random((len(chromosomes), coding.parameters)) < rate
    hit_genes = np.repeat(hit, coding.width, axis=1)
    return np.where(hit_genes, coding.altered(chromosomes, rng), chromosomes)
