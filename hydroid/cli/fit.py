"""`hydroid fit-mech`, `fit-hyd` and `collect`."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import Config, DaskInsecure, Folder, Output, Repair, Set, overrides
from hydroid.cli.output import rows, show

if TYPE_CHECKING:
    from hydroid.api.stages import FitOptions, FitRuns

SPREAD = ("name", "unit", "median", "lowest", "lower_quartile", "upper_quartile", "highest", "flag")
"""keys of the table of several runs"""
_PYMOO = "pymoo:"

FitLogs = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="LOG.csv...", help="Logs to fit together [default with --resume: the logs of the run]."
    ),
]


def _renamed(value: str | None) -> None:
    if value is not None:
        raise typer.BadParameter(f"is now --dask local:{value}")


@dataclass(kw_only=True)
class FitFlags:
    """The options of a fit."""

    algorithm: Annotated[
        str | None,
        typer.Option(
            help="Search: ga, nsga2, cmaes, multistart, or one of the library pymoo, such as pymoo:NSGA3."
        ),
    ] = None
    seed: Annotated[
        int | None, typer.Option(help="Seed of the search. The same seed gives exactly the same result.")
    ] = None
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, help="Number of runs, with the seeds SEED, SEED + 1, ...")
    ] = 1
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Run folder [default: runs/LOG-STAGE-ALGORITHM].")
    ] = None
    start: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="RUN|YAML",
            help="Start the search from the values of an estimate: a run folder or a YAML file of values.",
        ),
    ] = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the stopped run in --out; start it if there is none.")
    ] = False
    refinement: Annotated[
        bool | None,
        typer.Option(
            "--refinement/--no-refinement", help="After the search, refine its estimate by least squares."
        ),
    ] = None
    threads: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=1024,
            help="Number of threads (0: one per core, or with --dask one per worker).",
        ),
    ] = None
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="local[:N]|slurm|ADDRESS",
            help="Simulate in N processes of this machine, in Slurm jobs (see the setting cluster), or on "
            "the workers of the Dask scheduler at ADDRESS. The result is the same.",
        ),
    ] = None
    dask_insecure: DaskInsecure = False
    workers: Annotated[str | None, typer.Option("--workers", hidden=True, callback=_renamed)] = None
    setting: Set = None
    repair: Repair = False

    def changes(self) -> dict[str, Any]:
        """Return the settings that the options replace."""
        pymoo = self.algorithm is not None and self.algorithm.startswith(_PYMOO)
        flags = {
            "search.algorithm": "pymoo" if pymoo else self.algorithm,
            "search.pymoo.algorithm": self.algorithm.removeprefix(_PYMOO)
            if self.algorithm and pymoo
            else None,
            "search.seed": self.seed,
            "simulation.threads": self.threads,
        }
        return overrides(self.setting, **flags) | ({"refinement": None} if self.refinement is False else {})

    def options(self, output: Output) -> "FitOptions":
        """Return what else the options ask for."""
        from hydroid.api.stages import FitOptions
        from hydroid.cli.progress import FitProgress

        return FitOptions(
            runs=self.runs,
            resume=self.resume,
            repair=self.repair,
            start=self.start,
            dask=self.dask,
            dask_insecure=self.dask_insecure,
            progress=partial(FitProgress, quiet=output.silent),
        )


def fit_mech(flags: FitFlags, output: Output, logs: FitLogs = None, config: Config = "fit-mech") -> None:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder with report.html, estimate.yaml, tables, figures and the fitted arm. Then test the
    estimate on a log that it was not fitted to: `hydroid validate`.
    """
    from hydroid.api.stages import fit_mech

    changes, how = flags.changes(), flags.options(output)
    _show(fit_mech(logs or [], flags.out, config=config, overrides=changes, options=how), output)


def fit_hyd(
    flags: FitFlags,
    output: Output,
    logs: FitLogs = None,
    mech: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN|YAML",
            help="Stage 1: its run folder, or a YAML file of its values. The run folder also gives the arm "
            "and the log layout, unless --config sets them.",
        ),
    ] = None,
    config: Config = "fit-hyd",
    joint: Annotated[
        bool | None,
        typer.Option(
            "--joint/--no-joint",
            help="At the end, refine the parameters of both stages together. ('Joint' means 'together' here, "
            "not a joint of the robot.)",
        ),
    ] = None,
) -> None:
    """Estimate the hydraulic actuators (stage 2); the arm's parameters come from stage 1.

    By default it estimates piston areas, valve openings, onsets, delay and damping. The config can free more,
    such as the amplifier's currents and the solenoid. Writes a run folder as fit-mech does.
    """
    from hydroid.api.stages import fit_hyd

    changes = flags.changes() | ({} if joint is None else {"joint_refinement": joint})
    how = flags.options(output)
    _show(fit_hyd(logs or [], flags.out, mech=mech, config=config, overrides=changes, options=how), output)


def collect(
    runs: Annotated[
        list[str], typer.Argument(metavar="RUN...", help="Run folders, or a pattern such as 'runs/seed-*'.")
    ],
    output: Output,
    out: Folder = Path("runs/collected"),
) -> None:
    """Merge runs of the same fit with different seeds: median and spread of their estimates.

    Unfinished runs and damaged runs are left out, with a warning.
    """
    from hydroid.api.stages import collect
    from hydroid.report.spread import final_spread

    study = collect(runs, out)
    best, table = study.result.best, final_spread(study.page)

    def content() -> dict[str, Any]:
        found = {str(run.path): {"seed": run.seed, "rms_deg": run.rms_deg} for run in study.result.runs}
        return {"out": str(out), "best": str(best.path), "runs": found, "parameters": rows(table, *SPREAD)}

    line = f"smallest error: {best.path} (seed {best.seed}, rms {best.rms_deg:.4g} deg)"
    show(output, content, [table, line, str(out / f"{study.page.name}.html")])


def _show(runs: "FitRuns", output: Output) -> None:
    from hydroid.report.fit_report import fit_lines
    from hydroid.report.parameters_report import parameter_table
    from hydroid.report.spread import final_spread

    first = runs.results[0]
    if runs.spread is not None:
        lines = [final_spread(runs.spread), str(runs.out / f"{runs.spread.name}.html")]
        found = [r.summary.plain() | {"out": str(r.folder)} for r in runs.results]
        show(output, lambda: {"out": str(runs.out), "runs": found}, lines)
        return
    table = parameter_table(first.model.settings, first.summary)
    content = partial(dict[str, Any], first.summary.plain(), out=str(runs.out))
    show(output, content, [table, *fit_lines(first.summary), str(runs.out / "report.html")])
