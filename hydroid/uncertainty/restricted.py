"""The noise that a fit hides, and how well a record determines it.

A least-squares fit absorbs the part of the noise that resembles its parameters' effects, slow noise above
all. The residual therefore shows too little noise. *Restricted* maximum likelihood (H. D. Patterson and R.
Thompson, 1971) estimates the noise from what no parameter can absorb. With X the effects and S the noise's
covariance, generalised least squares leaves the residual e, and the covariance of what it absorbed is
X' (X S^-1 X')^-1 X. The expected products of the noise are those of e plus this covariance, and an
autoregressive process is fitted to their sum, in a few rounds because S is not known beforehand (the
expectation-maximisation algorithm of A. P. Dempster, N. M. Laird and D. B. Rubin, 1977).

A variance v that follows from the process is uncertain because the process is. Its logarithm is about normal,
with a variance from the process's own information (P. Whittle, 1953) by the delta method: `neighbours`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.parameters import Array
from hydroid.problem.channels import Channel
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.noise import Noise, channel_noise

ROUNDS = 4
"""of expectation and maximisation"""
STEP = 1e-4
"""of the differences by a process's numbers, in hyperbolic arc tangents of its reflection coefficients"""


def restricted_noise(
    channels: Sequence[Channel], residual: Array, effects: Array, objective: ObjectiveSettings
) -> tuple[Noise, ...]:
    """Return each channel's noise before a fit absorbed a part of it.

    Args:
        channels: of the residual.
        residual: with M priors' scores behind it, in units of their standard deviation, shape (R + M,).
        effects: rows that span the derivatives of the same, shape (k, R + M).
        objective: gives the noise of channels where it is known.
    """
    noise = tuple(channel_noise(c, residual[c.rows], objective) for c in channels)
    for _ in range(ROUNDS if any(process.source != "settings" for process in noise) else 0):
        left, absorbed = _whitened_fit(channels, noise, residual, effects)
        noise = tuple(channel_noise(c, np.vstack([left, absorbed])[:, c.rows], objective) for c in channels)
    return noise


def _whitened_fit(
    channels: Sequence[Channel], noise: Sequence[Noise], residual: Array, effects: Array
) -> tuple[Array, Array]:
    """Residual of generalised least squares, (R + M,), and a root of the covariance absorbed, (k, R + M)."""
    rows = np.vstack([residual, effects])
    white = rows.copy()
    for channel, process in zip(channels, noise, strict=True):
        white[:, channel.rows] = process.whitened(rows[:, channel.rows])
    directions, values, patterns = np.linalg.svd(white[1:], full_matrices=False)
    root = (directions / values).T @ effects
    return residual - (patterns @ white[0]) @ root, root


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
