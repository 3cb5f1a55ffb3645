"""`hydroid fit-hyd`: stage 2."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hydroid.commands.inputs import as_list
from hydroid.commands.options import Config, Dask, DaskInsecure, Repair, Set, command
from hydroid.commands.runs import (
    NAMED,
    Algorithm,
    FitLogs,
    FitRuns,
    Resume,
    RunFolder,
    Runs,
    SearchSeed,
    Start,
    Threads,
    WithRefinement,
    fit_runs,
    given_inputs,
    refuse_other_stage,
    search_changes,
    stored_inputs,
)
from hydroid.commands.stage_one import with_mechanics

if TYPE_CHECKING:
    from hydroid.commands.inputs import Source


@command
def fit_hyd(
    logs: FitLogs = (),
    *,
    mech: Annotated[
        "Source | None",
        typer.Option(
            metavar="RUN|YAML",
            help="Stage 1: its run folder, or a YAML file of its values. The run folder also gives the arm "
            "and the log layout, unless --config sets them.",
        ),
        Path | None,
    ] = None,
    both_stages: Annotated[
        bool | None, typer.Option(help="At the end, refine the parameters of both stages together.")
    ] = None,
    out: RunFolder = NAMED,
    algorithm: Algorithm = None,
    seed: SearchSeed = None,
    runs: Runs = 1,
    start: Start = None,
    resume: Resume = False,
    refinement: WithRefinement = None,
    threads: Threads = None,
    dask: Dask = None,
    dask_insecure: DaskInsecure = False,
    config: Config = "fit-hyd",
    set: Set = None,
    repair: Repair = False,
) -> FitRuns:
    """Estimate the hydraulic actuators (stage 2); the arm's parameters come from stage 1.

    By default it estimates piston areas, valve openings, onsets, delay and damping. The config can free more,
    such as the amplifier's currents and the solenoid. Writes a run folder as fit-mech does.

    Example: hydroid fit-hyd LOG.csv --mech runs/mech --out runs/hyd

        fitted = hydroid.fit_hyd("a.csv", mech="runs/mech", out="runs/hyd")
        print(fitted.best.summary.values)

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    changes = search_changes(set, algorithm, seed, threads, refinement)
    changes |= {} if both_stages is None else {"joint_refinement": both_stages}
    if logs:
        refuse_other_stage(config, changes, "hyd")
        names = [Path(getattr(log, "source", log)).name for log in as_list(logs)]
        changes = with_mechanics(mech, config, changes, names)
        inputs = given_inputs(logs, config, changes, out, start, repair)
    else:
        inputs = stored_inputs("hyd", changes, out, resume=resume and runs == 1)
    return fit_runs(inputs, runs, resume=resume, dask=dask, dask_insecure=dask_insecure)
