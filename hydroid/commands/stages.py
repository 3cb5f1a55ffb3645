"""`hydroid fit-mech`, `hydroid fit-hyd` and `hydroid adapt`: fits, from files to run folders."""

import builtins
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

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
    open_model,
    open_values,
    setting_changes,
)
from hydroid.commands.logs import read_logs, refuse_undriven
from hydroid.commands.progress import FitProgress, Progress
from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.log import Log
from hydroid.parallel.cluster import open_workers
from hydroid.progress import LOGGER, NOTE
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file
from hydroid.settings.parameters import nominal_value
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

    Writes a run folder with report.html, estimate.yaml, tables and the fitted arm. Then test the estimate on
    a log that it was not fitted to: `hydroid validate`.

    Example: hydroid fit-mech LOG.csv --out runs/mech

        fitted = hydroid.fit_mech("a.csv", out="runs/mech", algorithm="ga")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder [default of the command line: runs/fit-mech].

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit("mech", locals())


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
    """Estimate the hydraulic actuators (stage 2); the arm's parameters come from stage 1.

    By default it estimates piston areas, valve openings, onsets, delay and damping. The config can free more,
    such as the amplifier's currents and the solenoid. Writes a run folder as fit-mech does.

    Example: hydroid fit-hyd LOG.csv --config mine/fit.yaml --out runs/hyd

        fitted = hydroid.fit_hyd("a.csv", mech="runs/mech", out="runs/hyd")
        print(fitted.summary.values)

    Args:
        out (DIR): Run folder [default of the command line: runs/fit-hyd].
        mech (RUN|YAML): Stage 1: its run folder, or a YAML file of its values.

    Raises:
        HydroidError: an input or a folder that cannot be used.
    """
    return _fit("hyd", locals())


def _fit(stage: str, given: Mapping[str, Any]) -> FitResult:
    options = {
        "search.algorithm": given["algorithm"],
        "search.seed": given["seed"],
        "simulation.threads": given["threads"],
    }
    changes = setting_changes(given["set"], options)
    if given["refinement"] is False:
        changes["refinement"] = None
    config, start = given["config"], given["start"]
    settings, more = load_settings(config, changes), Plain()
    if settings.stage != stage:
        what = f"has stage: {settings.stage}, but hydroid fit-{stage} needs stage: {stage}"
        raise SettingsError(what, config, f"use hydroid fit-{settings.stage}, or another --config")
    if stage == "hyd":
        more |= held_mechanics(given["mech"], settings, changes)
    if start is not None:
        values, _ = open_values(start)
        starts = {
            f"parameters.{name}.start": values[name]
            for name, p in settings.parameters.items()
            if p.fixed is None and name in values and f"parameters.{name}.fixed" not in more
        }
        if not starts:
            raise SettingsError("has a value of none of the free parameters", start)
        more |= starts
    if more:
        settings = load_settings(config, {**changes, **more, **changes})
    if config == f"fit-{stage}":
        what = f"note: the arm is the shipped {settings.arm.name}"
        LOGGER.log(NOTE, f"{what}: for your machine give --config, which `hydroid init` writes")
    limit = given["budget"]
    budget = limit and seconds(limit)
    if limit is not None and not budget:
        raise SettingsError(f"is no time: {limit!r}", "--budget", "such as 90s, 5min or 2h")
    read = read_logs(given["logs"], settings, repair=given["repair"])
    with open_workers(given["dask"]) as workers, FitProgress(settings, budget) as watcher:
        result = run_fit(
            settings, read, given["out"], resume=given["resume"], progress=watcher, workers=workers
        )
    return result.begun_from(given.get("mech"), start)


