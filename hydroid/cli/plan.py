"""`hydroid suggest` and `design`."""

from pathlib import Path
from typing import Annotated

import typer

from hydroid.cli.options import Estimate, Folder, Output, Repair, names, overrides
from hydroid.cli.output import rows, show
from hydroid.cli.progress import Progress

PRECISION = ("parameter", "estimate", "before_percent", "random_percent", "designed_percent", "gain", "flag")
"""keys of the table of predicted relative standard deviations"""


def suggest(
    estimate: Estimate,
    output: Output,
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG.csv...", help="Logs [default: those of the run]."),
    ] = None,
    out: Folder = Path("runs/suggestions"),
    repair: Repair = False,
) -> None:
    """Find what the model lacks, and what to do next.

    Tests every parameter that is kept fixed or switched off, such as a delay or dry friction: would freeing
    it lower the error? Shows what the residual depends on. Predicts for several actions, from weighing a link
    to a new experiment, how much each would reduce the uncertainty.
    """
    from hydroid.api.plan import suggest
    from hydroid.identified_model import load_identified

    model = load_identified(estimate.fit, estimate.config, overrides(estimate.setting))
    with Progress(quiet=output.silent) as progress:
        study = suggest(model, logs or (), out, repair=repair, progress=progress)
    lines = [study.page.tables["missing_terms"]]
    for section in study.page.sections:
        points = [point for point in (*section.points, *(tab.note for tab in section.tabs)) if point]
        if section.text or points:
            lines += [section.title, *([section.text] if section.text else []), *(f"- {p}" for p in points)]
    show(output, lambda: dict(study.result.content), [*lines, str(out / "suggestions.html")])


def design(
    estimate: Estimate,
    output: Output,
    logs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="LOG.csv...", help="Logs that exist already. The design adds to what they determine."
        ),
    ] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Length of the experiment [s].")] = None,
    joints: Annotated[
        str | None, typer.Option(metavar="2,3", help="Joints to drive [default: the compared joints].")
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option(
            metavar="E|D",
            help="What the experiment minimises. E: the uncertainty of the worst-known combination of "
            "parameters. D: the volume of the uncertainty of all of them together.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search for commands.")] = 1,
    out: Folder = Path("runs/design"),
    repair: Repair = False,
) -> None:
    """Design the next experiment: start pose and commands that best reduce the uncertainty of the estimate.

    SAFETY: Keep a hand on the emergency stop during the first run. The limits (design.speed_deg_s,
    design.margin_deg, design.clearance_m) are checked only in simulation with the present estimate; the
    real arm may exceed them. Collisions are checked with the shapes of the model, which knows no hoses and
    nothing that stands around the machine.

    Writes commands.csv (the experiment) and predicted.csv (the simulated motion, no measurement). The
    settings define the compared joints, the free parameters and the limits.
    """
    from hydroid.api.look import read_logs
    from hydroid.api.plan import design
    from hydroid.identified_model import load_identified

    driven = None if joints is None else [int(n) if n.isdigit() else n for n in names(joints)]
    flags = {"design.duration_s": duration, "design.criterion": criterion, "design.joints": driven}
    model = load_identified(estimate.fit, estimate.config, overrides(estimate.setting, **flags))
    with Progress(quiet=output.silent) as progress:
        existing = read_logs(logs or [], model.settings, repair=repair)
        study = design(model, existing, out, seed=seed, progress=progress)
    found = rows(study.table, *PRECISION)
    commands = str(out / "commands.csv")
    show(output, lambda: {"commands": commands, "precision": found}, [study.table, commands])
