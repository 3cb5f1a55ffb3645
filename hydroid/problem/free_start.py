"""Start angles that a log does not show well enough: the fit leaves them open.

A simulation starts from the mean of the angles before the first command. If there is no rest, or it drifts,
this start is wrong by about the noise, and the whole response with it: an error that no other noise
resembles. The true start of each compared joint is then one more unknown of its log. To first order it
changes the residuals by a multiple of their derivative by the start, and what it can explain is taken out of
them: least squares over the parameters and the start angles together (variable projection; G. H. Golub and
V. Pereyra, 1973). Everything that is computed from such residuals, intervals too, holds for any start angle.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hydroid.log import Log
from hydroid.parameters import Array

STEP = float(np.radians(0.1))
"""of the differences by a start angle"""
FEWEST_SAMPLES = 25.0
"""independent samples of rest, below which the start is open: its error is then above a fifth of the noise"""
LEAST_EFFECT = 1e-6
"""part of the residuals' change; a start angle that changes less has no effect"""


def open_joints(log: Log, joints: list[int], free: bool | str) -> list[int]:
    """Return which of some joints, numbered from 1, have an open start angle in a log."""
    samples = log.start_samples
    return [j for j in joints if free is True or (free == "auto" and samples[j - 1] < FEWEST_SAMPLES)]


@dataclass(frozen=True, eq=False)
class OpenStart:
    """Start angles of one log that are open.

    Attributes:
        rows: the log's residuals in a row of all.
        joints: numbered from 1, those that have an effect.
        slopes: derivatives of these residuals by each start angle, shape (k, rows).
        basis: orthonormal rows that span the same, shape (k, rows).
    """

    rows: slice
    joints: tuple[int, ...]
    slopes: Array
    basis: Array

    def close(self, residuals: Array) -> None:
        """Take what the start angles can explain out of residuals, shape (n, R)."""
        part = residuals[:, self.rows]
        part -= (part @ self.basis.T) @ self.basis

    def angles(self, residual: Array) -> Array:
        """Return by how much the start angles were wrong [rad], shape (k,), from a residual, shape (R,)."""
        return np.asarray(-np.linalg.lstsq(self.slopes.T, residual[self.rows])[0], dtype=np.float64)


def open_start(rows: slice, joints: list[int], residuals: Callable[[int, float], Array]) -> OpenStart | None:
    """Return the open start of a log, whose residuals are a function of a joint and its shift [rad]."""
    slopes = np.array([(residuals(j, STEP) - residuals(j, -STEP)) / (2 * STEP) for j in joints])
    length = np.linalg.norm(slopes, axis=1)
    felt = np.isfinite(length) & (length > LEAST_EFFECT * np.sqrt(slopes.shape[1]))
    if not felt.any():
        return None
    basis = np.linalg.svd(slopes[felt], full_matrices=False)[2]
    return OpenStart(
        rows, tuple(j for j, each in zip(joints, felt, strict=True) if each), slopes[felt], basis
    )
