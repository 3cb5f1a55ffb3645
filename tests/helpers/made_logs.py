"""Logs of which the truth is known, for tests and benchmarks: commands, what a model
makes of them, noise."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hydroid import load_settings
from hydroid.identified_model import identified
from hydroid.log import Log
from hydroid.prediction import predict_log
from hydroid.settings.fit import FitSettings

TRUTH = {
    "K": 0.2,
    "D": 231.8,
    "S": 53.4,
    "M1": 4.6,
    "M2": 5.1,
    "M3": 22.5,
    "M4": 1.6,
    "M5": 4.0,
    "M6": 4.7,
}
"""the article's values of stage 1"""
COILS = {"F1": 8.0, "F2": 0.7, "x1": 0.8, "x2": 12.0}
HYDRAULIC = {
    "A_A": 1000.0,
    "A_B": 750.0,
    "I_max": 0.9,
    "I_min": 0.3,
    "A": 1.4,
    "C": 1.2,
} | COILS
"""and of stage 2"""
FAST = TRUTH | {"K": 1.0, "D": 60.0, "S": 100.0}
"""masses as in the article; K, D, S are ours: with the article's the arm is too slow to
feel its masses"""
Levels = Sequence[float] | np.ndarray | Mapping[int, Sequence[float]]


def fast_arm(outputs: list[int], *free: str, **changes: object) -> FitSettings:
    """Stage 1 of an arm with the values of `FAST`, of which only some are free; other
    joints are locked."""
    how: dict[str, object] = {
        "outputs": outputs,
        "simulation.other_joints": "locked",
    } | changes
    how |= {
        f"parameters.{name}.bounds": [0.2 * FAST[name], 5 * FAST[name]]
        for name in ("K", "D", "S")
    }
    how |= {
        f"parameters.{name}.fixed": value
        for name, value in FAST.items()
        if name not in free
    }
    return load_settings("article-mech", how)


def at_rest(
    pose: np.ndarray,
    command: np.ndarray,
    period: float = 0.01,
    source: str = "commands",
) -> Log:
    """Commands [%], shape (T, J), to an arm whose angles are the start pose [rad]
    throughout."""
    time = np.arange(len(command), dtype=float) * period
    return Log(source, time, command, np.tile(pose, (len(time), 1)), period)


def step_log(pose: np.ndarray, levels: Levels, dwell: float = 1.0) -> Log:
    """Commands [%], each held for `dwell` [s]: those of joint 2, or by joint (from
    1)."""
    by_joint = levels if isinstance(levels, Mapping) else {2: levels}
    held = {
        joint: np.repeat(own, round(dwell / 0.01)) for joint, own in by_joint.items()
    }
    command = np.zeros((max(map(len, held.values())), len(pose)))
    for joint, own in held.items():
        command[: len(own), joint - 1] = own
    return at_rest(pose, command, source="steps")


def simulate_log(settings: FitSettings, log: Log, truth: Mapping[str, float]) -> Log:
    """The log with the angles, and pressures, of the parameters by name."""
    return predict_log(identified(settings, truth, "truth"), log)


def stepped(
    settings: FitSettings,
    truth: Mapping[str, float],
    levels: Levels,
    dwell: float = 1.0,
) -> Log:
    return simulate_log(
        settings, step_log(settings.arm.pose("study"), levels, dwell), truth
    )


def noisy(log: Log, level_deg=0.1, seed: Any = 0, *, phi=0.0, exact_start=True) -> Log:
    """The log with noise on all angles, white or AR(1), but for its first sample; by
    seed or generator."""
    noise = np.random.default_rng(seed).normal(
        0.0, np.deg2rad(level_deg), log.angle.shape
    )
    if phi:
        for i in range(1, len(noise)):
            noise[i] = phi * noise[i - 1] + np.sqrt(1 - phi**2) * noise[i]
    if exact_start:
        noise[0] = 0.0
    return replace(log, angle=log.angle + noise)
