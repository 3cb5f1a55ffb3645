"""Start angles that a log does not show well enough: the fit leaves them open.

A simulation starts from the mean of the angles before the first command. If there is no rest, or it drifts,
this start is wrong by about the sensor's noise, and the whole response with it: an error that no other noise
resembles. The true start of each joint is then one more unknown of its log, with a prior of that noise. To
first order it changes the residuals by a multiple of their derivative by the start. What it can explain is
taken out of them: least squares over the parameters and the start angles together (variable projection;
G. H. Golub and V. Pereyra, 1973), which is to whiten the residuals for a start angle that is random. All that
is computed from such residuals, intervals too, holds for any start angle that the prior allows.
"""

from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array

STEP = float(np.radians(0.05))
"""of the differences by a start angle"""


@dataclass(frozen=True, eq=False)
class StartSlopes:
    """What the start angles of one log do to its residuals.

    Attributes:
        log: index of the log.
        rows: the log's residuals in a row of all.
        joints: numbered from 1.
        slopes: derivatives of these residuals by each start angle [rad/rad], shape (k, rows).
    """

    log: int
    rows: slice
    joints: tuple[int, ...]
    slopes: Array

    def opened(self, weights: Array) -> "OpenStart":
        """Open the start angles. `weights`, (k,) [1]: of each, its prior's sd over the noise's level."""
        _, values, basis = np.linalg.svd(weights[:, None] * self.slopes, full_matrices=False)
        return OpenStart(self.rows, basis, 1 - 1 / np.sqrt(1 + values**2))


@dataclass(frozen=True, eq=False)
class OpenStart:
    """Start angles of one log that are open.

    Attributes:
        rows: the log's residuals in a row of all.
        basis: orthonormal rows that span what the start angles do to them, shape (k, rows).
        taken: part of a residual along each that is taken out, shape (k,): 1 without a prior.
    """

    rows: slice
    basis: Array
    taken: Array

    def close(self, residuals: Array) -> None:
        """Take what the start angles can explain out of residuals, shape (n, R)."""
        part = residuals[:, self.rows]
        part -= (part @ self.basis.T * self.taken) @ self.basis
