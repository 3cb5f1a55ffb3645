"""How fast least squares may follow an error: the real excavator fitted with several
memories.

Each begins at the estimate of `make excavator`, refined by output errors (a memory
without end). Rms errors [deg] of the logs that are not fitted, by joint: of the change
over 1, 5 and 10 s, and over whole logs. The shortest memory is as good as maximum
likelihood here: the errors of this model last, so that their own model follows them
from sample to sample.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from common import EXAMPLES, Clock, options, table

import hydroid
from hydroid.arrays import Array
from hydroid.commands.logs import read_logs
from hydroid.fitting.refinement import refine
from hydroid.fitting.step import Step
from hydroid.posterior.error_model import Likelihood, make_likelihood
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load
from hydroid.settings.search import RefinementSettings

FOLDER = EXAMPLES / "excavator"
REFINEMENT = RefinementSettings(iterations=40, gain_tolerance=1e-3)


def problem_of(settings: FitSettings, logs: str) -> Problem:
    """Return the problem of the excavator's logs of these names."""
    files = [str(file) for file in sorted(FOLDER.glob(logs))]
    return Problem(settings, read_logs(files, settings))


def refined(likelihood: Likelihood, theta: Array) -> Array:
    """Return where least squares ends, from an estimate, (P,)."""
    end = refine(likelihood, theta, REFINEMENT, lambda *_: None, {}, Step("memory"))
    return likelihood.problem.parameters.from_unit(end.point)


def unseen(problem: Problem, theta: Array) -> Iterator[list[float]]:
    """Yield rms errors [deg] by joint, after 1, 5 and 10 s, and over whole logs."""
    errors = problem.output_errors(theta[None])[0]
    for seconds in (1.0, 5.0, 10.0, None):
        squares: dict[int, list[Array]] = {}
        for channel in problem.channels:
            error = np.degrees(errors[channel.rows] / channel.weight)
            if seconds is not None:
                ahead = round(seconds / problem.logs[channel.log].period)
                error = error[ahead:] - error[:-ahead]
            squares.setdefault(channel.joint, []).append(error**2)
        yield [
            float(np.sqrt(np.mean(np.concatenate(each)))) for each in squares.values()
        ]


def main() -> None:
    """Fit and show."""
    given = options(
        __doc__, fit="runs/excavator/fit", memories=[0.05, 1.0, 2.5, 5.0, 10.0]
    )
    settings = load(FOLDER / "fit.yaml", FitSettings, {})
    problem = problem_of(settings, "fit_*.csv")
    judged = problem_of(settings, "check_*.csv")
    likelihood = make_likelihood(problem)
    fit = hydroid.load_identified(given.fit)
    start = problem.parameters.vector(fit.values, fit.source)
    white = refined(replace(likelihood, memory=np.inf), start)
    names = [settings.arm.joint_names[joint - 1] for joint in settings.outputs]
    header = "memory [s] | over | " + " | ".join(names) + " | CPU [s]"
    rows = list[tuple[str, ...]]()
    for memory in (np.inf, *given.memories):
        clock = Clock()
        theta = (
            white
            if np.isinf(memory)
            else refined(replace(likelihood, memory=memory), white)
        )
        cpu = f"{clock.seconds[1]:.0f}"
        for over, values in zip(
            ("1 s", "5 s", "10 s", "whole logs"), unseen(judged, theta), strict=True
        ):
            rows.append(
                (f"{memory:g}", over, *(f"{value:.2f}" for value in values), cpu)
            )
    table(header, " | ".join(["{}"] * len(rows[0])), *zip(*rows, strict=True))


if __name__ == "__main__":
    main()
