"""Directions: combinations of parameters that the logs and priors do not determine.

A direction is a set of relative changes made together. Where its effect on the response is below the noise,
it is unidentifiable. Parameters that are so by themselves have their flag; the directions here are the axes
of what is left.
"""

from dataclasses import dataclass

import numpy as np

from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.uncertainty import Uncertainty
from hydroid.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The directions that are determined, and those that are not.

    Attributes:
        names: of the p parameters that vary.
        alone: those of them that are not determined to WEAK_ABOVE, whatever the others are.
        combinations: of the other parameters that are not determined either, the least determined first: the
            relative changes, the largest +1, of those that take a tenth of it or more.
    """

    names: tuple[str, ...]
    alone: tuple[str, ...]
    combinations: tuple[dict[str, float], ...]

    @property
    def rank(self) -> int:
        """Number of independent combinations that are determined."""
        return len(self.names) - len(self.alone) - len(self.combinations)


def identifiability(problem: Problem, uncertainty: Uncertainty) -> Identifiability:
    """Return the directions that are not determined at an estimate."""
    root = uncertainty.posterior.root
    names = np.array(problem.parameters.names)[uncertainty.linear.box.varied]
    alone = np.linalg.norm(root, axis=0) < 1 / WEAK_ABOVE
    _, values, axes = np.linalg.svd(root[:, ~alone], full_matrices=False)
    combinations: list[dict[str, float]] = []
    for axis in axes[values < 1 / WEAK_ABOVE][::-1]:
        changes = axis / axis[np.argmax(np.abs(axis))]
        order = [i for i in np.argsort(-np.abs(changes), kind="stable") if abs(changes[i]) >= 0.1]
        combinations.append({str(names[~alone][i]): float(changes[i]) for i in order})
    return Identifiability(tuple(names.tolist()), tuple(names[alone].tolist()), tuple(combinations))
