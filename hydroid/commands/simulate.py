"""`hydroid simulate`: the log that a model predicts."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.commands.console import Result
from hydroid.commands.inputs import (
    ConfigSource,
    ModelSource,
    SettingChanges,
    Source,
    open_model,
    refuse_overwriting,
)
from hydroid.commands.logs import read_arms
from hydroid.commands.options import command

if TYPE_CHECKING:
    from hydroid.log import Log


@dataclass(frozen=True, eq=False, repr=False)
class Simulated(Result["dict[str, Log]"]):
    """Simulated logs by the arm's name: right, left, or alone."""

    @property
    def log(self) -> "Log":
        """The log of the first arm."""
        return next(iter(self.result.values()))


@command
def simulate(
    commands: "Source | Log",
    *,
    fit: "ModelSource",
    out: "Source | None" = None,
    pose: str | None = None,
    noise_deg: float = 0.0,
    seed: int = 0,
    arm: str | None = None,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Simulated:
    """Simulate commands with an estimate and write the log: a prediction, or synthetic data to test a fit.

    Of two arms neither feels the other: the carrier stands still, and they share no pump.

    Example: hydroid simulate COMMANDS.csv --fit runs/hyd --out sim.csv

        log = hydroid.simulate("commands.csv", fit="runs/a", out="predicted.csv").log

    Args:
        commands (COMMANDS.csv): A log of commands. Its angles before the first command give the start pose.
        out (LOG.csv): The log to write [default of the command line: runs/simulated.csv].
        noise_deg (0 to 90): Standard deviation of Gaussian noise on the angles [deg].

    Raises:
        SettingsError: `out` would overwrite the commands.
        LogError: the commands cannot be used.
        RunError: the simulation diverged, or a file cannot be written.
    """
    target = None if out is None else Path(out)
    refuse_overwriting(commands, target)
    model = open_model(fit, config, set)
    read = read_arms(commands, model.settings, arm, pose=pose, repair=repair)
    from hydroid.log import write_logs
    from hydroid.prediction import predict_log

    logs: dict[str, Log] = {}
    for number, (name, log) in enumerate(read.items()):
        predicted = predict_log(model, log)
        noise = np.random.default_rng(seed + number).normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
        logs[name] = replace(predicted, angle=predicted.angle + noise)
    columns = model.settings.log
    if target:
        write_logs(target, [(log, columns.of_arm(n) if arm else columns) for n, log in logs.items()])
    first, file = next(iter(logs.values())), target and str(target)
    content = {"out": file, "samples": len(first.time), "duration_s": float(first.duration)}
    return Simulated([file] if file else [], content, logs)
