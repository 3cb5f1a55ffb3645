"""`hydroid simulate`: the log that a model predicts."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

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
from hydroid.commands.result import Result
from hydroid.errors import SettingsError
from hydroid.files import write_atomic

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
    out: "Source | None" = Path("runs/simulated.csv"),
    pose: str | None = None,
    noise_deg: float = 0.0,
    seed: int = 0,
    trace: "Source | None" = None,
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
        out (LOG.csv): The log to write.
        noise_deg (0 to 90): Standard deviation of Gaussian noise on the angles [deg].
        trace (CSV): Also write pressures, flows, spool position and force (stage 2).

    Raises:
        SettingsError: a trace of stage 1 or of two arms, or `out` would overwrite the commands.
        LogError: the commands cannot be used.
        RunError: the simulation diverged, or a file cannot be written.
    """
    target, traced = (None if given is None else Path(given) for given in (out, trace))
    refuse_overwriting(commands, target)
    model = open_model(fit, config, set)
    if traced and model.settings.stage != "hyd":
        raise SettingsError("stage mech has no pressures to trace", where=model.source, hint="set stage: hyd")
    if traced and arm is not None:
        raise SettingsError("is of one arm that stands alone", where="--trace", hint="leave --arm out")
    read = read_arms(commands, model.settings, arm, pose=pose, repair=repair)
    from hydroid.log import write_logs
    from hydroid.prediction import predict_log, trace_csv

    logs: dict[str, Log] = {}
    for number, (name, log) in enumerate(read.items()):
        predicted = predict_log(model, log)
        noise = np.random.default_rng(seed + number).normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
        logs[name] = replace(predicted, angle=predicted.angle + noise)
    columns = model.settings.log
    if target:
        write_logs(target, [(log, columns.of_arm(n) if arm else columns) for n, log in logs.items()])
    if traced:
        write_atomic(traced, trace_csv(model, *read.values()))
    files = {name: file and str(file) for name, file in {"out": target, "trace": traced}.items()}
    first = next(iter(logs.values()))
    content = files | {"samples": len(first.time), "duration_s": float(first.duration)}
    return Simulated([file for file in files.values() if file], content, logs)
