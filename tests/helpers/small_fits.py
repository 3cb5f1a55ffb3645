"""Small problems for tests of fits: the article's true values, and a watcher."""

from collections.abc import Mapping

import numpy as np
from made_logs import TRUTH, at_rest, noisy, simulate_log, stepped

from hydroid import load_settings
from hydroid.fitting.step import Step
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings


def steps_of(
    settings: FitSettings, truth: Mapping, levels: Mapping, noise_deg: float = 0.0
) -> Log:
    """Steps [%] of some joints that fill four seconds after half a second at rest; an
    exact first sample."""
    command = np.zeros((450, 7))
    for joint, duties in levels.items():
        command[50:, joint - 1] = np.repeat(duties, 400 // len(duties))
    log = at_rest(settings.arm.pose("study"), command, source="steps")
    return noisy(simulate_log(settings, log, truth), noise_deg)


class Watcher:
    """Keeps the rows; interrupts a fit after so many, or in the refinement after
    them."""

    def __init__(
        self, stop_at: int | None = None, simulations: int | None = None
    ) -> None:
        self.rows, self.stop_at, self.simulations = [], stop_at, simulations

    def generation(self, row) -> None:
        self.rows.append(row)
        if len(self.rows) == self.stop_at and self.simulations is None:
            raise KeyboardInterrupt

    def refining(self, step: Step, simulated: int, rms: float) -> None:
        if (
            self.simulations is not None
            and len(self.rows) == self.stop_at
            and simulated > self.simulations
        ):
            raise KeyboardInterrupt


def study(**changes) -> Problem:
    """The article's stage 1 on five simulated seconds, three segments, and small
    populations."""
    sizes = {"ga": 10, "nsga2": 8}
    small = {
        f"search.{a}": {"population": n, "generations": 6} for a, n in sizes.items()
    }
    settings = load_settings(
        "article-mech", small | {"objective.segments": 3} | changes
    )
    return Problem(
        settings, [stepped(settings, TRUTH, [60.0, -80.0, 30.0, 0.0, -40.0])]
    )
