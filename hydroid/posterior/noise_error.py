"""How well a record determines the process that describes its noise.

A variance that follows from an estimated process is uncertain because the process is. Its logarithm is about
normal, with a variance from the process's own information (P. Whittle, 1953) by the delta method.
"""

from dataclasses import replace

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.noise import Noise

STEP = 1e-4
"""of the differences by a process's numbers, in hyperbolic arc tangents of its reflection coefficients"""


def neighbours(noise: Noise) -> list[Noise]:
    """Return processes that differ from one by independent standard errors, STEP of each.

    A process that the settings give is not uncertain.
    """
    if noise.source == "settings":
        return []
    order, innovation = len(noise.reflection), noise.level**2 * float(np.prod(1 - noise.reflection**2))

    def at(shift: Array) -> Noise:
        reflection = np.tanh(np.arctanh(noise.reflection) + shift)
        return replace(
            noise, level=float(np.sqrt(innovation / np.prod(1 - reflection**2))), reflection=reflection
        )

    # standard error of the logarithm of the innovations' variance: sqrt(2 / T)
    found = [replace(noise, level=noise.level * float(np.exp(STEP * np.sqrt(0.5 / noise.samples))))]
    if order:
        spectrum = np.log(noise.spectrum)
        slopes = np.array([np.log(at(STEP * each).spectrum) - spectrum for each in np.eye(order)]) / STEP
        information = noise.samples / 2 * slopes @ slopes.T / slopes.shape[1]
        values, vectors = np.linalg.eigh(information)
        found += [at(STEP * v / np.sqrt(x)) for x, v in zip(values, vectors.T, strict=True) if x > 0]
    return found
