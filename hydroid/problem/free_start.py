"""Start angles that a log does not show well enough: the fit leaves them open.

A simulation starts from the mean of the angles before the first command. If there is no rest, or it drifts,
this start is wrong by about the sensor's noise, and the whole response with it: an error that no other noise
resembles. The true start of each joint is then one more unknown of its log, with a prior of that noise. To
first order it changes the residuals by a multiple of their derivative by the start. What it can explain is
taken out of them: least squares over the parameters and the start angles together (variable projection;
G. H. Golub and V. Pereyra, 1973), which is to whiten the residuals for a start angle that is random. All that
is computed from such residuals, intervals too, holds for any start angle that the prior allows.
"""

from dataclasses import replace

import numpy as np

from hydroid.arm.model import load_model
from hydroid.arrays import Array, record
from hydroid.problem.channels import compared_pressures
from hydroid.problem.problem import OpenStart, Problem, make_simulation

STEP = np.radians(0.05)  # of the differences by a start angle


@record
class StartSlopes:
    """What the start angles of some joints of one log do to its residuals, a part of the row of all.

    `slopes` are derivatives of these by each start angle [rad/rad], shape (k, rows).
    """

    log: int
    rows: slice
    joints: tuple[int, ...]
    slopes: Array

    def opened(self, weights: Array) -> OpenStart:
        """Open the start angles. `weights`, (k,) [1]: of each, its prior's sd over the noise's level."""
        _, values, basis = np.linalg.svd(weights[:, None] * self.slopes, full_matrices=False)
        taken = 1 - 1 / np.sqrt(1 + values**2)  # 1 without a prior

        def close(residuals: Array) -> None:
            part = residuals[:, self.rows]
            part -= (part @ basis.T * taken) @ basis

        return close


def start_slopes(problem: Problem, theta: Array) -> list[StartSlopes]:
    """Differentiate the residuals at theta, shape (P,), by each log's start angles that are simulated from.

    One simulation for each. A start angle from which the simulation diverges has no effect.
    """
    spec = load_model(problem.settings.arm)
    base, slopes = problem.residuals(theta[None])[0], list[StartSlopes]()
    for i, log in enumerate(problem.logs):
        joints, pressures = problem.started(log), compared_pressures(log, problem.settings)
        channels = [channel for channel in problem.channels if channel.log == i]
        candidates = problem.bindings.candidates(theta[None], log.source)
        rows = slice(channels[0].rows.start, channels[-1].rows.stop)
        moved: list[Array] = []
        for joint in joints:
            start = log.angle + STEP * (np.arange(log.joints) == joint - 1)
            start = replace(log, angle=start)
            simulation = make_simulation(spec, start, problem.outputs, problem.settings, pressures)
            response = simulation.simulate(candidates)
            moved.append(np.concatenate([c.filtered(c.error(response))[0] for c in channels]))
        if moved:
            slope = (np.array(moved) - base[rows]) / STEP
            slope[~np.isfinite(slope).all(axis=1)] = 0.0
            slopes.append(StartSlopes(i, rows, tuple(joints), slope))
    return slopes
