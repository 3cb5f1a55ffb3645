"""Stage 2 with known mechanics, and logs that are commands alone."""

from collections.abc import Mapping, Sequence

import numpy as np

import hydroid
from hydroid.log import Log
from hydroid.settings.fit import FitSettings


def duties(pose: np.ndarray, levels: Mapping[int, Sequence[float]], dwell: float = 1.0) -> Log:
    """A log without motion: commands [%] from its first sample, each held `dwell` [s], by joint (from 1)."""
    period = 0.01
    length = round(dwell * max(map(len, levels.values())) / period) + 1
    command = np.zeros((length, len(pose)))
    for joint, values in levels.items():
        held = np.repeat(values, round(dwell / period))
        command[: len(held), joint - 1] = held
    time = np.arange(length) * period
    return Log("duties", time, command, np.tile(pose, (length, 1)), period)


def settings_of(parameters: Mapping[str, Mapping[str, object]], **hydraulics: float | None) -> FitSettings:
    """Stage 2 with known mechanics and the given parameters; other settings of the chain by name."""
    known = {
        "D": {"quantity": "damping", "fixed": 231.8},
        "S": {"quantity": "stiffness", "fixed": 53.4},
    }
    changes: dict[str, object] = {f"hydraulics.{name}": value for name, value in hydraulics.items()}
    changes |= {"parameters": known | dict(parameters), "hydraulics.substeps": 5, "simulation.threads": 1}
    return hydroid.load_settings("article-hyd", changes)
