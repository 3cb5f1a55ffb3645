"""Studies of a model at an estimate, as plain functions: sensitivity, error surfaces, the next experiment."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import RunError, SettingsError
from hydroid.experiment.design import design
from hydroid.identified import IdentifiedModel, load_identified
from hydroid.jobs import read_logs
from hydroid.log import Warn, write_log
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.report.page import write_page
from hydroid.report.study_reports import design_page, sensitivity_page, surface_page
from hydroid.report.table import Table
from hydroid.report.uncertainty_report import UncertaintyStudy, uncertainty_page
from hydroid.uncertainty.covariance import uncertainty
from hydroid.uncertainty.directions import identifiability
from hydroid.uncertainty.intervals import Profile, bootstrap, profile
from hydroid.uncertainty.surface import surface
from hydroid.uncertainty.sweep import sweep


def load_subject(
    config: str | None, fit: Path | None, params: Path | None, overrides: dict[str, Any]
) -> IdentifiedModel:
    """Read the model and the estimate that a study is about, from `fit` or `params`."""
    if (fit is None) == (params is None):
        what = "needs an estimate" if fit is None else "has two estimates"
        raise SettingsError(what, hint="give either --fit DIR or --params P.yaml")
    return load_identified(fit or params, config, overrides)


def study_sensitivity(
    subject: IdentifiedModel, logs: Sequence[Path], out: Path, warn: Warn, tell: Progress
) -> Table:
    """Write how every output depends on every free parameter against time (article, figure 10).

    Raises:
        HydroidError: what the user can mend.
    """
    problem = _problem(subject, logs, warn)
    page = sensitivity_page(problem, subject.theta, sweep(problem, subject.theta, tell))
    write_page(page, out)
    return page.tables["sensitivity"]


def study_surface(
    subject: IdentifiedModel,
    logs: Sequence[Path],
    out: Path,
    over: Sequence[str],
    points: int,
    around: float | None,
    warn: Warn,
    tell: Progress,
) -> Table:
    """Write the error over pairs of parameters (article, figure 11).

    Args:
        subject: the model and the estimate.
        logs: the logs that it is compared with.
        out: folder to write.
        over: pairs of parameters, each "K,D".
        points: of the grid, each way.
        around: relative reach of the grid around the estimate; None: the parameters' bounds.
        warn: takes what is odd about the logs.
        tell: is told how far the study is.

    Raises:
        HydroidError: what the user can mend.
    """
    pairs = [tuple(name.strip() for name in text.split(",")) for text in over]
    wrong = next((text for text, pair in zip(over, pairs, strict=True) if len(pair) != 2), None)
    if wrong is not None:
        raise SettingsError("names no pair of parameters", where=f"--over {wrong}", hint="write --over K,D")
    problem = _problem(subject, logs, warn)
    how = subject.settings.objective
    found = [surface(problem, subject.theta, (a, b), points, around, tell) for a, b in pairs]
    page = surface_page(found, how)
    write_page(page, out)
    return page.tables["surface"]


def study_design(
    subject: IdentifiedModel, logs: Sequence[Path], out: Path, seed: int, warn: Warn, tell: Progress
) -> Table:
    """Design the next experiment; write its commands, the predicted motion and the predicted precision.

    `commands.csv` holds the commands with every angle in the start pose, in the columns of the settings' log;
    `predicted.csv` the same with the simulated motion. It is no measurement.

    Args:
        subject: the model and the present estimate.
        logs: records whose information is there already; may be empty.
        out: folder to write.
        seed: of the search.
        warn: takes what is odd about the logs.
        tell: is told how far the search is.

    Raises:
        HydroidError: what the user can mend.
    """
    settings = subject.settings
    found = design(settings, subject.theta, read_logs(logs, settings, warn), seed, tell)
    write_log(out / "commands.csv", found.log, settings.log)
    write_log(out / "predicted.csv", found.predicted, settings.log)
    page = design_page(settings.arm, settings.design, found, subject.values)
    write_page(page, out)
    return page.tables["design"]


def study_identifiability(
    subject: IdentifiedModel,
    logs: Sequence[Path],
    out: Path,
    profiled: Sequence[str],
    refits: int,
    seed: int,
    warn: Warn,
    tell: Progress,
) -> UncertaintyStudy:
    """Write what logs determine at a parameter set, with profiles and a bootstrap where they are asked for.

    Args:
        subject: the model and the parameter set.
        logs: the logs.
        out: folder to write.
        profiled: names of parameters whose profile likelihood is wanted.
        refits: of the bootstrap; 0: none.
        seed: of the bootstrap.
        warn: takes what is odd about the logs.
        tell: is told how far the study is.

    Raises:
        HydroidError: what the user can mend.
    """
    problem = _problem(subject, logs, warn)
    if not np.isfinite(problem.residuals(subject.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", where=subject.source)
    found = uncertainty(problem, subject.theta)
    profiles: list[Profile] = []
    for done, name in enumerate(profiled):
        tell("profiles", done, len(profiled))
        profiles.append(profile(problem, found, name))
    drawn = bootstrap(problem, found, refits, seed, tell) if refits else None
    directions = identifiability(problem, found)
    study = UncertaintyStudy(problem, subject.source, found, directions, tuple(profiles), drawn)
    write_page(uncertainty_page(study), out)
    return study


def _problem(subject: IdentifiedModel, logs: Sequence[Path], warn: Warn) -> Problem:
    settings = subject.settings
    return Problem(settings, read_logs(logs, settings, warn))
