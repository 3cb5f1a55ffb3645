"""Judge a fit: `validate` on other logs; `identifiability`, `sensitivity`, `surface` at its estimate."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.api.look import ModelSource, open_model, read_logs
from hydroid.api.study import Study
from hydroid.errors import RunError, SettingsError
from hydroid.files import is_file, write_atomic
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.api.look import LogSources
    from hydroid.log import Log
    from hydroid.parameters import Array
    from hydroid.posterior.sweep import Surface, Sweep
    from hydroid.problem.problem import Problem
    from hydroid.report.page import Page
    from hydroid.report.uncertainty_report import UncertaintyStudy
    from hydroid.report.validation_report import Validation

_log = logging.getLogger(__name__)


def validate(
    models: ModelSource | Sequence[ModelSource],
    logs: "LogSources",
    out: str | Path | None = "runs/validation",
    *,
    repair: bool = False,
    leave_one_out: bool = False,
) -> "Study[list[Validation]]":
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
    from hydroid.fitting.validation import error_indices
    from hydroid.posterior.band import prediction_bands
    from hydroid.prediction import predict
    from hydroid.report.validation_report import Validation, validation_page
    from hydroid.run.identity import was_fitted

    folds: list[IdentifiedModel] = []
    own: list[list[Validation]] = [[] for _ in opened]
    for model, each, found in zip(opened, read, own, strict=True):
        outputs, original = model.settings.outputs, model
        for i, log in enumerate(each):
            if leave_one_out:
                model = _refined_without(original, each, i)
                folds.append(model)
            response = predict(model, log, outputs)
            indices = {
                joint: error_indices(log.angle[:, joint - 1], response[:, column])
                for column, joint in enumerate(outputs)
            }
            bands = prediction_bands(model, log, response)
            seen = False if leave_one_out else was_fitted(Path(original.source).parent, log)
            arm = model.settings.arm
            found.append(Validation(model.name, log, response, indices, bands, seen, arm))
    results = [result for found in own for result in found]
    study = Study(results, validation_page(results, folds)).write(out)
    if out is not None and not leave_one_out:
        for model, found in zip(opened, own, strict=True):
            _show_in_report(model, validation_page(found))
    return study


def _show_in_report(model: IdentifiedModel, page: "Page") -> None:
    """Add a validation to the report of the run that a model is from, if its settings are the run's."""
    from hydroid.estimate import NAME
    from hydroid.report.page_file import content_html, page_content, read_page
    from hydroid.report.validated import with_validation

    source = Path(model.source)
    file = source.parent / "report.html"
    if source.name != NAME or not is_file(file) or load_identified(source).settings != model.settings:
        return
    try:
        content = with_validation(read_page(file), page_content(page))
        for name, text in {**page.data, file.name: content_html(content)}.items():
            write_atomic(source.parent / name, text)
    except RunError as error:
        _log.warning("the fit's own report does not show the validation: %s", error)


def _refined_without(model: IdentifiedModel, logs: "Sequence[Log]", left_out: int) -> IdentifiedModel:
    """Return the model refined on all logs but one, with its own uncertainty."""
    from hydroid.estimate import FitSummary
    from hydroid.fitting.refinement import refine
    from hydroid.posterior.covariance import uncertainty
    from hydroid.posterior.delta import precision
    from hydroid.problem.problem import Problem
    from hydroid.report.page import log_names
    from hydroid.run.summary import left_out_levels, noise_levels, parameter_estimates
    from hydroid.settings.search import RefinementSettings

    if len(logs) < 2:
        raise SettingsError("needs two logs or more", where="--leave-one-out")
    settings, name = model.settings, log_names(logs)[left_out]
    problem = Problem(settings, [log for i, log in enumerate(logs) if i != left_out])
    refinement = settings.refinement or RefinementSettings()
    unit = refine(problem, model.theta, refinement, lambda simulated, rms: None).point
    theta = problem.parameters.from_unit(unit[None])[0]
    known = uncertainty(problem, theta)
    summary = FitSummary(
        stage=settings.stage,
        estimate=parameter_estimates(problem, known),
        covariance=precision(problem.parameters, known).covariance(),
        noise_deg=noise_levels(problem, known),
        left_out_deg=left_out_levels(problem, known),
    )
    return IdentifiedModel(settings, theta, f"{model.name} without {Path(name).stem}", summary)


def identifiability(
    model: ModelSource,
    logs: "LogSources",
    out: str | Path | None = "runs/identifiability",
    *,
    profile: Sequence[str] = (),
    bootstrap: tuple[int, int] = (0, 0),
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
        bootstrap: number of refits with redrawn residuals, 0 for none, and the seed.
        progress: called with what is done, how much of it, and how much there is.

    Raises:
        SettingsError: a name that is no free parameter.
        RunError: the simulation diverged, or the folder cannot be written.
    """
    from hydroid.fitting.refinement import refine
    from hydroid.posterior import intervals
    from hydroid.problem.problem import Problem
    from hydroid.report.uncertainty_report import uncertainty_page
    from hydroid.settings.search import RefinementSettings

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    if not np.isfinite(problem.residuals(model.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", where=model.source)
    study = _analysed(problem, model.theta, model.source, (profile, bootstrap, progress))
    better = intervals.better_optimum(problem, study.uncertainty, study.profiles, study.refits)
    if better is not None:
        refinement = model.settings.refinement or RefinementSettings()
        unit = refine(problem, better, refinement, lambda simulated, rms: None).point
        theta = problem.parameters.from_unit(unit[None])[0]
        source = f"a better optimum than that of {model.source}"
        values = ", ".join(f"{n} {v:.5g}" for n, v in problem.parameters.mapping(theta).items())
        moved = (
            f"A profile or refit found a better optimum. It was refined, and all results are of it: {values}."
        )
        study = replace(_analysed(problem, theta, source, (profile, bootstrap, progress)), moved=moved)
    return Study(study, uncertainty_page(study)).write(out)


def _analysed(
    problem: "Problem",
    theta: "Array",
    source: str,
    asked: tuple[Sequence[str], tuple[int, int], Progress],
) -> "UncertaintyStudy":
    """Return the study of an estimate: `asked` are profiles, refits with their seed, and the progress."""
    from hydroid.posterior import covariance, directions, intervals
    from hydroid.report.uncertainty_report import UncertaintyStudy

    profile, (refits, seed), progress = asked
    uncertainty = covariance.uncertainty(problem, theta)
    profiles: list[intervals.Profile] = []
    for done, name in enumerate(profile):
        progress("profiles", done, len(profile))
        profiles.append(intervals.profile(problem, uncertainty, name))
    drawn = intervals.bootstrap(problem, uncertainty, refits, seed, progress) if refits else None
    found = directions.identifiability(problem, uncertainty)
    return UncertaintyStudy(problem, source, uncertainty, found, tuple(profiles), drawn)


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
    from hydroid.report.analysis_report import analysis_page

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    result = sweep(problem, model.theta, progress)
    return Study(result, analysis_page(problem, model.theta, sweep=result)).write(out)


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
    from hydroid.report.analysis_report import analysis_page

    model = open_model(model)
    problem = Problem(model.settings, read_logs(logs, model.settings))
    results = [sweeps.surface(problem, model.theta, pair, *grid, progress) for pair in over]
    return Study(results, analysis_page(problem, model.theta, surfaces=results)).write(out)
