"""Do next: the steps that promise most, ranked, each with what it is predicted to bring."""

import shlex

from hydroid.advice.suggest import Suggestions
from hydroid.fitting.fit import Fit
from hydroid.problem.problem import Problem
from hydroid.report.page import Section, Step
from hydroid.report.phrases import at_limits
from hydroid.report.suggestion_report import MOST_STEPS, suggested_steps
from hydroid.words import listed

PREDICT_UNSEEN = "Predict a log that this fit has not seen."


def fit_steps(problem: Problem, fit: Fit, suggested: Suggestions | None, run: str = "RUN") -> Section:
    """Return what to do after a fit; `run` is its folder as a command takes it."""
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
    if problem.settings.stage == "mech":
        logs = " ".join(shlex.quote(log.source) for log in problem.logs)
        command = f"hydroid fit-hyd {logs} --mech {shlex.quote(run)}"
        steps.append(
            Step("Fit the hydraulics.", "A gain stands for them here. Most of the error is theirs.", command)
        )
    if at := at_limits(problem, fit.uncertainty):
        gain = "The error falls beyond the bound. If such values are impossible, the model lacks something."
        steps.append(
            Step(f"Widen the bounds of {listed(at)} if larger or smaller values are possible.", gain)
        )
    steps += [] if suggested is None else suggested_steps(problem, suggested, run)
    unseen = Step(
        PREDICT_UNSEEN,
        "It shows how large the error is elsewhere, and whether the fitted logs lead to expect it.",
        f"hydroid validate OTHER.csv --fit {shlex.quote(run)}",
    )
    return Section(
        "Do next", steps=tuple([*steps[: MOST_STEPS - 1], unseen, *steps[MOST_STEPS - 1 :]][:MOST_STEPS])
    )
