"""What an experiment tells about the parameters: information matrices and what follows from them.

Everything is in relative changes of the free parameters, x = d theta / theta: sizes and units do not matter,
and a standard deviation of 0.1 means 10 %.
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

PRIOR = 1.0
"""relative standard deviation that every parameter has before anything is known (ours)"""


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
    level, memory = float(np.radians(settings.noise_deg)), settings.noise_correlation_s
    reflection = np.array([-np.exp(-period / memory)]) if memory > 0 else np.empty(0)
    return Noise(samples, level, reflection, "settings")


def log_information(problem: Problem, theta: Array) -> Array:
    """Information of logs about the free parameters, with the noise that they show, shape (F, F)."""
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


def statement_information(priors: Priors, parameters: ParameterSet, theta: Array) -> Array:
    """Information of what is known besides all logs about the free parameters, shape (F, F)."""
    change = np.diag(STEP * relative_scale(parameters, theta))[parameters.free]
    scores = priors.scores(np.vstack([theta + change, theta - change]))
    slopes = (scores[: len(change)] - scores[len(change) :]) / (2 * STEP)
    return slopes @ slopes.T


@dataclass(frozen=True, eq=False)
class Judge:
    """Says how good an experiment is, beside what is known without it.

    Every parameter has the weak prior PRIOR, so that directions that no experiment tells stay at 100 % and do
    not make the covariance infinite. They must not hide the others either: the E criterion looks at
    `directions` only, an orthonormal basis (F, d) of what experiments like these tell better than the prior.

    known: information of earlier logs and of statements in the settings, shape (F, F).
    """

    known: Array
    directions: Array

    @staticmethod
    def of(known: Array, typical: Array) -> "Judge":
        """Return the judge for experiments of which `typical`, shape (F, F), is a mean information."""
        values, vectors = np.linalg.eigh(known + typical)
        told = values > 1 / PRIOR**2
        told[-1] = True  # at least one direction, or there is nothing to choose by
        return Judge(known, vectors[:, told])

    def covariance(self, told: Array | None = None) -> Array:
        """Of relative errors after an experiment with information `told`, or without one; shape (F, F)."""
        total = self.known + np.eye(len(self.known)) / PRIOR**2
        if told is not None:
            total = total + told
        # exact statements leave a matrix of very unequal scales: unit diagonal first
        scale = 1 / np.sqrt(np.diag(total))
        inverse = cho_solve(cho_factor(total * np.outer(scale, scale)), np.eye(len(total)))
        return inverse * np.outer(scale, scale)

    def deviations(self, told: Array | None = None) -> Array:
        """Relative standard deviation of each free parameter, shape (F,)."""
        return np.sqrt(np.diag(self.covariance(told)))

    def weakest(self, told: Array | None = None) -> tuple[float, Array]:
        """Relative standard deviation and unit vector (F,) of the least known of `directions`."""
        basis = self.directions
        values, vectors = np.linalg.eigh(basis.T @ self.covariance(told) @ basis)
        return float(np.sqrt(values[-1])), basis @ vectors[:, -1]

    def score(self, told: Array, criterion: str) -> float:
        """Merit, higher is better: minus the log of the weakest deviation (E), half a log determinant (D)."""
        if criterion == "E":
            return -float(np.log(self.weakest(told)[0]))
        return 0.5 * float(np.linalg.slogdet(self.known + told + np.eye(len(told)) / PRIOR**2)[1])
