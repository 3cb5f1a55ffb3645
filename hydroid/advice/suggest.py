"""All suggestions about a fit: what its model lacks, what its residual shows, what to do next."""

from dataclasses import dataclass

from hydroid.advice.actions import Action, next_actions
from hydroid.advice.missing import MissingTerms, missing_terms
from hydroid.advice.residuals import ResidualCheck, residual_checks
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.quantities import Quantities, quantities
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress


@dataclass(frozen=True, eq=False)
class Suggestions:
    """What to change next.

    Attributes:
        missing: tests of what the fit holds.
        residuals: one check for each compared angle.
        actions: the best first.
        thorough: whether all was simulated, as `hydroid suggest` does, or what a fit's report can afford.
    """

    missing: MissingTerms
    residuals: tuple[ResidualCheck, ...]
    actions: tuple[Action, ...]
    thorough: bool


def suggestions(
    problem: Problem,
    uncertainty: Uncertainty,
    determined: Quantities | None = None,
    *,
    thorough: bool = True,
    progress: Progress = no_progress,
) -> Suggestions:
    """Return the suggestions about an estimate; `thorough` ones take several times the simulations.

    `determined` are the quantities at the estimate, if they are known already.
    """
    determined = quantities(problem, uncertainty) if determined is None else determined
    missing = missing_terms(problem, uncertainty, thorough=thorough, progress=progress)
    several = len(problem.active_joints) > 1
    scalars = determined.scalars
    slopes = {
        f"{scalars[name].label}{f' of joint {scalars[name].joint}' if several else ''}": each
        for name, each in determined.slopes.items()
    }
    actions = next_actions(problem, uncertainty, slopes, simulate=thorough, progress=progress)
    return Suggestions(missing, residual_checks(problem, uncertainty), actions, thorough)
