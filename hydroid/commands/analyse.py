"""`hydroid analyse`: what the logs determine, and what each parameter does to the response."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hydroid.commands.inputs import (
    ConfigSource,
    ModelSource,
    SettingChanges,
    Source,
    load_settings,
    open_model,
)
from hydroid.commands.logs import problem_of
from hydroid.commands.options import command, names
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result, rows, written
from hydroid.estimate import finite
from hydroid.identified_model import start_values

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.parameters import Array
    from hydroid.problem.problem import Problem
    from hydroid.reporting.uncertainty_report import UncertaintyStudy


@command
def analyse(
    logs: "LogSources" = (),
    *,
    fit: "ModelSource | None" = None,
    profile: str | list[str] = "",
    sensitivity: bool = False,
    out: "Source | None" = "runs/analysis",
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[UncertaintyStudy]":
    """Find which parameters, and which combinations of parameters, the logs determine.

    Prints the standard deviation and the 95 % interval of each parameter, and the combinations that the logs
    do not determine.

    Example: hydroid analyse LOG.csv --fit runs/hyd --profile A_A

        study = hydroid.analyse("a.csv", fit="runs/a")
        print(study.result.uncertainty.interval)

    Args:
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the start values of the
            parameters].
        profile (K,D): Parameters to profile. Each point of a profile takes a refinement.
        sensitivity: Add the effect of 1 % of each free parameter on each output over time (article, figure
            10). It is also written as CSV.

    Raises:
        SettingsError: a name that is no free parameter.
        RunError: the simulation diverged, or the folder cannot be written.
    """
    if fit is None:
        model = start_values(load_settings(config or "fit-mech", set))
    else:
        model = open_model(fit, config, set)
    problem = problem_of(model, logs, repair=repair)
    from hydroid.posterior.linear import linearised
    from hydroid.reporting.analysis_report import analysis_page

    with Progress() as progress:
        study = _uncertainty(problem, model.theta, model.source, names(profile), progress)
        effects = linearised(problem, model.theta) if sensitivity else None
    page = analysis_page(study, effects)
    tables = {name: page.tables[name] for name in ("sensitivity",) if name in page.tables}
    known = study.summary.plain()
    for name, parameter in known["estimate"].items():
        interval = study.intervals.get(name)
        parameter["profile_interval"] = interval and [*map(finite, interval)]
    content = {"at": study.source, "rank": study.identifiability.rank}
    content |= {name: known[name] for name in ("findings", "estimate")}
    content |= {n: rows(t, "log", "output", "parameter", "rms_per_percent") for n, t in tables.items()}
    notes = [f"- {finding}" for finding in study.summary.findings]
    lines = [page.tables["parameters"], *tables.values(), *notes, *written(page, out)]
    return Result(lines, content, study, page)


def _uncertainty(
    problem: "Problem", theta: "Array", source: str, profile: Sequence[str], progress: Progress
) -> "UncertaintyStudy":
    """Return what the logs determine at `theta`."""
    from hydroid.posterior import directions, uncertainty
    from hydroid.posterior import profile as profiling
    from hydroid.reporting.uncertainty_report import UncertaintyStudy

    known = uncertainty.uncertainty(problem, theta)
    profiles: list[profiling.Profile] = []
    for done, name in enumerate(profile):
        progress("profiles", done, len(profile))
        profiles.append(profiling.profile(problem, known, name))
    identifiability = directions.identifiability(problem, known)
    return UncertaintyStudy(problem, source, known, identifiability, tuple(profiles))
