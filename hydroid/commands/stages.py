"""`hydroid fit-mech`, `hydroid fit-hyd` and `hydroid adapt`: fits, from files to run
folders."""

import builtins
from collections.abc import Sequence
from dataclasses import asdict, replace

from hydroid.arrays import record
from hydroid.commands.fit import FitResult, fit as run_fit
from hydroid.commands.inputs import (
    ConfigSource,
    LogSources,
    ModelSource,
    SettingChanges,
    Source,
    command,
    load_settings,
    names,
    note_shipped_arm,
    open_model,
    open_values,
    setting_changes,
)
from hydroid.commands.joint_units import in_joint_units
from hydroid.commands.logs import read_logs, refuse_unfit
from hydroid.commands.progress import FitProgress, Progress
from hydroid.errors import SettingsError
from hydroid.estimate import FitSummary
from hydroid.files import Plain
from hydroid.log import Log
from hydroid.parallel.cluster import open_workers
from hydroid.progress import LOGGER
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.arm import TIP_LOAD
from hydroid.settings.fit import FitSettings
from hydroid.settings.parameters import nominal_value
from hydroid.settings.problem import ParameterSettings
from hydroid.units import seconds


@command
def fit_mech(
    logs: "LogSources",
    *,
    out: "Source | None" = None,
    algorithm: str | None = None,
    seed: int | None = None,
    start: "ModelSource | None" = None,
    resume: bool = False,
    refinement: bool | None = None,
    threads: int | None = None,
    budget: str | None = None,
    dask: str | None = None,
    config: "ConfigSource" = "fit-mech",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> FitResult:
    """Estimate gain, damping, stiffness and link masses from logs (stage 1).

    Writes a run folder with report.html, estimate.yaml, tables and the fitted arm. Then
    test the estimate on a log that it was not fitted to: `hydroid validate`.

    Example: hydroid fit-mech LOG.csv --out runs/mech

        fitted = hydroid.fit_mech("a.csv", out="runs/mech", algorithm="ga")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder [default: runs/fit-mech; in Python nothing is
            written].

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    options = FitOptions(
        logs=logs,
        out=out,
        algorithm=algorithm,
        seed=seed,
        start=start,
        resume=resume,
        refinement=refinement,
        threads=threads,
        budget=budget,
        dask=dask,
        config=config,
        set=set,
        repair=repair,
    )
    return _fit("mech", options)


@command
def fit_hyd(
    logs: "LogSources",
    *,
    mech: "ModelSource | None" = None,
    out: "Source | None" = None,
    algorithm: str | None = None,
    seed: int | None = None,
    start: "ModelSource | None" = None,
    resume: bool = False,
    refinement: bool | None = None,
    threads: int | None = None,
    budget: str | None = None,
    dask: str | None = None,
    config: "ConfigSource" = "fit-hyd",
    set: "SettingChanges" = None,
    repair: bool = False,
) -> FitResult:
    """Estimate the hydraulic actuators (stage 2).

    By default it estimates piston areas, valve openings, onsets (the voltage that the
    amplifier gives the valve at the smallest command, of each sign), delay, damping and
    friction. The config can free more, such as the amplifier's currents and the
    solenoid. Writes a run folder as fit-mech does.

    Example: hydroid fit-hyd LOG.csv --config mine/fit.yaml --out runs/hyd

        fitted = hydroid.fit_hyd("a.csv", mech="runs/mech", out="runs/hyd")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder [default: runs/fit-hyd; in Python nothing is
            written].
        mech (RUN|YAML): Stage 1: its run folder, or a YAML file of its values. The
            masses are fixed at these values. Without this option, masses
            that are free parameters in the settings are estimated, and all others are
            taken from the arm's file.

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    options = FitOptions(
        logs=logs,
        out=out,
        algorithm=algorithm,
        seed=seed,
        start=start,
        resume=resume,
        refinement=refinement,
        threads=threads,
        budget=budget,
        dask=dask,
        config=config,
        set=set,
        repair=repair,
    )
    return _fit("hyd", options, mech)


@record
class FitOptions:
    """What both stages take on the command line, and in Python."""

    logs: "LogSources"
    out: "Source | None"
    algorithm: str | None
    seed: int | None
    start: "ModelSource | None"
    resume: bool
    refinement: bool | None
    threads: int | None
    budget: str | None
    dask: str | None
    config: "ConfigSource"
    set: "SettingChanges"
    repair: bool

    def changes(self) -> Plain:
        """Return the settings that the options replace, by dotted key."""
        options = {
            "search.algorithm": self.algorithm,
            "search.seed": self.seed,
            "simulation.threads": self.threads,
        }
        changes = setting_changes(self.set, options)
        if self.refinement is False:
            changes["refinement"] = None
        return changes

    def seconds(self) -> float | None:
        """Return the time for search and refinement [s]; None: as much as they need."""
        if self.budget is None:
            return None
        budget = seconds(self.budget)
        if not budget:
            hint = "write it as 90s, 5min or 2h"
            raise SettingsError(f"{self.budget!r} is no time", "--budget", hint)
        return budget


def _fit(
    stage: str, options: FitOptions, mech: "ModelSource | None" = None
) -> FitResult:
    config = options.config
    changes = options.changes()
    settings = load_settings(config, changes)
    if settings.stage != stage:
        what = (
            f"has stage: {settings.stage}, but hydroid fit-{stage} needs stage: {stage}"
        )
        raise SettingsError(
            what, config, f"use hydroid fit-{settings.stage}, or another --config"
        )
    # what stage 1 and --start say are settings like any others: they are read with them
    # once more
    stated = Plain()
    if stage == "hyd":
        stated |= held_mechanics(mech, settings, changes)
    if options.start is not None:
        stated |= _starts(options.start, settings, stated)
    if stated:
        # what --set says has the last word, and keeps its place among the changes
        settings = load_settings(config, {**changes, **stated, **changes})
    if config == f"fit-{stage}":
        note_shipped_arm(settings)
    budget = options.seconds()
    read = read_logs(options.logs, settings, repair=options.repair, fitted=True)
    with (
        open_workers(options.dask) as workers,
        FitProgress(settings, budget) as watcher,
    ):
        result = run_fit(
            settings,
            read,
            options.out,
            resume=options.resume,
            progress=watcher,
            workers=workers,
        )
    return result.begun_from(mech, options.start)


def _starts(start: "ModelSource", settings: FitSettings, held: Plain) -> Plain:
    """Return the starts of free parameters that an estimate has values of,
    as settings to replace."""
    values, _ = open_values(start)
    starts = Plain()
    for name, parameter in settings.parameters.items():
        is_free = parameter.fixed is None and f"parameters.{name}.fixed" not in held
        if is_free and name in values:
            starts[f"parameters.{name}.start"] = values[name]
    if not starts:
        raise SettingsError("has a value of none of the free parameters", start)
    return starts


def held_mechanics(
    mech: "ModelSource | None", settings: FitSettings, changes: Plain
) -> Plain:
    """Return what of stage 2's settings, read with `changes`, stage 1 says:
    its parameters at its estimate.

    Of a run folder or a result of stage 1, or a YAML file of values by name, the masses
    hold, and damping and stiffness where the settings state no start or nominal value
    of their own. None: the settings fix them, or say what is known of them (a prior or
    a start), and they are estimated with the others. `changes` have the last word.

    Raises:
        RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    values, summary = _stage_1(mech)
    mechanical = _mechanical(settings)
    held = Plain()
    for name, parameter in mechanical.items():
        key = f"parameters.{name}.fixed"
        estimated_anew = parameter.states_start and parameter.quantity != "mass"
        if name not in values or key in changes or estimated_anew:
            continue
        held[key] = values[name]
        if summary is not None:
            _warn_of_doubtful_mass(
                name, values[name], summary.estimate[name].flag, settings
            )
    missing = [
        name
        for name, parameter in mechanical.items()
        if name not in values and _needs_value(parameter, mech)
    ]
    if missing:
        hint = "give the run of stage 1 with --mech RUN, or set fixed, nominal or start for each"
        what = f"stage 2 needs the values of {', '.join(missing)} from stage 1"
        raise SettingsError(what, mech or "", hint)
    return held


def _stage_1(mech: "ModelSource | None") -> tuple[Plain, FitSummary | None]:
    """Return the values of stage 1 by name, and the fit's own account of them where
    there is one."""
    if mech is None:
        return {}, None
    values, summary = open_values(mech)
    if summary is not None and summary.stage != "mech":
        hint = "name a run of fit-mech, or begin at this fit with --start"
        raise SettingsError(
            "is a fit of stage 2, but --mech takes one of stage 1", mech, hint
        )
    return values, summary


def _mechanical(settings: FitSettings) -> dict[str, ParameterSettings]:
    """Return the parameters of stage 2 that stage 1 has, too."""
    return {
        name: parameter
        for name, parameter in settings.parameters.items()
        if parameter.quantity in MECHANICAL and parameter.quantity != "gain"
    }


def _needs_value(parameter: ParameterSettings, mech: "ModelSource | None") -> bool:
    """Return whether nothing but stage 1 tells a parameter; where it is named,
    it is to tell all."""
    if parameter.fixed is not None:
        return False
    return mech is not None or not parameter.states_start


def _warn_of_doubtful_mass(
    name: str, value: float, flag: str | None, settings: FitSettings
) -> None:
    """Warn where a mass is held that stage 1 did not determine, far from what was
    expected."""
    parameter = settings.parameters[name]
    if parameter.quantity != "mass" or flag in (None, "identifiable", "fixed"):
        return
    expected = nominal_value(settings.arm, settings.hydraulics, parameter)
    if not expected or abs(value - expected) <= 0.1 * expected:
        return
    LOGGER.warning(
        f"{name} is held at {value:.3g} kg, which the logs of stage 1 do not determine ({flag}). "
        f"Expected was {expected:.3g} kg; to take that: "
        f"--set parameters.{name}.fixed={expected:.3g}"
    )


@command
def adapt(
    logs: "LogSources",
    *,
    fit: "ModelSource",
    free: "str | None" = None,
    out: "Source | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> FitResult:
    """Adapt a fit to new logs: estimate a few parameters anew, and keep the others.

    Use it after a change of the machine: a slower engine, a colder day, another tool.
    For a load of known mass, set the payload of the logs instead: --set
    'payloads={LOADED.csv: 250}'. For a load that nobody has weighed, free tip_load.
    Without --free, hydroid tries parameters one by one. It leaves parts of the logs out
    of the fit and predicts them. A parameter stays free only if that lowers the error
    there. The result is a run folder like that of a fit.

    Example: hydroid adapt SLOW.csv --fit runs/hyd --free P_flow

        adapted = hydroid.adapt("b.csv", fit="runs/a", free="M3")
        print(adapted.summary.values)

    Args:
        logs (LOG): The new logs.
        free (NAME,NAME): Parameters to free [default: those that help. hydroid tries
            masses, pump and tip_load. If log.groups names groups of logs, such as
            days, it also tries parameters that may differ from group to group].
        out (DIR): Run folder [default: runs/adapt; in Python nothing is written].
        set (KEY=VALUE): Replace a setting of the fit, such as
            refinement.iterations=100.

    Raises:
        HydroidError: an input or a folder that cannot be used, or no parameter that
            helps.
    """
    model = open_model(fit, overrides=set)
    read = read_logs(logs, model.settings, repair=repair)
    if set:
        stray = model.settings.payloads.keys() - _own_payloads(
            fit, model.settings, read
        )
        if stray:
            raise SettingsError("is none of the logs", f"payloads.{min(stray)}")
    refuse_unfit(read, model.settings)
    from hydroid.advice.adaptation import adapted, load_findings, steps
    from hydroid.advice.loads import asked_loads, load_finding
    from hydroid.reporting.verdict_table import left_out_table

    with Progress() as progress:
        path = steps(model, read, [*dict.fromkeys(names(free))], progress)
    chosen = [step["parameter"] for step in path[1:]]
    if not chosen:
        hint = "name parameters with --free, or fit anew with --start RUN"
        raise SettingsError(
            "no parameter lowers the error on parts left out", model.source, hint
        )
    settings = adapted(model, chosen, read)
    with FitProgress(settings) as watcher:
        result = run_fit(settings, read, out, progress=watcher).begun_from(fit)
    named = [step | {"parameter": step["parameter"] or "none"} for step in path]
    title = "Parameters freed one after another"
    table = left_out_table(title, {"parameter": "freed"}, named, settings.arm)
    # where a load at the tip was tried too, a mass that was freed says more than it
    of_loads = ()
    if free:
        of_loads = load_findings(settings)
    if TIP_LOAD in chosen:
        of_loads = load_finding(asked_loads(model, read))
    findings = [*result.content["findings"], *map(asdict, of_loads)]
    own = in_joint_units({"steps": path, "findings": findings}, settings.arm)
    content = {**result.content, **own}
    lines = [table, *map(str, of_loads), *result.lines]
    return replace(result, lines=lines, content=content)


def _own_payloads(
    fit: "ModelSource", settings: FitSettings, logs: Sequence[Log]
) -> builtins.set[str | None]:
    """Return the names of logs that may have a payload: these, and those of the fit
    itself."""
    return {
        *open_model(fit).settings.payloads,
        *(settings.payload_name(log.source) for log in logs),
    }
