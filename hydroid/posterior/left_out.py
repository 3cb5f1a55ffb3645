"""What the fitted logs say about an unseen one: the error on each of them if the fit had left it out.

Where the model errs, its parameters make up for it, log by log. Noise and covariance know nothing of this;
the error on a log that a fit has not seen does. To first order it needs no further fit: with the
orthonormal effects U of the estimate (`decompose`), U_g the columns of log g, r_g its residual and
A_g = U_g U_g', the fit to the other logs leaves

    r_g + U_g' (1 - A_g)^-1 U_g r_g

(the residual that D. M. Allen, 1974, sums up, for a log instead of a sample). What one log alone determines
stays as it is: the others say nothing of it.
"""

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.by_log import ALONE
from hydroid.posterior.covariance import Uncertainty, decompose
from hydroid.problem.problem import Problem


def left_out_errors(problem: Problem, uncertainty: Uncertainty) -> dict[int, Array]:
    """Rms error of each compared angle on each log if it is left out [rad], shape (G,), by joint.

    Empty for one log.
    """
    at, logs = uncertainty.jacobian, {channel.log for channel in problem.channels}
    inside = uncertainty.free & [status.at_bound is None for status in uncertainty.status]
    if len(logs) < 2 or not inside.any():
        return {}
    _, values, effects = decompose(inside, at)
    effects, row = effects[values > 0, : at.residual.size], at.residual.copy()
    for log in logs:
        columns = np.concatenate([np.r_[c.rows] for c in problem.channels if c.log == log])
        own = effects[:, columns]
        share, axes = np.linalg.eigh(own @ own.T)
        gained = np.where(share > ALONE, 0.0, 1 / (1 - np.minimum(share, ALONE)))
        row[columns] += own.T @ (axes @ (gained * (axes.T @ (own @ at.residual[columns]))))
    angles = [channel for channel in problem.channels if channel.quantity == "angle"]
    return {
        joint: np.array([np.sqrt(np.mean((row[c.rows] / c.weight) ** 2)) for c in angles if c.joint == joint])
        for joint in dict.fromkeys(c.joint for c in angles)
    }
