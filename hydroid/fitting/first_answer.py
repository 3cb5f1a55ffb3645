"""The first answer of a fit: how each joint alone follows its logs, beside simple
models, long before all joints together have been fitted.

It rests on the logs that are fitted, so it is no verdict on what the fit predicts. A
joint that loses to a simple model there has a wrong sign or column, or a model that
lacks what moves it: further minutes hardly mend that.
"""

import math
from collections.abc import Mapping

from hydroid.arrays import Array, rms
from hydroid.fitting.baselines import CLEARLY, Baseline
from hydroid.problem.problem import Problem
from hydroid.units import display


def first_answer(
    problem: Problem, joint: int, theta: Array, models: Mapping[str, Baseline]
) -> str:
    """Return what is said of a joint (number, from 1) that was fitted alone.

    `problem` is its own, with theta, shape (P,). `models` are simple ones, fitted to
    the same logs.
    """
    arm = problem.settings.arm
    way = display(slides=arm.joint(joint).slides).way
    error = problem.rms(problem.output_errors(theta[None]), (joint,))[0]
    simple = {name: rms(model.errors(problem.logs)) for name, model in models.items()}
    beside = ", ".join(
        f"{name} {way(math.degrees(value))}" for name, value in simple.items()
    )
    best = min(simple, key=simple.__getitem__)
    judged = f"about as good as {best}"
    if error < CLEARLY * simple[best]:
        judged = "better than each of them"
    # NaN, of a simulation that diverged, is not smaller
    elif not CLEARLY * error < simple[best]:
        judged = f"worse than {best}"
    return (
        f"{arm.name_of(joint)} alone errs by {way(math.degrees(error))} on the logs "
        f"that are fitted ({beside}): {judged}"
    )
