"""Logs of which the truth is known, for tests and benchmarks: commands, what a model makes of them, noise."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hydroid.identified_model import identified
from hydroid.log import Log
from hydroid.prediction import predict_log
from hydroid.settings.fit import FitSettings

Levels = Sequence[float] | np.ndarray | Mapping[int, Sequence[float]]


def at_rest(pose: np.ndarray, command: np.ndarray, period: float = 0.01, source: str = "commands") -> Log:
    """Commands [%], shape (T, J), to an arm whose angles are the start pose [rad] throughout."""
    time = np.arange(len(command), dtype=float) * period
    return Log(source, time, command, np.tile(pose, (len(time), 1)), period)


def step_log(pose: np.ndarray, levels: Levels, dwell: float = 1.0) -> Log:
    """Commands [%], each held for `dwell` [s]: those of joint 2, or by joint (from 1)."""
    by_joint = levels if isinstance(levels, Mapping) else {2: levels}
    held = {joint: np.repeat(own, round(dwell / 0.01)) for joint, own in by_joint.items()}
    command = np.zeros((max(map(len, held.values())), len(pose)))
    for joint, own in held.items():
        command[: len(own), joint - 1] = own
    return at_rest(pose, command, source="steps")


def simulate_log(settings: FitSettings, log: Log, truth: Mapping[str, float]) -> Log:
    """The log with the angles, and pressures, of the parameters by name."""
    return predict_log(identified(settings, truth, "truth"), log)


def stepped(settings: FitSettings, truth: Mapping[str, float], levels: Levels, dwell: float = 1.0) -> Log:
    """What the arm of the parameters by name does from its study pose."""
    return simulate_log(settings, step_log(settings.arm.pose("study"), levels, dwell), truth)


def noisy(log: Log, level_deg=0.1, seed: Any = 0, *, phi=0.0, exact_start=True) -> Log:
    """The log with noise on all angles, white or AR(1), but for its first sample; by seed or generator."""
    noise = np.random.default_rng(seed).normal(0.0, np.deg2rad(level_deg), log.angle.shape)
    if phi:
        for i in range(1, len(noise)):
            noise[i] = phi * noise[i - 1] + np.sqrt(1 - phi**2) * noise[i]
    if exact_start:
        noise[0] = 0.0
    return replace(log, angle=log.angle + noise)
