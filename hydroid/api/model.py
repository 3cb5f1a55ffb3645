"""Use a model: `simulate` commands."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from hydroid.api.look import ModelSource, open_model, read_commands
from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.log import Log, write_log


def simulate(
    model: ModelSource,
    commands: str | Path | Log,
    out: str | Path | None = None,
    *,
    noise_deg: float = 0.0,
    seed: int = 0,
    trace: str | Path | None = None,
) -> Log:
    """Simulate commands: a prediction, or data to test a fit with.

        log = hydroid.simulate("runs/a", "commands.csv", "predicted.csv")

    Args:
        model: a run folder, a YAML file of values or an identified model.
        commands: a CSV of commands, whose first angles are the start pose; or a log (see `read_commands`).
        out: the log to write; None: none.
        noise_deg: standard deviation of Gaussian noise on every angle [deg].
        seed: of the noise.
        trace: a CSV to write with pressures, flows, spool and force of every driven actuator (stage 2).

    Returns:
        The log with the simulated angles, noise included.

    Raises:
        SettingsError: a trace of stage 1, or `out` would overwrite the commands.
        LogError: the commands cannot be used.
        RunError: the simulation diverged, or a file cannot be written.
    """
    model = open_model(model)
    if trace is not None and model.settings.stage != "hyd":
        raise SettingsError("stage mech has no pressures to trace", where=model.source, hint="set stage: hyd")
    if not isinstance(commands, Log):
        if out is not None and Path(out).resolve() == Path(commands).resolve():
            raise SettingsError("would overwrite the commands", where=str(out), hint="name another file")
        commands = read_commands(commands, model.settings)
    from hydroid.prediction import predict_log, trace_csv

    result = predict_log(model, commands)
    noise = np.random.default_rng(seed).normal(0.0, np.deg2rad(noise_deg), result.angle.shape)
    result = replace(result, angle=result.angle + noise)
    if out is not None:
        write_log(Path(out), result, model.settings.log)
    if trace is not None:
        write_atomic(Path(trace), trace_csv(model, commands))
    return result
