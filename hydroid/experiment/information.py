"""Fisher information of experiments about the parameters, and the precision that follows from it.

All matrices are in relative changes of the free parameters, x = d theta / theta. Units do not matter, and a
standard deviation of 0.1 means 10 %.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from hydroid.parameters import Array, ParameterSet
from hydroid.problem.priors import Priors
from hydroid.problem.problem import Problem
from hydroid.settings.experiment import DesignSettings
from hydroid.uncertainty.jacobian import STEP, jacobian, relative_scale
from hydroid.uncertainty.noise import Noise, channel_noise

PRIOR_SD = 1.0
"""relative standard deviation of every parameter before any log or prior (ours)"""


def information(slopes: Array, noise: Noise) -> Array:
    """Fisher information of F parameters in one channel with Gaussian noise.

    Args:
        slopes: its derivatives per relative change of each, shape (F, T).
        noise: of the channel, in the same unit.

    Returns:
        Shape (F, F).
    """
    white = noise.whitened(slopes)
    return white @ white.T


def sensor_noise(settings: DesignSettings, samples: int, period: float) -> Noise:
    """Return the noise of a future log of angles [rad]: white, or a first-order autoregression."""
    level, time = float(np.radians(settings.noise_deg)), settings.noise_correlation_s
    reflection = np.array([-np.exp(-period / time)]) if time > 0 else np.empty(0)
    return Noise(samples, level, reflection, "settings")


def log_information(problem: Problem, theta: Array) -> Array:
    """Information of logs about the free parameters, for the noise that they show, shape (F, F)."""
    at = jacobian(problem, theta)
    slopes = np.nan_to_num(at.slopes[problem.parameters.free])
    parts = [
        information(
            slopes[:, channel.rows],
            channel_noise(channel, at.residual[channel.rows], problem.settings.objective),
        )
        for channel in problem.channels
    ]
    return np.sum(parts, axis=0)


def prior_information(priors: Priors, parameters: ParameterSet, theta: Array) -> Array:
    """Information of the priors about the free parameters, shape (F, F)."""
    change = np.diag(STEP * relative_scale(parameters, theta))[parameters.free]
    scores = priors.scores(np.vstack([theta + change, theta - change]))
    slopes = (scores[: len(change)] - scores[len(change) :]) / (2 * STEP)
    return slopes @ slopes.T


@dataclass(frozen=True, eq=False)
class Judge:
    """Says how good an experiment is, beside the information that is there already.

    Every parameter has a weak prior of PRIOR_SD. A direction without any information then stays at 100 % and
    does not make the covariance infinite. It must not hide the others either, so the E criterion looks at
    `directions` only.

    Attributes:
        known: information of earlier logs and of the priors in the settings, shape (F, F).
        directions: orthonormal basis of the directions that such experiments improve on PRIOR_SD, (F, d).
    """

    known: Array
    directions: Array

    @staticmethod
    def of(known: Array, typical: Array) -> "Judge":
        """Return the judge for experiments of which `typical`, shape (F, F), is a mean information."""
        values, vectors = np.linalg.eigh(known + typical)
        improved = values > 1 / PRIOR_SD**2
        improved[-1] = True  # one direction at least, to compare experiments by
        return Judge(known, vectors[:, improved])

    def covariance(self, information: Array | None = None) -> Array:
        """Covariance of relative errors after an experiment, or without one, shape (F, F)."""
        total = self.known + np.eye(len(self.known)) / PRIOR_SD**2
        if information is not None:
            total = total + information
        # exact statements leave a matrix of very unequal scales: unit diagonal first
        scale = 1 / np.sqrt(np.diag(total))
        inverse = cho_solve(cho_factor(total * np.outer(scale, scale)), np.eye(len(total)))
        return inverse * np.outer(scale, scale)

    def deviations(self, information: Array | None = None) -> Array:
        """Relative standard deviation of each free parameter, shape (F,)."""
        return np.sqrt(np.diag(self.covariance(information)))

    def weakest(self, information: Array | None = None) -> tuple[float, Array]:
        """Relative standard deviation and unit vector (F,) of the least known of `directions`."""
        basis = self.directions
        values, vectors = np.linalg.eigh(basis.T @ self.covariance(information) @ basis)
        return float(np.sqrt(values[-1])), basis @ vectors[:, -1]

    def score(self, information: Array, criterion: str) -> float:
        """Merit, higher is better: minus the log of the weakest deviation (E), half a log determinant (D)."""
        if criterion == "E":
            return -float(np.log(self.weakest(information)[0]))
        return 0.5 * float(
            np.linalg.slogdet(self.known + information + np.eye(len(information)) / PRIOR_SD**2)[1]
        )
