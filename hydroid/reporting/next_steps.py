"""Do next: the steps that promise most, ranked, each with what it is predicted to bring."""

from hydroid.fitting.fit import Fit
from hydroid.problem.problem import Problem
from hydroid.reporting.page import Section, Step
from hydroid.reporting.phrases import listed
from hydroid.reporting.suggestion_report import MOST_STEPS, suggested_steps
from hydroid.suggestion.suggest import Suggestions
from hydroid.uncertainty.flags import Flag

PREDICT_UNSEEN = "Predict a log that this fit has not seen: hydroid validate OTHER.csv --fit RUN."


def fit_steps(problem: Problem, fit: Fit, suggested: Suggestions | None) -> Section:
    """Return what to do after a fit."""
    steps: list[Step] = []
    if fit.refinement is None:
        steps.append(
            Step(
                "Refine the estimate: leave out --no-refinement.",
                "The search's own estimate need not be an optimum.",
            )
        )
    elif not fit.converged:
        what = "Let the refinement finish: allow more iterations (refinement.iterations), or another seed."
        steps.append(Step(what, "Until then neither the estimate nor its intervals can be trusted."))
    at = [
        name
        for name, status in zip(problem.parameters.names, fit.uncertainty.status, strict=True)
        if status.at_bound and status.flag is not Flag.NO_EFFECT
    ]
    if at:
        gain = "The error falls beyond the bound. If such values are impossible, the model lacks something."
        steps.append(
            Step(f"Widen the bounds of {listed(at)} if larger or smaller values are possible.", gain)
        )
    steps += [] if suggested is None else suggested_steps(problem, suggested)
    unseen = Step(
        PREDICT_UNSEEN,
        "It shows how large the error is elsewhere, and whether the fitted logs lead to expect it.",
    )
    return Section(
        "Do next", steps=tuple([*steps[: MOST_STEPS - 1], unseen, *steps[MOST_STEPS - 1 :]][:MOST_STEPS])
    )
