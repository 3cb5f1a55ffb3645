"""Codings: how a point of the unit box becomes a chromosome, equation (23), article 4.1 and 5.4.

A chromosome is a row of genes; each element of equation (23), one parameter, owns `width` of them.
Both codings divide a parameter's range into the same 65,535 steps, ends included.

- Gray: the article's multivariable binary string. An element is 16 bits, highest first, in Gray code:
  neighbouring values differ in one bit, so a flipped bit or a cut through an element need not jump.
- Integer: an element is one number from 0 to 65,535; operators never cut through a parameter.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Float = NDArray[np.float64]
Genes = NDArray[Any]
"""Chromosomes, shape (n, length): bits (uint8) or integers (uint16)."""

BITS = 16
STEPS = 2**BITS - 1


@dataclass(frozen=True)
class GrayCoding:
    """16 Gray-coded bits per element (MVBS)."""

    parameters: int
    width: int = BITS

    def random(self, n: int, rng: Generator) -> Genes:
        """Uniform bits, hence uniform points: shape (n, parameters * width)."""
        return rng.integers(0, 2, (n, self.parameters * BITS), dtype=np.uint8)

    def decode(self, chromosomes: Genes) -> Float:
        """Points of the unit box, shape (n, parameters)."""
        gray = chromosomes.reshape(-1, self.parameters, BITS)
        bits = np.bitwise_xor.accumulate(gray, axis=-1)
        return bits @ 2.0 ** np.arange(BITS - 1, -1, -1) / STEPS

    def encode(self, points: Float) -> Genes:
        """Chromosomes of the nearest points of the grid."""
        value = _nearest(points)
        gray = value ^ (value >> 1)
        bits = gray[..., None] >> np.arange(BITS - 1, -1, -1) & 1
        return bits.astype(np.uint8).reshape(len(points), -1)

    def altered(self, chromosomes: Genes, rng: Generator) -> Genes:
        """Flip one random bit of every element."""
        flipped = rng.integers(0, BITS, (len(chromosomes), self.parameters, 1))
        flips = flipped == np.arange(BITS)
        return chromosomes ^ flips.reshape(chromosomes.shape).astype(np.uint8)


@dataclass(frozen=True)
class IntegerCoding:
    """One integer from 0 to 65,535 per element."""

    parameters: int
    width: int = 1

    def random(self, n: int, rng: Generator) -> Genes:
        """Uniform integers, shape (n, parameters)."""
        return rng.integers(0, STEPS, (n, self.parameters), dtype=np.uint16, endpoint=True)

    def decode(self, chromosomes: Genes) -> Float:
        """Points of the unit box, shape (n, parameters)."""
        return chromosomes / float(STEPS)

    def encode(self, points: Float) -> Genes:
        """Chromosomes of the nearest points of the grid."""
        return _nearest(points).astype(np.uint16)

    def altered(self, chromosomes: Genes, rng: Generator) -> Genes:
        """Redraw every element uniformly."""
        return self.random(len(chromosomes), rng)


Coding = GrayCoding | IntegerCoding


def _nearest(points: Float) -> NDArray[np.int64]:
    return np.rint(np.clip(points, 0, 1) * STEPS).astype(np.int64)
