"""The error model that a fit has stored, on logs: that of `estimate.yaml`, without the
fit."""

from collections.abc import Mapping
from dataclasses import replace

from hydroid.estimate import AngleError
from hydroid.posterior.error_model import ErrorModel, make_error_model
from hydroid.problem.problem import Problem


def stored_error_model(
    problem: Problem, stored: Mapping[str, AngleError]
) -> ErrorModel:
    """Return the error model of a problem's logs with the numbers stored of each angle,
    such as `q2`.

    Pressures keep those of a model that is still to be estimated.
    """
    errors = make_error_model(problem)
    numbers = errors.numbers.copy()
    for i, signal in enumerate(errors.signals):
        if signal.quantity == "angle":
            numbers[i] = stored[f"q{signal.joint}"].numbers
    return replace(errors, numbers=numbers)