def held_mechanics(mech: "ModelSource | None", settings: FitSettings, changes: Plain) -> Plain:
    """Return what of stage 2's settings, read with `changes`, stage 1 says: its parameters at its estimate.

    Of a run folder or a result of stage 1, or a YAML file of values by name, the masses hold, and damping and
    stiffness where the settings state no start or nominal value of their own. None: the settings fix them, or
    say what is known of them (a prior or a start), and they are estimated with the others. `changes` have the
    last word. Raises RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    values, summary = ({}, None) if mech is None else open_values(mech)
    if summary is not None and summary.stage != "mech":
        hint = "name a run of fit-mech, or begin at this fit with --start"
        raise SettingsError("is a fit of stage 2, but --mech takes one of stage 1", mech, hint)
    held, missing = Plain(), list[str]()
    for name, p in settings.parameters.items():
        if p.quantity not in MECHANICAL or p.quantity == "gain":
            continue
        value, key, mass = values.get(name), f"parameters.{name}.fixed", p.quantity == "mass"
        if value is None and p.fixed is None and (mech is not None or not p.states_start):
            missing.append(name)
        if value is None or key in changes or (p.states_start and not mass):
            continue
        held[key] = value
        nominal = nominal_value(settings.arm, settings.hydraulics, p)
        flag = summary and summary.estimate[name].flag
        doubtful = mass and flag not in (None, "identifiable", "fixed")
        if doubtful and nominal and abs(value - nominal) > 0.1 * nominal:
            LOGGER.warning(
                f"{name} is held at {value:.3g} kg, which the logs of stage 1 do not determine ({flag}). "
                f"Expected was {nominal:.3g} kg; to take that: --set parameters.{name}.fixed={nominal:.3g}"
            )
    if missing:
        hint = "give the run of stage 1 with --mech RUN, or set fixed, nominal or start for each"
        what = f"stage 2 needs the values of {', '.join(missing)} from stage 1"
        raise SettingsError(what, mech or "", hint)
    return held


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
    """Adapt a fit to new logs: a few parameters are freed, all others are held at its estimate.

    For a slower engine, a colder day, another tool. A load of known mass is no parameter but a payload of the
    logs: --set 'payloads={LOADED.csv: 250}'. Writes a run that every command takes. Judges each
    freed parameter by parts of the logs left out.

    Example: hydroid adapt LOADED.csv --fit runs/hyd --free P_flow,P_droop

        adapted = hydroid.adapt("b.csv", fit="runs/a", free="M3")
        print(adapted.summary.values)

    Args:
        logs (LOG): The new logs.
        free (NAME,NAME): Parameters to be freed [default: masses, pump and effects of the logs' groups, one
            after the other, as long as the error falls on every part of the logs left out].
        out (DIR): Run folder [default of the command line: runs/adapt].
        set (KEY=VALUE): Replace a setting of the fit, such as refinement.iterations=100.

    Raises:
        HydroidError: an input or a folder that cannot be used, or no parameter that helps.
    """
    model = open_model(fit, overrides=set)
    read = read_logs(logs, model.settings, repair=repair)
    if set and (stray := model.settings.payloads.keys() - _own_payloads(fit, read)):
        raise SettingsError("is none of the logs", f"payloads.{min(stray)}")
    refuse_undriven(read, model.settings)
    from hydroid.advice.adaptation import adapted, load_findings, steps
    from hydroid.reporting.verdict_table import left_out_table

    with Progress() as progress:
        path = steps(model, read, names(free), progress)
    chosen = [step["parameter"] for step in path[1:]]
    if not chosen:
        hint = "name parameters with --free, or fit anew with --start RUN"
        raise SettingsError("no parameter lowers the error on parts left out", model.source, hint)
    settings = adapted(model, chosen, read)
    with FitProgress(settings) as watcher:
        result = run_fit(settings, read, out, progress=watcher).begun_from(fit)
    named = [step | {"parameter": step["parameter"] or "none"} for step in path]
    table = left_out_table("Parameters freed one after another", {"parameter": "freed"}, named, settings.arm)
    said = load_findings(settings)
    content = {**result.content, "steps": path, "findings": [*result.content["findings"], *map(asdict, said)]}
    return replace(result, lines=[table, *map(str, said), *result.lines], content=content)


def _own_payloads(fit: "ModelSource", logs: Sequence[Log]) -> builtins.set[str]:
    """Return the logs that may have a payload: these, and those of the fit itself."""
    return {*open_model(fit).settings.payloads, *(log_file(log.source).name for log in logs)}
