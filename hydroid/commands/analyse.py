"""`hydroid analyse` and `hydroid.quantity`: what logs determine of the parameters,
and of what follows."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from hydroid.arrays import Array, record
from hydroid.commands.console import Result, written
from hydroid.commands.inputs import (
    ConfigSource,
    LogSources,
    ModelSource,
    SettingChanges,
    Source,
    command,
    load_settings,
    names,
    open_model,
)
from hydroid.commands.logs import problem_of
from hydroid.commands.progress import Progress
from hydroid.errors import RunError
from hydroid.estimate import finite
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.identified_model import start_values

if TYPE_CHECKING:
    from hydroid.plant import Plant
    from hydroid.posterior.identifiability import Identifiability, Profile
    from hydroid.posterior.uncertainty import Uncertainty


@record
class Analysis:
    """What logs determine at an estimate: intervals, directions,
    and the profiles that were asked for."""

    uncertainty: "Uncertainty"
    identifiability: "Identifiability"
    profiles: "dict[str, Profile]"


@record
class QuantityResult:
    """A quantity with what a fit knows of it.

    Attributes:
        value: at the estimate, of the shape S that the function returns.
        sd: standard deviation, shape S; infinite where the logs do not determine it.
        interval: of 95 %, shape (S, 2).
        unit: as given.
    """

    value: Array
    sd: Array
    interval: Array
    unit: str = ""


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

    Prints the standard deviation and the 95 % interval of each parameter, and the
    combinations that the logs do not determine. It also writes a page: the prior and
    posterior of each parameter, the correlations, and the profiles. A profile is the
    lowest error that a fit can reach where one parameter is held at each of several
    values.

    Example: hydroid analyse LOG.csv --fit runs/hyd --profile A_A

        analysed = hydroid.analyse("a.csv", fit="runs/a")
        print(analysed.result.uncertainty.interval)

    Args:
        logs (LOG): Logs of commands and joint angles [default: those of the run].
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the start
            values of the parameters].
        config (YAML): Settings; not needed if --fit is a run folder, which has its own.
        profile (K,D): Parameters to profile. Each point of a profile costs a
            refinement, so this is slow.

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
    from hydroid.posterior import identifiability
    from hydroid.posterior.uncertainty import uncertainty
    from hydroid.reporting.analysis import analysis_page
    from hydroid.reporting.parameters_report import parameter_table, sentence

    wanted = names(profile)
    profiles: dict[str, Profile] = {}
    with Progress() as progress:
        of_estimate = uncertainty(problem, model.theta)
        for done, name in enumerate(wanted):
            progress("profiles", done, len(wanted))
            profiles[name] = identifiability.profile(problem, of_estimate, name)
    identified = identifiability.identifiability(problem, of_estimate)
    summary = account(problem, of_estimate)
    findings = summary.findings
    better = tuple(name for name, found in profiles.items() if found.better_optimum)
    if better:
        findings = (Finding("better optimum", "warning", better), *findings)
    intervals = {name: found.interval for name, found in profiles.items()}
    table = parameter_table(problem.settings, summary, intervals)
    content: Plain = {"at": model.source, "rank": identified.rank}
    stated = summary.changed({"findings": findings})
    content |= stated.model_dump(mode="json", include={"findings", "estimate"})
    for name, parameter in content["estimate"].items():
        interval = intervals.get(name)
        parameter["profile_interval"] = (
            None if interval is None else [*map(finite, interval)]
        )
    page = analysis_page(problem.settings, stated, profiles)
    page = replace(page, files={**page.files, "parameters": table})
    said = [f"- {sentence(finding, problem.settings)}" for finding in findings]
    lines = [table, *said, *written(page, out)]
    return Result(lines, content, Analysis(of_estimate, identified, profiles), page)


def quantity(
    model: ModelSource,
    function: "Callable[[Plant], ArrayLike]",
    *,
    unit: str = "",
    positive: bool = False,
) -> QuantityResult:
    """Compute a quantity of one's own from a fit, with its 95 % interval.

        def speed(plant):
            before = plant.reset("study")[1]
            for _ in range(50):
                after = plant.step({"shoulder": 50})[1]
            return (after - before) / 0.5
        found = hydroid.quantity("runs/a", speed, unit="rad/s")
        print(found.value, found.interval, found.unit)

    Args:
        model: the run folder of a fit, or a plant saved from one.
        function: takes a `Plant` and returns a number or an array. It is called with 2
            p + 1 plants, p free parameters, and should be smooth in them: interpolate
            an event between two samples.
        unit: of the value, for the reader.
        positive: the quantity cannot be negative; its interval is then multiplicative.

    Raises:
        RunError: the folder has no covariance of these parameters, or a simulation
            diverged.
    """
    from hydroid.plant import Plant
    from hydroid.posterior.posterior import stored_posterior

    opened = open_model(model)
    posterior = stored_posterior(opened)
    if posterior is None:
        hint = "name the folder of a fit, with the settings that it used"
        raise RunError("holds no covariance of these parameters", opened.source, hint)
    shape = np.shape(function(Plant(opened)))

    def values(theta: Array) -> Array:
        rows = list[Array]()
        for row in theta:
            plant = Plant(replace(opened, theta=row))
            rows.append(np.ravel(np.asarray(function(plant), float)))
        return np.stack(rows)

    found = posterior.propagate(values, positive)
    ends = found.interval.reshape(*shape, 2)
    return QuantityResult(
        found.value.reshape(shape), found.sd.reshape(shape), ends, unit
    )
