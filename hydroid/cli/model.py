"""`hydroid simulate`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Arm, Estimate, Output, Repair, overrides
from hydroid.cli.output import show


def simulate(
    commands: Annotated[
        Path,
        typer.Argument(
            metavar="COMMANDS.csv",
            help="CSV file of commands. Its angles before the first command give the start pose.",
        ),
    ],
    estimate: Estimate,
    output: Output,
    out: Annotated[
        Path | None,
        typer.Option(metavar="LOG.csv", help="The log to write [default: runs/COMMANDS-simulated.csv]."),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(help="Name of the start pose in the arm's file [default: the first angles of the log]."),
    ] = None,
    noise_deg: Annotated[
        float, typer.Option(min=0, max=90, help="Standard deviation of Gaussian noise on the angles [deg].")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    trace: Annotated[
        Path | None,
        typer.Option(metavar="CSV", help="Also write pressures, flows, spool position and force (stage 2)."),
    ] = None,
    arm: Arm = None,
    repair: Repair = False,
) -> None:
    """Simulate commands with an estimate and write the log: a prediction, or synthetic data to test a fit."""
    from hydroid.api.arms import read_arms, simulate_arms
    from hydroid.api.model import simulate
    from hydroid.errors import SettingsError
    from hydroid.identified_model import load_identified

    target = out or Path("runs") / f"{commands.stem}-simulated.csv"
    if target.resolve() == commands.resolve():
        raise SettingsError("would overwrite the commands", where=f"--out {target}", hint="name another file")
    model = load_identified(estimate.fit, estimate.config, overrides(estimate.setting))
    logs = read_arms(commands, model.settings, arm, pose=pose, repair=repair)
    if arm is None:
        (start,) = logs.values()
        log = simulate(model, start, target, noise_deg=noise_deg, seed=seed, trace=trace)
    elif trace is not None:
        raise SettingsError("is of one arm that stands alone", where="--trace", hint="leave --arm out")
    else:
        (log, *_) = simulate_arms(model, logs, target, noise_deg=noise_deg, seed=seed).values()
    content = {"out": str(target), "samples": len(log.time), "duration_s": float(log.duration)}
    show(output, lambda: content | {"trace": trace and str(trace)}, [str(target)])
