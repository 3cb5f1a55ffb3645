"""`hydroid fit-mech`: stage 1."""

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


@command
def fit_mech(
    logs: FitLogs = (),
    *,
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
    config: Config = "fit-mech",
    set: Set = None,
    repair: Repair = False,
) -> FitRuns:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder with report.html, estimate.yaml, tables, figures and the fitted arm. Then test the
    estimate on a log that it was not fitted to: `hydroid validate`.

    Example: hydroid fit-mech LOG.csv --out runs/mech

        fitted = hydroid.fit_mech("a.csv", out="runs/mech", algorithm="ga")
        print(fitted.best.summary.values)

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    changes = search_changes(set, algorithm, seed, threads, refinement)
    if logs:
        refuse_other_stage(config, changes, "mech")
        inputs = given_inputs(logs, config, changes, out, start, repair)
    else:
        inputs = stored_inputs("mech", changes, out, resume=resume and runs == 1)
    return fit_runs(inputs, runs, resume=resume, dask=dask, dask_insecure=dask_insecure)
