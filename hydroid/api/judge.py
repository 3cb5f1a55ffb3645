"""Judge a fit: `validate` on other logs; `identifiability`, `sensitivity`, `surface` at its estimate."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.api.look import ModelSource, open_model, read_logs
from hydroid.api.study import Study
from hydroid.errors import RunError, SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.api.look import LogSources
    from hydroid.fitting.validation import Prediction
    from hydroid.parameters import Array
    from hydroid.posterior.sweep import Surface, Sweep
    from hydroid.problem.problem import Problem
    from hydroid.report.uncertainty_report import UncertaintyStudy


def validate(
    models: ModelSource | Sequence[ModelSource],
    logs: "LogSources",
    out: str | Path | None = "runs/validation",
    *,
    repair: bool = False,
    leave_one_out: bool = False,
) -> "Study[list[Prediction]]":
    """Compare fits with logs they were not fitted to: error indices (article, table 9), bands, plots.

        study = hydroid.validate("runs/a", "b.csv")
        print(study.result[0].indices[2].rms)  # of joint 2 [rad]

    Args:
        models: a run folder, a YAML file of values or an identified model, or several of them. Each reads the
            logs with its own settings.
        logs: CSV files or logs, one or several.
        out: folder for the page, the table and the figures; None: nothing is written.
        repair: fill holes of the logs up to `log.repair_s`.
        leave_one_out: refine the model without one log and test it on that log, for every log.

    Returns:
        The study, with one result for each fit and log. The report of each run shows its unseen logs too.

    Raises:
        LogError: a log cannot be used.
        RunError: a simulation diverged, or the folder cannot be written.
    """
    several = [models] if isinstance(models, str | Path | IdentifiedModel) else models
    opened = [open_model(model) for model in several]
    if leave_one_out and len(opened) > 1:
        raise SettingsError("takes one fit", where="--leave-one-out", hint="call it for each fit")
    read = [read_logs(logs, model.settings, repair=repair) for model in opened]
    from hydroid.fitting.validation import predicted, without_one
    from hydroid.report.comparison import validation_page
    from hydroid.report.drawing import draw
    from hydroid.run.identity import was_fitted
    from hydroid.run.record import keep_validation

    folds = [without_one(opened[0], read[0], i) for i in range(len(read[0]))] if leave_one_out else []
    results: list[Prediction] = []
    for model, each in zip(opened, read, strict=True):
        for i, log in enumerate(each):
            seen = was_fitted(Path(model.source).parent, log)
            unseen = True if leave_one_out else None if seen is None else not seen
            results.append(predicted(folds[i] if leave_one_out else model, log, unseen))
    study = Study(results, validation_page(results, opened[0].settings.arm, folds)).write(out)
    for model, each in zip(opened, read, strict=True) if out is not None and not leave_one_out else ():
        own, results = results[: len(each)], results[len(each) :]
        if (run := keep_validation(model, own)) is not None:
            draw([run], run)
    return study


def identifiability(
    model: ModelSource,
    logs: "LogSources",
    out: str | Path | None = "runs/identifiability",
    *,
    profile: Sequence[str] = (),
    progress: Progress = no_progress,
) -> "Study[UncertaintyStudy]":
    """Find which combinations of parameters logs determine, at an estimate or at given values.

        study = hydroid.identifiability("runs/a", "a.csv", profile=["K"])
        print(study.result.uncertainty.interval)

    Args:
        model: as of `validate` (`start_values` gives one before any fit).
        logs: CSV files or logs, one or several.
        out: folder for the page, tables and figures; None: nothing is written.
        profile: names of parameters whose profile likelihood is wanted.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        SettingsError: a name that is no free parameter.
        RunError: the simulation diverged, or the folder cannot be written.
    """
    from hydroid.fitting.refinement import refine
    from hydroid.posterior import profile as profiles
    from hydroid.problem.problem import Problem
    from hydroid.report.uncertainty_report import uncertainty_page
    from hydroid.settings.search import RefinementSettings

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    if not np.isfinite(problem.residuals(model.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", where=model.source)
    study = _analysed(problem, model.theta, model.source, profile, progress)
    better = profiles.better_optimum(problem, study.uncertainty, study.profiles)
    if better is not None:
        refinement = model.settings.refinement or RefinementSettings()
        unit = refine(problem, better, refinement, lambda simulated, rms: None).point
        theta = problem.parameters.from_unit(unit[None])[0]
        source = f"a better optimum than that of {model.source}"
        values = ", ".join(f"{n} {v:.5g}" for n, v in problem.parameters.mapping(theta).items())
        moved = f"A profile found a better optimum. It was refined, and all results are of it: {values}."
        study = replace(_analysed(problem, theta, source, profile, progress), moved=moved)
    return Study(study, uncertainty_page(study)).write(out)


def _analysed(
    problem: "Problem", theta: "Array", source: str, profile: Sequence[str], progress: Progress
) -> "UncertaintyStudy":
    """Return the study of an estimate, with the profiles that are asked for."""
    from hydroid.posterior import covariance, directions
    from hydroid.posterior import profile as profiling
    from hydroid.report.uncertainty_report import UncertaintyStudy

    uncertainty = covariance.uncertainty(problem, theta)
    profiles: list[profiling.Profile] = []
    for done, name in enumerate(profile):
        progress("profiles", done, len(profile))
        profiles.append(profiling.profile(problem, uncertainty, name))
    found = directions.identifiability(problem, uncertainty)
    return UncertaintyStudy(problem, source, uncertainty, found, tuple(profiles))


def sensitivity(
    model: ModelSource,
    logs: "LogSources",
    out: str | Path | None = "runs/sensitivity",
    *,
    progress: Progress = no_progress,
) -> "Study[Sweep]":
    """Find how every output depends on every free parameter against time (article, figure 10).

        study = hydroid.sensitivity("runs/a", "a.csv")

    Args:
        model: as of `validate`.
        logs: CSV files or logs, one or several.
        out: folder for the page, figures and CSV; None: nothing is written.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        RunError: the folder cannot be written.
    """
    from hydroid.posterior.sweep import sweep
    from hydroid.problem.problem import Problem
    from hydroid.report.sensitivity_report import sensitivity_page

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    result = sweep(problem, model.theta, progress)
    return Study(result, sensitivity_page(problem, model.theta, result)).write(out)


def surface(
    model: ModelSource,
    logs: "LogSources",
    over: Sequence[tuple[str, str]],
    out: str | Path | None = "runs/surface",
    *,
    grid: tuple[int, float | None] = (31, None),
    progress: Progress = no_progress,
) -> "Study[list[Surface]]":
    """Compute the error over two parameters, all others held at the estimate (article, figure 11).

        study = hydroid.surface("runs/a", "a.csv", [("K", "D")])

    Args:
        model: as of `validate`.
        logs: CSV files or logs, one or several.
        over: pairs of parameters.
        out: folder for the page, figures and CSV; None: nothing is written.
        grid: points in each direction, and the relative reach around the estimate (0.2 for ±20 %; None: the
            parameters' bounds).
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        SettingsError: a pair that is none, or a parameter that does not exist or is fixed.
        RunError: the folder cannot be written.
    """
    for pair in over:
        if len(pair) != 2:
            raise SettingsError("names no pair of parameters", where=",".join(pair), hint="such as K,D")
    from hydroid.posterior import sweep as sweeps
    from hydroid.problem.problem import Problem
    from hydroid.report.objectives import surface_page

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    results = [sweeps.surface(problem, model.theta, pair, *grid, progress) for pair in over]
    return Study(results, surface_page(results, model.settings.objective)).write(out)
