"""The verdict strip of a fit's page: two sentences, and the lights."""

import math

import numpy as np

from hydroid.fitting.fit import Fit
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE, Flag
from hydroid.problem.problem import Problem
from hydroid.report.page import Light, Verdict
from hydroid.report.phrases import at_limits, at_zero
from hydroid.report.quantities_report import known_quantities
from hydroid.words import listed

VALIDATED = "Validated on unseen logs"
"""question of a light"""
_MOST_NAMES = 4


def fit_verdict(problem: Problem, fit: Fit) -> Verdict:
    """Return the verdict on a fit from its own logs."""
    count = len(problem.logs)
    logs = "the fitted log" if count == 1 else f"the {count} fitted logs"
    rms = f"{math.degrees(fit.best.rms):.2g}"
    prediction = f"Reproduces {logs} with an error of {rms}° rms."
    known, free = known_count(fit)
    percent = f"{100 * WEAK_ABOVE:.0f} %"
    parameters = f"{known} of {free} parameters are known with a standard deviation of {percent} or less."
    if determined := known_quantities(fit.quantities):
        follow = "quantity that follows" if determined == 1 else "quantities that follow"
        has = "has" if determined == 1 else "have"
        parameters += (
            f" {determined} {follow} from all of them together {has} a 95 % interval within ±{percent}."
        )
    lights = (_converged(fit), _validated(), *uncertainty_lights(problem, fit.uncertainty))
    return Verdict(prediction, parameters, lights)


def known_count(fit: Fit) -> tuple[int, int]:
    """Return how many parameters are known to 30 % from logs and priors, and how many are free."""
    known = fit.uncertainty
    return int(np.sum(known.relative[known.free] <= WEAK_ABOVE)), int(known.free.sum())


def _converged(fit: Fit) -> Light:
    if fit.refinement is None:
        return Light("Converged", "fair", "Not refined: the search's own estimate.")
    if fit.converged:
        return Light("Converged", "good", "Yes: least squares found an optimum.")
    return Light("Converged", "bad", f"No: {fit.refinement.ending.value}.")


def _validated() -> Light:
    return Light(VALIDATED, "open", "Not yet: hydroid validate OTHER.csv --fit RUN.")


def uncertainty_lights(problem: Problem, known: Uncertainty) -> tuple[Light, Light]:
    """Return the lights for identifiable, and away from bounds."""
    status = dict(zip(problem.parameters.names, known.status, strict=True))
    lost = [name for name, s in status.items() if s.flag in (Flag.UNIDENTIFIABLE, Flag.NO_EFFECT)]
    weak = [name for name, s in status.items() if s.flag is Flag.WEAK]
    at, nothing = at_limits(problem, known), at_zero(problem, known)
    question = "Identifiable"
    if lost:
        first = Light(question, "bad", f"Not from these logs: {_some(lost)}.")
    elif weak:
        first = Light(question, "fair", f"Weakly: {_some(weak)} (standard deviation 30 to 100 %).")
    else:
        first = Light(question, "good", "Yes: every free parameter.")
    if at:
        words = f"All but {_some(at)}: widen the bounds, or the model lacks something."
        return first, Light("Away from bounds", "bad", words)
    words = f"All parameters; {_some(nothing)} {'is' if len(nothing) == 1 else 'are'} 0." if nothing else ""
    return first, Light("Away from bounds", "good", words or "All parameters.")


def _some(names: list[str]) -> str:
    more = len(names) - _MOST_NAMES
    return listed(names) if more <= 1 else f"{', '.join(names[:_MOST_NAMES])} and {more} more"
