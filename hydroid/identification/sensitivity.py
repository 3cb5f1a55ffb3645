"""What the response feels at an estimate: each parameter's effect, and how many combinations it tells apart.

A local, first-order look. A small output error proves nothing about a direction that the response does not
feel; here such directions are counted, and the parameters that lie in them are named.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.identification.problem import Problem
from hydroid.parameters import Array

STEP = 1e-4
"""relative step of the differences"""
NO_EFFECT = 1e-6
"""a parameter that moves the response less than this times the strongest one's has no effect on it"""
SENSOR = np.deg2rad(0.05)
"""the least error of an angle that is believed [rad]: potentiometers and converters are no better (ours)"""
KNOWN = 0.3
"""a direction or parameter counts as determined when its relative standard deviation is below this"""


@dataclass(frozen=True)
class Sensitivity:
    """What moves the response.

    effects: rms change of the response [rad] per 1 % of each parameter, shape (P,); NaN where the changed set
    diverges. undetermined: free parameters that the response leaves uncertain by more than KNOWN, shape (P,).
    combinations: independent combinations of the free parameters that it does determine.
    """

    effects: Array
    undetermined: NDArray[np.bool_]
    combinations: int

    @property
    def without_effect(self) -> NDArray[np.bool_]:
        """Parameters that the outputs do not feel at all, shape (P,)."""
        return self.effects <= NO_EFFECT * np.nanmax(self.effects, initial=0.0)


def sensitivity(problem: Problem, theta: Array) -> Sensitivity:
    """Return what moves the response at theta, shape (P,).

    Relative standard deviations are those of a linear fit with independent errors of the size of the residual
    (at least SENSOR), to parameters thought to be within 100 % before it.
    """
    width = problem.parameters.upper - problem.parameters.lower
    # a value near 0 counts as a thousandth of the width of its bounds
    moved = theta + np.diag(STEP * np.maximum(np.abs(theta), 1e-3 * width))
    rows = problem.residuals(np.vstack([theta, moved]))
    slopes = (rows[1:] - rows[0]) / STEP  # per relative change, (P, R)
    effects = 0.01 * np.sqrt(np.mean(slopes**2, axis=1))
    noise = max(float(np.sqrt(np.mean(rows[0] ** 2))), SENSOR)
    free = problem.parameters.free
    told = np.nan_to_num(slopes[free], posinf=0.0, neginf=0.0)
    information = told @ told.T / noise**2
    deviation = np.sqrt(np.diag(np.linalg.inv(information + np.eye(len(told)))))
    undetermined = np.zeros(len(theta), dtype=bool)
    undetermined[free] = deviation > KNOWN
    combinations = int(np.sum(np.linalg.eigvalsh(information) > KNOWN**-2))
    return Sensitivity(effects, undetermined, combinations)
