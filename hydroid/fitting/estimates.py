"""The estimates of a fit: parameter sets with what they leave of the logs."""

from collections.abc import Mapping

import numpy as np

from hydroid.arrays import Array, record
from hydroid.fitting.left_out import Gain
from hydroid.problem.problem import Problem


@record
class Estimate:
    """One parameter set with its response.

    Attributes:
        name: of the estimate.
        theta: its parameters, shape (P,).
        segments: objectives by segment, shape (S,).
        overall: norm over the whole record.
        rms: of the output error [rad].
        responses: simulated outputs of each log [rad], shape (T, K).
        gained: of an estimate with another term or model, by how much it foretells
            parts of the logs left out better than the one below, and the standard error
            of that (`left_out.gain`).
    """

    name: str
    theta: Array
    segments: Array
    overall: float
    rms: float
    responses: tuple[Array, ...]
    gained: Gain | None = None

    @property
    def usable(self) -> bool:
        """Whether it could be simulated.

        False where it diverged; a mean of candidates may diverge though none of them
        does.
        """
        return bool(np.isfinite(self.rms))


def simulated(problem: Problem, candidates: Mapping[str, Array]) -> dict[str, Estimate]:
    """Simulate candidates by name, each of shape (P,), and measure them; those that
    diverged come last."""
    theta = np.array(list(candidates.values()))
    responses = problem.responses(theta)
    errors = problem.errors(responses)
    norms, rms = problem.norms(errors), problem.rms(errors)
    # of each candidate
    angles = zip(*(response.angle for response in responses), strict=True)
    estimates = map(
        Estimate, candidates, theta, norms[:, :-1], norms[:, -1], rms, angles
    )
    return {e.name: e for e in sorted(estimates, key=lambda e: not e.usable)}
