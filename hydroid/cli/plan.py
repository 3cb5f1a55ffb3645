"""`hydroid design`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Estimate, Output, names, overrides
from hydroid.cli.output import rows, show
from hydroid.cli.progress import Progress

PRECISION = ("parameter", "estimate", "before_percent", "random_percent", "designed_percent", "gain", "flag")
"""keys of the table of predicted relative standard deviations"""


def design(
    estimate: Estimate,
    output: Output,
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[LOG.csv...]", help="Logs that are there already: their information counts."),
    ] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Length of the experiment.")] = None,
    joints: Annotated[
        str | None, typer.Option(metavar="2,3", help="Joints that may be driven [default: the outputs].")
    ] = None,
    criterion: Annotated[
        str | None, typer.Option(metavar="E|D", help="E: the weakest direction; D: all on average.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same experiment.")] = 1,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for commands.csv, table and figures.")
    ] = Path("runs/design"),
) -> None:
    """Choose the start pose, joints and commands that determine most what is known least.

    The limits (design.speed_deg_s, design.margin_deg, design.command_pct) are checked on the simulated response
    only. The machine moves otherwise as far as it differs from the model, and collisions are not looked for: watch
    the first run with a hand on the stop. The config defines the outputs, the free parameters and the limits.
    """
    from hydroid.api.look import read_logs
    from hydroid.api.plan import design
    from hydroid.identified import load_identified

    driven = None if joints is None else [int(n) if n.isdigit() else n for n in names(joints)]
    flags = {"design.duration_s": duration, "design.criterion": criterion, "design.joints": driven}
    model = load_identified(estimate.fit, estimate.config, overrides(estimate.setting, **flags))
    with Progress(quiet=output.silent) as progress:
        study = design(model, read_logs(logs or [], model.settings), out, seed=seed, progress=progress)
    found = rows(study.table, *PRECISION)
    commands = str(out / "commands.csv")
    show(output, lambda: {"commands": commands, "precision": found}, [study.table, commands])
