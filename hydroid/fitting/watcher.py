"""What a fit tells of its progress, and asks whether its time is up."""

from typing import Protocol

from hydroid.arrays import Array
from hydroid.fitting.step import Step


class Watcher(Protocol):
    """Takes the progress of a fit, and says when its time is up."""

    def generation(self, row: Array) -> bool | None:
        """Take a row of HISTORY; return whether the search is to end."""

    def refining(self, step: Step, simulated: int, rms: float) -> bool | None:
        """Take a step, its number of simulations, and its rms error [rad]; return
        whether it is to end."""


class Silent(Watcher):
    """Shows nothing, and never ends a fit."""
