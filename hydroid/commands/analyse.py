"""`hydroid analyse`: what the logs determine, and what each parameter does to the response."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
from hydroid.commands.result import Result, written
from hydroid.estimate import finite
from hydroid.findings import Finding
from hydroid.identified_model import start_values

if TYPE_CHECKING:
    from hydroid.commands.logs import LogSources
    from hydroid.posterior.profile import Profile
    from hydroid.posterior.uncertainty import Identifiability, Uncertainty


@dataclass(frozen=True, eq=False)
class Analysis:
    """What logs determine at an estimate: intervals, directions, and the profiles that were asked for."""

    uncertainty: "Uncertainty"
    identifiability: "Identifiability"
    profiles: "dict[str, Profile]"


@command
def analyse(
    logs: "LogSources" = (),
    *,
    fit: "ModelSource | None" = None,
    profile: str | list[str] = "",
    out: "Source | None" = None,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Result[Analysis]:
    """Find which parameters, and which combinations of parameters, the logs determine.

    Prints the standard deviation and the 95 % interval of each parameter, and the combinations that the logs
    do not determine.

    Example: hydroid analyse LOG.csv --fit runs/hyd --profile A_A

        analysed = hydroid.analyse("a.csv", fit="runs/a")
        print(analysed.result.uncertainty.interval)

    Args:
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the start values of the
            parameters].
        profile (K,D): Parameters to profile. Each point of a profile takes a refinement.

    Raises:
        SettingsError: a name that is no free parameter.
        RunError: the simulation diverged, or the folder cannot be written.
    """
    if fit is None:
        model = start_values(load_settings(config or "fit-mech", set))
    else:
        model = open_model(fit, config, set)
    problem = problem_of(model, logs, repair=repair)
    from hydroid.fitting.summary import account
    from hydroid.posterior import profile as profiling
    from hydroid.posterior import uncertainty
    from hydroid.reporting.parameters_report import parameter_table, unknown_sections

    with Progress() as progress:
        known = uncertainty.uncertainty(problem, model.theta)
        profiles: dict[str, Profile] = {}
        for done, name in enumerate(names(profile)):
            progress("profiles", done, len(names(profile)))
            profiles[name] = profiling.profile(problem, known, name)
    identified = uncertainty.identifiability(problem, known)
    summary = account(problem, known, identified)
    better = tuple(name for name, one in profiles.items() if one.better_optimum)
    findings = (*([Finding("better optimum", "warning", better)] if better else []), *summary.findings)
    intervals = {name: one.interval for name, one in profiles.items()}
    tables = {"parameters": parameter_table(problem.settings, summary, intervals)}
    every = tables | {name: t for s in unknown_sections(summary) for name, t in s.tables.items()}
    content: dict[str, Any] = {"at": model.source, "rank": identified.rank}
    content |= summary.model_copy(update={"findings": findings}).model_dump(
        mode="json", include={"findings", "estimate"}
    )
    for name, parameter in content["estimate"].items():
        parameter["profile_interval"] = [*map(finite, intervals[name])] if name in intervals else None
    lines = [*tables.values(), *(f"- {finding}" for finding in findings), *written(every, out)]
    return Result(lines, content, Analysis(known, identified, profiles))
