"""The commands as plain functions: from files to results and back to files.

The command line is a thin cover of these; a script or a notebook calls them directly.
"""

import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.assets import find_config
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import read_values
from hydroid.fitting.fit import Fit, Watcher, fit
from hydroid.fitting.search import check_search
from hydroid.fitting.validation import error_indices
from hydroid.identified import load_identified
from hydroid.log import Finding, Log, Warn, check_log, read_log
from hydroid.problem.problem import Problem, Spread
from hydroid.report.fit_report import fit_page
from hydroid.report.page import write_page
from hydroid.report.validation_report import Validation
from hydroid.run.folder import RunFolder
from hydroid.run.run_log import log_end, log_start
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load
from hydroid.settings.problem import MECHANICAL_UNITS
from hydroid.simulating import respond

_log = logging.getLogger(__name__)


def load_settings(config: str | Path, overrides: dict[str, Any] | None = None) -> FitSettings:
    """Read a fit's settings, and the arm they name, from a path or a shipped config's name."""
    return load(find_config(config), FitSettings, overrides)


def read_logs(paths: Sequence[Path], settings: FitSettings, warn: Warn, repair: bool = False) -> list[Log]:
    """Read logs as the settings map them; warnings and notes go to `warn`.

    Raises:
        LogError: the first fault that cannot be worked around.
    """
    ranges = np.stack([settings.arm.lower, settings.arm.upper], axis=1)
    logs: list[Log] = []
    for path in paths:
        log, findings = read_log(path, settings.log, ranges, outputs=settings.outputs, repair=repair)
        for finding in findings:
            warn(finding)
        # what the log does not measure stands in the settings' pose
        pose = np.where(log.measured, log.angle, settings.arm.pose(settings.start_pose))
        logs.append(replace(log, angle=pose))
    return logs


def check_logs(
    paths: Sequence[Path], settings: FitSettings, *, repair: bool = False
) -> Iterator[tuple[Path, Log | None, list[Finding]]]:
    """Check logs one by one: all that was found, and the log where it can be used."""
    ranges = np.stack([settings.arm.lower, settings.arm.upper], axis=1)
    for path in paths:
        yield path, *check_log(path, settings.log, ranges, outputs=settings.outputs, repair=repair)


def fit_logs(
    settings: FitSettings,
    paths: Sequence[Path],
    out: Path,
    watch: Watcher,
    warn: Warn,
    *,
    resume: bool = False,
    repair: bool = False,
    spread: Spread | None = None,
) -> tuple[Problem, Fit]:
    """Fit one run: logs in, a run folder out.

    Args:
        settings: the fit's settings.
        paths: the logs.
        out: the run folder.
        watch: is told how far the fit is.
        warn: takes what is odd about the logs.
        resume: go on where a run in `out` stopped; without one, begin.
        repair: fill short gaps of the logs.
        spread: workers that simulate; None: this process.

    Raises:
        HydroidError: what the user can mend.
    """
    _refuse_stray_payloads(settings, paths)
    findings: list[Finding] = []
    logs = read_logs(paths, settings, findings.append, repair)
    for finding in findings:
        warn(finding)
    problem = Problem(settings, logs, spread)
    folder = RunFolder(out)
    if not folder.exists:
        check_search(problem)
    elif not resume:
        hint = "continue it with --resume, or choose another --out"
        raise RunError("holds a run already", where=str(out), hint=hint)
    with folder.owned():
        log_start(settings, paths, findings)
        began = time.monotonic()
        try:
            result = _fit(folder, problem, paths, watch)
        except KeyboardInterrupt:
            _log.info("interrupted after %.0f s; --resume goes on", time.monotonic() - began)
            folder.status("interrupted")
            raise
        except Exception as error:
            _log.error("ended by %s: %s", type(error).__name__, error)
            raise
        log_end(result, time.monotonic() - began)
    return problem, result


def _fit(folder: RunFolder, problem: Problem, paths: Sequence[Path], watch: Watcher) -> Fit:
    """Begin the folder's run, or go on with it, to its report."""
    checkpoint = None
    if folder.exists:
        folder.check(problem.settings, paths)
        checkpoint = folder.checkpoint()
        folder.status("running")
        done = 0 if checkpoint is None else len(checkpoint.state.history)
        _log.info("resumed after generation %d", done)
    else:
        folder.begin(problem.settings, paths)
    result = fit(problem, folder.save, watch, checkpoint, folder.refinements())
    folder.write_estimate(problem, result)
    write_page(fit_page(folder.identity(), problem, result), folder.path)
    folder.status("done")
    return result


def _refuse_stray_payloads(settings: FitSettings, paths: Sequence[Path]) -> None:
    """A payload whose log's name is misspelt would be left out silently."""
    stray = sorted(set(settings.payloads) - {path.name for path in paths})
    if stray:
        names = ", ".join(path.name for path in paths)
        raise SettingsError("is none of the logs", where=f"payloads.{stray[0]}", hint=f"logs: {names}")


def mechanical_values(path: Path, settings: FitSettings) -> dict[str, Any]:
    """Return settings that hold stage 1's parameters at its estimate, for stage 2.

    Args:
        path: a run folder of stage 1, or a YAML file of values by name.
        settings: stage 2's; names that it does not have, such as the gain, are left out.

    Raises:
        RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    values, _ = read_values(path)
    wanted = [name for name, p in settings.parameters.items() if p.quantity in MECHANICAL_UNITS]
    missing = [name for name in wanted if name not in values and settings.parameters[name].fixed is None]
    if missing:
        raise SettingsError(f"has no value for {', '.join(missing)}", where=str(path))
    return {f"parameters.{name}.fixed": values[name] for name in wanted if name in values}


def validate_fits(
    folders: Sequence[Path], paths: Sequence[Path], warn: Warn, overrides: dict[str, Any] | None = None
) -> list[Validation]:
    """Simulate each fit's estimate on each log, with the settings it was fitted with."""
    results: list[Validation] = []
    for path in folders:
        model = load_identified(path, overrides=overrides)
        settings = model.settings
        for log in read_logs(paths, settings, warn):
            response = respond(settings, log, model.values, model.source, settings.outputs)
            indices = {
                joint: error_indices(log.angle[:, joint - 1], response[:, column])
                for column, joint in enumerate(settings.outputs)
            }
            results.append(Validation(path.name, log, response, indices))
    return results
