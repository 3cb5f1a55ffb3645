"""What the logs and the priors each contribute: the share of the information, and priors under strain."""

from dataclasses import dataclass

import numpy as np

from hydroid.parameters import Array
from hydroid.posterior.jacobian import Jacobian
from hydroid.problem.problem import Problem

STRAINED_ABOVE = 2.0
"""standard deviations from its prior beyond which an estimate strains it"""
ROUNDING = 1e-9
"""a share below this is none"""


@dataclass(frozen=True)
class Strain:
    """A prior that the estimate is far from, and the channel that pulls hardest.

    Attributes:
        prior: its name; that of a single parameter is the parameter's.
        score: distance of the estimate from its value, in standard deviations.
        log, joint: of the channel: number of the log from 0, of the joint from 1.
        quantity: of the channel: an angle or a pressure.
        share: part of the pull of all channels that pull the same way.
    """

    prior: str
    score: float
    log: int
    joint: int
    quantity: str
    share: float


def data_shares(slopes: Array, variance: Array) -> Array:
    """Return 1 - posterior / prior variance of each free parameter, shape (p,); 1 where there is no prior.

    Args:
        slopes: derivatives of the priors' scores per relative change of the free parameters, (p, M).
        variance: of the free parameters after the fit, shape (p,); inf where unknown.
    """
    # zero rows: directions that no prior knows keep a singular value of exactly 0
    _, values, directions = np.linalg.svd(np.vstack([slopes.T, np.zeros((len(slopes),) * 2)]))
    known = values > 1e-12 * values.max(initial=0.0)
    reached = np.linalg.norm(directions[~known], axis=0) <= 1e-6
    inverse = directions[known] / values[known, None]
    prior = np.where(reached, np.sum(inverse**2, axis=0), np.inf)
    with np.errstate(invalid="ignore"):
        share = 1 - variance / prior
    return np.where(reached, np.clip(np.where(share < ROUNDING, 0.0, share), 0.0, 1.0), 1.0)


def strains(problem: Problem, theta: Array, derivatives: Jacobian) -> tuple[Strain, ...]:
    """Return the priors that an estimate, shape (P,), strains, the most strained first.

    The pull of a channel is the slope of its sum of squares along the change of the parameters that brings
    the prior's score back; at an optimum the pulls balance the prior.
    """
    scores = problem.priors.scores(theta[None])[0]
    found: list[Strain] = []
    for m in np.argsort(-np.abs(scores)):
        if abs(scores[m]) <= STRAINED_ABOVE:
            break
        back = -np.sign(scores[m]) * np.nan_to_num(derivatives.slopes).T @ derivatives.prior_slopes[:, m]
        pulls = [max(float(back[c.rows] @ derivatives.residual[c.rows]), 0.0) for c in problem.channels]
        hardest = problem.channels[int(np.argmax(pulls))]
        share = max(pulls) / sum(pulls) if any(pulls) else 0.0
        found.append(
            Strain(
                problem.priors.names[m],
                float(scores[m]),
                hardest.log,
                hardest.joint,
                hardest.quantity,
                share,
            )
        )
    return tuple(found)
