"""Logs that commands read: files, or logs that were read before, of an arm alone or of
the arms of a pair."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.commands.inputs import LogSource, LogSources, ModelSource, as_list
from hydroid.commands.progress import Progress
from hydroid.errors import LogError, RunError, SettingsError
from hydroid.estimate import read_estimate
from hydroid.files import is_file
from hydroid.identified_model import IdentifiedModel
from hydroid.log import (
    Log,
    LogFinding,
    Reading,
    check_parts,
    grouped,
    log_finding,
    open_table,
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

    Raises:
        LogError: the first fault that keeps a log from being used.
    """
    read: list[Log] = []
    findings: list[LogFinding] = []
    pose = settings.arm.pose(settings.start_pose)
    with Progress() as progress:
        for source in as_list(logs):
            if isinstance(source, Log):
                known = source.measured.all() or source.pose is not None
                read.append(source if known else replace(source, pose=pose))
                continue
            parts, more = check_file(
                Path(source), settings, repair=repair, angles=angles, progress=progress
            )
            if not parts:
                raise more[0].error()
            findings += more
            read += [replace(part, pose=pose) for part in parts]
    for level, line in grouped(findings):
        LOGGER.log(
            logging.WARNING if level == "warning" else NOTE, "%s: %s", level, line
        )
    return read


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
        raise LogError(
            what,
            log_file(read[0].source),
            "cut the file at its gaps, and name one part",
        )
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
    path = path.resolve() if path.name in ("", "..") else path
    arm = settings.arm
    outputs = settings.outputs if angles else None
    reading = Reading(outputs=outputs, arm=arm, repair=repair)
    return check_parts(path, settings.log, arm.ranges, reading, progress)


def undriven_findings(logs: Sequence[Log], settings: FitSettings) -> list[LogFinding]:
    """Return that no log drives some compared joints, once for each log; of stage 2 an
    error if none is.

    Joints of stage 1 may move by themselves.
    """
    names = settings.arm.joint_names
    driven = np.any([log.driven for log in logs], axis=0)
    idle = [joint for joint in settings.outputs if len(logs) and not driven[joint - 1]]
    hopeless = settings.stage == "hyd" and len(idle) == len(settings.outputs)
    level, kind = ("error", "nothing to fit") if hopeless else ("warning", "not driven")
    subjects = [names[joint - 1] for joint in idle]
    return [log_finding(level, kind, log.source, *subjects) for log in logs if subjects]


def refuse_undriven(logs: Sequence[Log], settings: FitSettings) -> None:
    """Say which compared joints no log drives.

    Raises LogError: there is no other one, and stage 2 has nothing to fit.
    """
    findings = undriven_findings(logs, settings)
    for level, line in grouped(findings):
        if level == "error":
            raise findings[0].error()
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
        raise SettingsError(
            f"{arm!r} is no arm of a pair",
            "--arm",
            f"choose {', '.join(SIDES)} or both",
        )
    moving = (ALONE,) if arm is None else SIDES if arm == "both" else (arm,)
    columns = settings.log.angles_only() if angles else settings.log
    names = (
        open_table(Path(log), settings.log).names
        if isinstance(log, str | Path) and arm
        else ()
    )

    def read(columns: LogSettings) -> Log:
        layout = {"log": columns} | ({"outputs": ()} if angles else {})
        one = read_log(log, settings.changed(layout), repair=repair, angles=angles)
        if pose is None:
            return one
        return replace(
            one, angle=np.full_like(one.angle, np.nan), pose=settings.arm.pose(pose)
        )

    if any(name.startswith(tuple(f"{side}_" for side in SIDES)) for name in names):
        return {side: read(columns.of_arm(side)) for side in moving}
    return dict.fromkeys(moving, read(columns))


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
    return [*(one.log for one in fit.predictions), *fit.earlier]


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
            LOGGER.warning(
                "warning: %s; the logs of that fit will count as unseen", error
            )
    return tuple(seen.values())


def run_logs(folder: Path) -> list[Path]:
    """Return the logs that a run folder was fitted to."""
    if not is_file(folder / "run.json"):
        hint = "name one, as in hydroid suggest LOG.csv --fit RUN, or give a run folder as --fit"
        raise SettingsError("no log is given", hint=hint)
    from hydroid.run.folder import RunFolder

    logs = [*dict.fromkeys(map(log_file, RunFolder(folder).identity().get("logs", {})))]
    missing = [str(log) for log in logs if not log.exists()]  # a bag is a folder
    if missing or not logs:
        raise RunError(
            f"its log {', '.join(missing)} is not there", folder, "name the log"
        )
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
            LOGGER.warning(
                "warning: %s: is not what %s was fitted to", log.source, folder
            )
