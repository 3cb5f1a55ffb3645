"""Logs that commands read: files, or logs that were read before, of an arm alone or of
the arms of a pair."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.arrays import Array
from hydroid.commands.inputs import LogSource, LogSources, ModelSource, as_list
from hydroid.commands.progress import Progress
from hydroid.errors import LogError, RunError, SettingsError
from hydroid.estimate import read_estimate
from hydroid.files import Plain, is_file
from hydroid.findings import Level
from hydroid.identified_model import IdentifiedModel
from hydroid.log import (
    OTHER_UNITS,
    Log,
    LogFinding,
    Reading,
    by_level,
    check_parts,
    grouped,
    lacked_by_all,
    log_finding,
    open_table,
    stands_still,
)
from hydroid.progress import LOGGER, NOTE, Progress as WorkProgress, no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import LogSettings, log_file

if TYPE_CHECKING:
    from hydroid.problem.problem import Problem


def read_logs(
    logs: LogSources,
    settings: FitSettings,
    *,
    repair: bool = False,
    angles: bool = True,
    fitted: bool = False,
) -> list[Log]:
    """Read logs as the settings map them; warnings and notes go to the `hydroid`
    logger.

        logs = hydroid.read_logs(["a.csv", "b.csv"], hydroid.load_settings("fit-mech"))

    A file with long gaps gives a log for each part between them, whose source is
    FILE[1], FILE[2], ...

    Args:
        logs: files, or logs that were read before; one or several.
        settings: of the fit; joints that a log does not measure are taken to stand in
            its `start_pose`.
        repair: fill holes up to `log.repair_s`.
        angles: whether the compared joints must be measured.
        fitted: whether a fit is made of them: the column `log.work.column` must be in
            one of the files then.

    Raises:
        LogError: the first fault that keeps a log from being used.
    """
    read, findings = _checked(logs, settings, repair=repair, angles=angles)
    if fitted:
        findings = lacked_by_all(findings)
    _tell([finding for of_file in findings for finding in of_file])
    return read


def read_tests(
    logs: LogSources, settings: FitSettings, *, repair: bool
) -> tuple[list[Log], set[Path]]:
    """Read logs that shall test a fit, as `read_logs` does; return also the files among
    them that seem to be in other units than the settings say.

    Raises:
        LogError: the first fault that keeps a log from being used.
    """
    read, findings = _checked(logs, settings, repair=repair)
    told = [finding for of_file in findings for finding in of_file]
    _tell(told)
    unlike = [finding for finding in told if finding.kind in OTHER_UNITS]
    return read, {log_file(finding.source) for finding in unlike}


def _checked(
    logs: LogSources, settings: FitSettings, *, repair: bool, angles: bool = True
) -> tuple[list[Log], list[list[LogFinding]]]:
    """Return logs, and what was found in each file."""
    read = list[Log]()
    files = list[list[LogFinding]]()
    pose = settings.arm.pose(settings.start_pose)
    with Progress() as progress:
        for source in as_list(logs):
            if isinstance(source, Log):
                read.append(_posed(source, pose))
                files.append([])
                continue
            parts, of_file = check_file(
                Path(source), settings, repair=repair, angles=angles, progress=progress
            )
            if not parts:
                raise of_file[0].error()
            files.append(of_file)
            read += [replace(part, pose=pose) for part in parts]
    return read, files


def _posed(log: Log, pose: Array) -> Log:
    """Return a log whose joints that it does not measure stand in a pose [rad], (J,)."""
    if log.pose is None and not log.has_angle.all():
        return replace(log, pose=pose)
    return log


def _tell(findings: Sequence[LogFinding]) -> None:
    """Log warnings and notes, or raise the first error."""
    for finding in findings:
        if finding.level == "error":
            raise finding.error()
    for level, line in grouped(findings):
        importance = logging.WARNING if level == "warning" else NOTE
        LOGGER.log(importance, "%s: %s", level, line)


def read_log(
    log: LogSource, settings: FitSettings, *, repair: bool = False, angles: bool = True
) -> Log:
    """Read one log, as `read_logs` does.

    Raises:
        LogError: it cannot be used, or gaps split it.
    """
    read = read_logs(log, settings, repair=repair, angles=angles)
    if len(read) > 1:
        what = f"gaps split it into {len(read)} parts, and one log is needed"
        hint = "cut the file at its gaps, and name one part"
        raise LogError(what, log_file(read[0].source), hint)
    return read[0]


def check_file(
    path: Path,
    settings: FitSettings,
    *,
    repair: bool,
    angles: bool = True,
    progress: WorkProgress = no_progress,
) -> tuple[list[Log], list[LogFinding]]:
    """Read a file as the settings map it: its parts between gaps, none if it cannot be
    used.

    A bag that is given as `.` or `..` has its folder's name: by names payloads and
    groups find their logs.
    """
    if path.name in ("", ".."):
        path = path.resolve()
    arm = settings.arm
    outputs = settings.outputs if angles else None
    reading = Reading(outputs=outputs, arm=arm, repair=repair)
    return check_parts(path, settings.log, arm.ranges, reading, progress)


def joint_findings(logs: Sequence[Log], settings: FitSettings) -> list[LogFinding]:
    """Return what keeps compared joints from being fitted to all these logs together,
    once for each log."""
    return [*_undriven(logs, settings), *_standing(logs, settings)]


def _undriven(logs: Sequence[Log], settings: FitSettings) -> Iterator[LogFinding]:
    """Yield that no log drives some compared joints; of stage 2 an error if none is.

    Joints of stage 1 may move by themselves.
    """
    driven = np.any([log.driven for log in logs], axis=0)
    idle = [joint for joint in settings.outputs if len(logs) and not driven[joint - 1]]
    level = "warning"
    kind = "not driven"
    if settings.stage == "hyd" and len(idle) == len(settings.outputs):
        level = "error"
        kind = "nothing to fit"
    if idle:
        yield from _in_each(logs, level, kind, idle, settings)


def _standing(logs: Sequence[Log], settings: FitSettings) -> Iterator[LogFinding]:
    """Yield that some compared joints are driven, and to the last digit stand in every
    log: no machine holds so still, but a sensor that has failed."""
    standing = [joint for joint in settings.outputs if stands_still(logs, joint)]
    if standing:
        yield from _in_each(logs, "error", "never moves", standing, settings)


def _in_each(
    logs: Sequence[Log],
    level: Level,
    kind: str,
    joints: Sequence[int],
    settings: FitSettings,
) -> Iterator[LogFinding]:
    """Yield a finding about joints (numbers, from 1) for each log."""
    subjects = [settings.arm.joint_names[joint - 1] for joint in joints]
    for log in logs:
        yield log_finding(level, kind, log.source, *subjects)


def refuse_unfit(logs: Sequence[Log], settings: FitSettings) -> None:
    """Say which compared joints no log drives.

    Raises LogError: there is no other one, and stage 2 has nothing to fit; or the angle
    of one that is driven never changes.
    """
    findings = joint_findings(logs, settings)
    for level, line in grouped(findings):
        if level == "error":
            raise by_level(findings)[0].error()
        LOGGER.warning("%s: %s", level, line)


def plain_findings(findings: Sequence[LogFinding]) -> list[dict[str, str]]:
    """Return findings as JSON holds them."""
    keys = ("level", "kind", "what", "where", "hint")
    return [{key: getattr(finding, key) for key in keys} for finding in findings]


def read_arms(
    log: LogSource,
    settings: FitSettings,
    arm: str | None,
    *,
    pose: str | None = None,
    angles: bool = False,
    repair: bool = False,
) -> dict[str, Log]:
    """Read commands of an arm, or of the arms of a pair that move; return logs by the
    arm's name.

    Columns that begin with `right_` and `left_` are those of the two arms. Without them
    every arm that moves has the same commands: both move as mirror images. `angles`:
    read joint angles over time instead.
    """
    from hydroid.arm.model import ALONE, SIDES

    if arm not in (None, *SIDES, "both"):
        hint = f"choose {', '.join(SIDES)} or both"
        raise SettingsError(f"{arm!r} is no arm of a pair", "--arm", hint)
    columns = settings.log.angles_only() if angles else settings.log

    def read(columns: LogSettings) -> Log:
        changes: Plain = {"log": columns}
        if angles:
            # a path may leave joints out that a fit compares
            changes["outputs"] = ()
        read = read_log(log, settings.changed(changes), repair=repair, angles=angles)
        if pose is None:
            return read
        unmeasured = np.full_like(read.angle, np.nan)
        return replace(read, angle=unmeasured, pose=settings.arm.pose(pose))

    if arm is None:
        return {ALONE: read(columns)}
    moving = SIDES
    if arm != "both":
        moving = (arm,)
    if _names_sides(log, settings, SIDES):
        return {side: read(columns.of_arm(side)) for side in moving}
    return dict.fromkeys(moving, read(columns))


def _names_sides(log: LogSource, settings: FitSettings, sides: Sequence[str]) -> bool:
    """Return whether any column of a file is of one side of a pair."""
    if isinstance(log, Log):
        return False
    beginnings = tuple(f"{side}_" for side in sides)
    names = open_table(Path(log), settings.log).names
    return any(name.startswith(beginnings) for name in names)


def seen_logs(fit: ModelSource) -> list[Log]:
    """Return the logs that a fit has seen: its own, and those of fits that it began
    from.

    Of values that are from no run there are none. Raises RunError: the run's logs
    cannot be read.
    """
    from hydroid.run.record import logs_behind

    if isinstance(fit, str | Path):
        return logs_behind(read_estimate(Path(fit))[0])
    if isinstance(fit, IdentifiedModel):
        return logs_behind(Path(fit.source))
    own = [prediction.log for prediction in fit.predictions]
    return [*own, *fit.earlier]


def earlier_logs(fits: "Sequence[ModelSource | None]") -> tuple[Log, ...]:
    """Return the logs that fits have seen, each once.

    Those of a run that cannot be read are left out.
    """
    from hydroid.run.folder import samples

    seen = dict[bytes, Log]()
    for fit in fits:
        if fit is None:
            continue
        try:
            seen |= {samples(log): log for log in seen_logs(fit)}
        except RunError as error:
            what = "warning: %s; the logs of that fit will count as unseen"
            LOGGER.warning(what, error)
    return tuple(seen.values())


def run_logs(folder: Path) -> list[Path]:
    """Return the logs that a run folder was fitted to."""
    if not is_file(folder / "run.json"):
        hint = (
            "name one, as in hydroid suggest LOG.csv --fit RUN, "
            "or give a run folder as --fit"
        )
        raise SettingsError("no log is given", hint=hint)
    from hydroid.run.folder import RunFolder

    sources = RunFolder(folder).identity().get("logs", {})
    # parts between gaps are of one file
    logs = [*dict.fromkeys(map(log_file, sources))]
    missing = [str(log) for log in logs if not log.exists()]  # a bag is a folder
    if missing or not logs:
        what = f"the log of this run, {', '.join(missing)}, does not exist"
        raise RunError(what, folder, "give the log's new place")
    return logs


def problem_of(model: IdentifiedModel, logs: LogSources, *, repair: bool) -> "Problem":
    """Return the estimation problem of a model and logs, or those of its run where none
    is given."""
    folder = Path(model.source).parent
    read = read_logs(logs or run_logs(folder), model.settings, repair=repair)
    if not logs:
        _warn_of_changes(folder, read, model.settings)
    from hydroid.problem.problem import Problem

    problem = Problem(model.settings, read)
    if not np.isfinite(problem.output_errors(model.theta[None])).all():
        raise RunError("the simulation diverged with these parameters", model.source)
    return problem


def _warn_of_changes(folder: Path, logs: Sequence[Log], settings: FitSettings) -> None:
    """Say which logs of a run are no longer what it was fitted to."""
    from hydroid.run.folder import RunFolder, log_hash

    fitted = RunFolder(folder).identity().get("logs", {})
    for log in logs:
        if fitted.get(log.source) != log_hash(log, settings):
            what = "warning: %s: is not what %s was fitted to"
            LOGGER.warning(what, log.source, folder)
