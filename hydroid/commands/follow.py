"""`hydroid follow`: commands that lead the arm along angles over time."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.console import Result, written
from hydroid.commands.inputs import (
    ModelSource,
    SettingChanges,
    Source,
    command,
    open_model,
    refuse_overwriting,
    setting_changes,
)
from hydroid.commands.logs import read_arms
from hydroid.errors import SettingsError
from hydroid.files import is_file
from hydroid.findings import OF_ENDING, Finding
from hydroid.joint_verdict import JointVerdict, Verdict
from hydroid.log import Log, open_table, write_log
from hydroid.log.conditions import at_references
from hydroid.words import listed, plain, two_digits

if TYPE_CHECKING:
    from hydroid.arrays import Array
    from hydroid.identified_model import IdentifiedModel
    from hydroid.reporting.page import Table
    from hydroid.settings.arm import Arm
    from hydroid.settings.fit import FitSettings
    from hydroid.use.follow import Followed
    from hydroid.use.tip_path import TipKinematics


@command
def follow(
    trajectory: "Source | Log",
    *,
    fit: "ModelSource",
    out: "Source | None" = None,
    payload: float = 0.0,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[Followed]":
    """Find the commands that move the joints along given angles, or the tip along a
    given path.

    The commands are a feed-forward: play them without feedback. They take dead band, valve
    curve, load, pump, delay and lags into account. Where a joint cannot be as fast as
    asked, hydroid says so and takes the nearest speed. It also predicts the error of
    each joint, and the band that holds this error with 95 % probability, and writes a
    page with the arm in motion.

    Example: hydroid follow TRAJECTORY.csv --fit runs/hyd --out commands.csv

        followed = hydroid.follow("path.csv", fit="runs/a", out="commands.csv").result
        print(followed.rms(2), followed.missed)

    Args:
        trajectory (TRAJECTORY.csv): Joint angles over time, in the columns and units of
            the fit's logs. Or the tip's position over time: columns time_s, x_m, y_m and
            z_m, or dx_m, dy_m and dz_m from where the tip starts. The tip is the
            point (site) `payload` of the arm's file; without it, the end of the last
            link. In a file of joint angles, joints without a column stand still;
            joints that take no commands always do. They stand at the first angles of
            the fit's first log, or in the pose of --set start_pose=NAME.
        out (LOG.csv): The commands and the angles asked for, in the columns and units
            of the fit's logs; the page has the same name [default:
            runs/follow/commands.csv; in Python nothing is written].
        payload (0 or more): Mass at the tip [kg].
        repair: Fill gaps in the joint angles of the trajectory that are not longer than the
            setting log.repair_s (0.1 s). The file is not changed.

    Raises:
        LogError: the trajectory cannot be used, or moves a joint that takes no
            commands.
        SettingsError: a fit of stage 1, which has no valves, or `out` would overwrite
            the trajectory.
        RunError: the simulation diverged, or a file cannot be written.
    """
    refuse_overwriting(trajectory, out)
    model = open_model(fit, overrides=set)
    if model.settings.stage != "hyd":
        raise SettingsError(
            "a fit of stage 1 has no valves", model.source, "name a fit of stage 2"
        )
    standing = _standing(model, given=set)
    path, tip = _tip_path(trajectory, model, standing)
    if path is None:
        settings = _without_absent_joints(trajectory, model.settings)
        paths = read_arms(trajectory, settings, None, angles=True, repair=repair)
        (path,) = paths.values()
        if not isinstance(trajectory, Log):
            path = replace(path, pose=standing)
    from hydroid.reporting.follow_page import follow_page, missed_lines, tracking_table
    from hydroid.use.follow import follow as find_commands

    followed = find_commands(model, path, payload=payload)
    arm = model.settings.arm
    name = "commands" if out is None else Path(out).stem
    verdicts = _verdicts(model)
    doubts = _doubts(followed, model, verdicts)
    said = [
        *map(str, doubts),
        *missed_lines(followed, arm),
        *_path_lines(followed, tip, verdicts),
        *filter(None, [at_references(model.settings.log)]),
    ]
    page = follow_page(name, followed, arm, said)
    lines: list[Table | str] = [tracking_table(followed, arm), *said]
    if out is not None:
        write_log(Path(out), followed.recording, model.settings.log, arm=arm)
        lines += [str(out), *written(page, Path(out).parent)]
    content = {
        "out": out and str(out),
        "lead_s": followed.lead_s,
        "tip": tip and tip.tip.what,
        "tip_away_mm": tip and _away(tip, followed),
        "findings": [asdict(doubt) for doubt in doubts],
        "joints": [_errors(followed, joint, arm) for joint in followed.joints],
        "missed": [
            {**vars(missed), "joint": arm.joint_names[missed.joint]}
            for missed in followed.missed
        ],
    }
    return Result(lines, content, followed, page)


def _path_lines(
    followed: "Followed",
    tip: "TipKinematics | None",
    verdicts: Mapping[int, JointVerdict],
) -> list[str]:
    """Return what is said of the tip's path, of the errors to expect, and of when the
    path begins."""
    lines = list[str]()
    if tip is not None:
        from hydroid.use.tip_path import spelt

        away = _away(tip, followed)
        start = spelt(tip.place(followed.log.angle[0]))
        lines.append(
            f"The tip is {tip.tip.what}. It starts at {start}. By the model it stays "
            f"within {away:.3g} mm of where it should be at each time."
        )
    lines += _unseen_lines(followed, verdicts, tip)
    if followed.lead_s:
        lines.append(
            f"The path begins {plain(followed.lead_s)} s into the file: "
            "delay and lags need commands that early."
        )
    return lines


def _verdicts(model: "IdentifiedModel") -> dict[int, JointVerdict]:
    """Return what a fit is worth for each joint (number, from 1) that it compared, by
    all unseen logs that its run holds."""
    from hydroid.run.record import load_record, run_of

    run = run_of(model)
    verdicts = model.summarise().verdict if run is None else load_record(run).verdict
    return {verdict.joint: verdict for verdict in verdicts}


def _moved(followed: "Followed") -> list[int]:
    """Return the joints that the path moves, numbered from 1."""
    import numpy as np

    return [j for j in followed.joints if np.ptp(followed.log.angle_of(j)) > 0]


def _doubts(
    followed: "Followed", model: "IdentifiedModel", verdicts: Mapping[int, JointVerdict]
) -> list[Finding]:
    """Return why the machine may miss the path by more than the model says: a fit that
    has not converged, and joints that no unseen log shows it to predict."""
    doubts = [one for one in model.summarise().findings if one.kind in OF_ENDING]
    unproven = dict[str, str]()
    for joint in _moved(followed):
        verdict = verdicts.get(joint)
        if verdict is None or verdict.verdict is not Verdict.PREDICTS:
            name = model.settings.arm.name_of(joint)
            unproven[name] = verdict.text if verdict else str(Verdict.UNTESTED)
    if unproven:
        kind = "path not proven"
        doubts.append(Finding(kind, "warning", tuple(unproven), details=unproven))
    return doubts


def _unseen_lines(
    followed: "Followed",
    verdicts: Mapping[int, JointVerdict],
    tip: "TipKinematics | None",
) -> list[str]:
    """Return by what the fit erred on unseen logs, over about as long as the path
    lasts, and how far that leads the tip away; nothing without such logs."""
    import numpy as np

    moved = _moved(followed)
    tested = [verdicts[joint] for joint in moved if joint in verdicts]
    tested = [verdict for verdict in tested if verdict.unseen_deg is not None]
    if not tested:
        return []
    over, errors = _unseen_errors(tested, followed)
    by_joint = list[str]()
    for verdict, error in zip(tested, errors, strict=True):
        shown = verdict.shown
        size = f"{two_digits(shown.of_degrees(error))} {shown.unit}"
        by_joint.append(f"{size} ({verdict.name})")
    line = f"On unseen logs the rms error {over} was {listed(by_joint)}"
    if tip is not None and len(tested) == len(moved):
        joints = [verdict.joint for verdict in tested]
        off = _tip_off(
            tip, followed, dict(zip(joints, np.radians(errors), strict=True))
        )
        line += f", which is up to {two_digits(off)} mm at the tip"
    return [f"{line}."]


def _unseen_errors(
    verdicts: Sequence[JointVerdict], followed: "Followed"
) -> tuple[str, list[float]]:
    """Return rms errors [deg] of joints that unseen logs test, and in words when: after
    the first of the prediction times that is no shorter than the path.

    Over whole logs where no time is that long, or one of the joints has no error there.
    """
    from hydroid.fitting.validation import HORIZONS
    from hydroid.fitting.verdict import THE_FIT

    log = followed.log
    seconds = log.time[-1] - log.time[0] - followed.lead_s
    for i, horizon in enumerate(HORIZONS):
        # a sample beside it is none
        if horizon < seconds - log.period:
            continue
        ahead = [v.horizons_deg[THE_FIT][i] for v in verdicts if v.horizons_deg]
        errors = [error for error in ahead if error is not None]
        if len(errors) == len(verdicts):
            return f"after {horizon:g} s", errors
    errors = [v.unseen_deg for v in verdicts if v.unseen_deg is not None]
    return "over whole logs", errors


def _standing(model: "IdentifiedModel", given: "SettingChanges") -> "Array":
    """Return where joints stand that a path does not move [rad], shape (J,).

    That is where the first log of the fit begins; of a model that is no fit, or where
    the user gives a `start_pose`, it is the start pose of the settings.
    """
    import numpy as np

    from hydroid.run.record import record_of

    settings = model.settings
    pose = settings.arm.pose(settings.start_pose)
    fit = record_of(model)
    if fit is None or "start_pose" in setting_changes(given):
        return pose
    start = fit.fitted[0].log.start
    return np.where(np.isnan(start), pose, start)


def _tip_path(
    trajectory: "Source | Log", model: "IdentifiedModel", standing: "Array"
) -> "tuple[Log | None, TipKinematics | None]":
    """Return the joint angles along a file's path of the tip, and its kinematics; None:
    it holds no such path."""
    if isinstance(trajectory, Log) or not is_file(trajectory):
        return None, None
    from hydroid.plant import Plant
    from hydroid.use.tip_path import TipKinematics, holds_tip, tip_path

    settings = model.settings
    table = open_table(Path(trajectory), settings.log)
    if not holds_tip(table):
        return None, None
    tip = TipKinematics(settings.arm, Plant(model).joints)
    return tip_path(table, settings.log, tip, standing), tip


def _away(tip: "TipKinematics", followed: "Followed") -> float:
    """Return how far the tip is from where it should be by then, at most, as the model
    predicts [mm]."""
    import numpy as np

    farthest = 0.0
    for wanted, predicted in zip(followed.log.angle, followed.angle, strict=True):
        away = tip.place(predicted) - tip.place(wanted)
        farthest = max(farthest, float(np.linalg.norm(away)))
    return 1e3 * farthest


def _tip_off(
    tip: "TipKinematics", followed: "Followed", errors: Mapping[int, float]
) -> float:
    """Return how far errors of joints [rad, m], independent of each other, lead the tip
    away where they do so the most [mm]."""
    import math

    farthest = 0.0
    for angle in followed.log.angle:
        place = tip.place(angle)
        ways = list[float]()
        for joint, error in errors.items():
            off = angle.copy()
            off[joint - 1] += error
            ways += (tip.place(off) - place).tolist()
        farthest = max(farthest, math.hypot(*ways))
    return 1e3 * farthest


def _without_absent_joints(
    trajectory: "Source | Log", settings: "FitSettings"
) -> "FitSettings":
    """Return the settings without the joints that a file has no angle of.

    A file with a column of another name may have misspelt one: there every joint is
    still asked for.
    """
    if isinstance(trajectory, Log) or not is_file(trajectory):
        return settings
    columns = settings.log
    names = {*open_table(Path(trajectory), columns).names}
    expected = {columns.time.column}
    absent = list[int]()
    for joint in range(1, 1 + len(settings.arm.joints)):
        angle = columns.columns("angle", joint)
        command = columns.columns("command", joint)
        if angle and names.isdisjoint(angle.column):
            absent.append(joint)
        for mapped in filter(None, (angle, command)):
            expected.update(mapped.column)
    if names - expected or len(absent) == len(settings.arm.joints):
        return settings
    joints = dict(columns.joints) | dict.fromkeys(absent)
    return settings.changed({"log": columns.changed({"joints": joints})})


def _errors(followed: "Followed", joint: int, arm: "Arm") -> dict[str, object]:
    """Return the predicted errors of a joint (number, from 1), with and without its
    band: in deg, or in mm of a joint that slides, which the keys say."""
    import math

    shown = arm.joint(joint).shown
    error, wide = followed.rms(joint)
    banded = shown.factor * wide if math.isfinite(wide) else None
    return {
        "joint": joint,
        "name": arm.name_of(joint),
        f"rms_{shown.unit}": shown.factor * error,
        f"rms_with_band_{shown.unit}": banded,
    }
