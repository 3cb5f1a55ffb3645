"""Operators that the genetic algorithms share, article 4.1: roulette, crossover, mutation.

All work on whole populations, leave their arguments alone, and draw from the generator passed in.
"""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.coding import Coding, Genes
from hydroid.settings.search import GeneticSettings

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

CUTS = 2
"""of the pointwise crossover (ours; the article gives none)"""


def roulette(objective: Float, count: int, rng: Generator) -> Int:
    """Parents from the weighted roulette wheel, with replacement.

    The wheel needs a fitness to be proportional to, and the objective is to be small: the fitness is the
    distance to the worst feasible candidate of this population, max(J) - J. The worst itself and infeasible
    candidates are never drawn; among equals, and where no candidate is feasible, all are equally likely.

    Args:
        objective: J of each candidate, shape (n,), not finite where infeasible.
        count: how many to draw.
        rng: source of randomness.

    Returns:
        Indices of the parents, shape (count,).
    """
    feasible = np.isfinite(objective)
    fitness = np.zeros(len(objective))
    if feasible.any():
        fitness[feasible] = objective[feasible].max() - objective[feasible]
    if not fitness.any():
        fitness[feasible if feasible.any() else ...] = 1.0
    # Divided by the largest first: the sum of huge fitnesses must not overflow.
    chance = fitness / fitness.max()
    return rng.choice(len(objective), size=count, p=chance / chance.sum())


def pointwise_swaps(pairs: int, length: int, points: int, rng: Generator) -> Bool:
    """Genes that n-point crossover swaps: every other stretch between randomly placed cuts.

    Returns:
        Shape (pairs, length). Cuts are distinct, between genes and uniformly placed; a string has no more
        than length - 1 of them.
    """
    order = rng.random((pairs, length - 1)).argsort(axis=1)
    starts = np.zeros((pairs, length), dtype=bool)
    np.put_along_axis(starts, 1 + order[:, :points], values=True, axis=1)
    return np.cumsum(starts, axis=1) % 2 == 1


def uniform_swaps(pairs: int, length: int, rng: Generator) -> Bool:
    """Genes that uniform crossover swaps: each with chance 1/2, so that a child has half of each parent's.

    Returns:
        Shape (pairs, length).
    """
    return rng.random((pairs, length)) < 0.5


def crossover(parents: Genes, settings: GeneticSettings, rng: Generator) -> Genes:
    """Children of neighbouring parents (0 with 1, 2 with 3, ...).

    Args:
        parents: shape (n, length), n even.
        settings: crossover type, and the chance P_c that a pair crosses at all.
        rng: source of randomness.

    Returns:
        Shape (n, length); at each gene the two children of a pair hold what its two parents held.
    """
    first, second = parents[0::2], parents[1::2]
    pairs, length = first.shape
    if settings.crossover == "pointwise":
        swaps = pointwise_swaps(pairs, length, CUTS, rng)
    else:
        swaps = uniform_swaps(pairs, length, rng)
    swaps &= rng.random((pairs, 1)) < settings.crossover_rate
    children = np.empty_like(parents)
    children[0::2] = np.where(swaps, second, first)
    children[1::2] = np.where(swaps, first, second)
    return children


def mutate(chromosomes: Genes, rate: float, coding: Coding, rng: Generator) -> Genes:
    """Mutate each element (each parameter) of each chromosome with chance P_m = `rate`.

    What changes in an element is the coding's: one random bit flips (binary), or it is redrawn (integer).

    Returns:
        Shape (n, length).
    """
    hit = rng.random((len(chromosomes), coding.parameters)) < rate
    return np.where(np.repeat(hit, coding.width, axis=1), coding.altered(chromosomes, rng), chromosomes)
