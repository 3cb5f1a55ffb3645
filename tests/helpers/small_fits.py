"""Small fits for tests: the article's true values, a watcher, and fits of a simulated log in folders."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from made_logs import TRUTH, at_rest, noisy, simulate_log, stepped

from hydroid import load_settings, read_logs
from hydroid.fitting.fit import Fit, fit
from hydroid.fitting.summary import summarise
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log, write_log
from hydroid.problem.problem import Problem
from hydroid.run.folder import RunFolder
from hydroid.settings.fit import FitSettings


def steps_of(settings: FitSettings, truth: Mapping, levels: Mapping, noise_deg: float = 0.0) -> Log:
    """Steps [%] of some joints that fill four seconds after half a second at rest; an exact first sample."""
    command = np.zeros((450, 7))
    for joint, duties in levels.items():
        command[50:, joint - 1] = np.repeat(duties, 400 // len(duties))
    log = at_rest(settings.arm.pose("study"), command, source="steps")
    return noisy(simulate_log(settings, log, truth), noise_deg)


class Watcher:
    """Keeps the rows; interrupts a fit after so many, or in the refinement after them."""

    def __init__(self, stop_at: int | None = None, simulations: int | None = None) -> None:
        self.rows, self.stop_at, self.simulations = [], stop_at, simulations

    def generation(self, row) -> None:
        self.rows.append(row)
        if len(self.rows) == self.stop_at and self.simulations is None:
            raise KeyboardInterrupt

    def refining(self, name: str, simulated: int, rms: float) -> None:
        if self.simulations is not None and len(self.rows) == self.stop_at and simulated > self.simulations:
            raise KeyboardInterrupt


class Study:
    """The article's stage 1 on five simulated seconds, three segments, and small populations."""

    def __init__(self, folder: Path, **changes) -> None:
        sizes = {"ga": 10, "nsga2": 8}
        small = {f"search.{a}": {"population": n, "generations": 6} for a, n in sizes.items()}
        self.settings = load_settings("article-mech", small | {"objective.segments": 3} | changes)
        self.log = stepped(self.settings, TRUTH, [60.0, -80.0, 30.0, 0.0, -40.0])
        self.path = folder / "log.csv"
        write_log(self.path, self.log, self.settings.log)
        self.problem = Problem(self.settings, [self.log])

    def fit(self) -> Fit:
        return fit(self.problem)

    def fit_in(self, folder: RunFolder, watcher: Watcher) -> Fit:
        checkpoints = folder.begin(self.settings, read_logs([self.path], self.settings))
        result = fit(self.problem, watcher, checkpoints)
        settings, summary = self.settings.of_estimate(result.final), summarise(self.problem, result)
        folder.write_estimate(IdentifiedModel(settings, result.best.theta, "", summary), self.log)
        return result
