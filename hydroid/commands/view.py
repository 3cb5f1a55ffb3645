"""`hydroid view`: the arm in motion, in a window or a film; its collisions; the curves of its actuators."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from hydroid.commands.inputs import (
    ConfigSource,
    ModelSource,
    SettingChanges,
    Source,
    load_settings,
    open_model,
    require_hydraulics,
)
from hydroid.commands.logs import read_arms, run_logs
from hydroid.commands.options import command
from hydroid.commands.progress import Progress
from hydroid.commands.result import Result, written
from hydroid.errors import SettingsError
from hydroid.files import is_file, write_atomic
from hydroid.identified_model import IdentifiedModel
from hydroid.viewer.opengl import choose_platform

if TYPE_CHECKING:
    from hydroid.arm.collision import Clearance
    from hydroid.log import Log
    from hydroid.settings.fit import FitSettings


@command
def view(
    source: "Source | Log | None" = None,
    *,
    out: "Source | None" = None,
    fit: "ModelSource | None" = None,
    span: str = "",
    pose: str | None = None,
    arm: str | None = None,
    collisions: bool = False,
    actuator: int | None = None,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[Clearance | None]":
    """Show the moving arm in MuJoCo's viewer, in real time, beside the ghost of the measured one.

    Without a log, the sliders in the panel "Control" on the right set the commands in %. Backspace restarts.
    With -o FILE it writes a film instead, with commands, angles and pressures. This needs no display, but
    OpenGL by EGL or OSMesa. In a program of your own, set MUJOCO_GL to egl or osmesa before anything is
    imported.

    Example: hydroid view runs/hyd -o arm.mp4

        hydroid.view("a.csv", out="a.png", fit="runs/a", span="0:2")

    Args:
        source (RUN|LOG): A run folder, whose first log drives the arm; or a log, with --fit.
        out (FILE|DIR): Write a film (.mp4, .gif) or several moments (.png) instead of opening a window; with
            --collisions or --actuator, folder for their tables or figures.
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the arm's file and `hydraulics`
            in the settings].
        span (FROM:TO): Part of the log to film [s], such as 10:20 [default: all].
        collisions: Instead, find which bodies meet along the log's joint angles: of the arm, its base and the
            floor; with --arm also of the carrier and the other arm. The exit status is 1 if bodies meet.
        actuator (JOINT): Instead, draw the curves of this joint's actuator (1 azimuth, 2 shoulder, ...):
            calibration, current, force, spool, opening, flow and torque, with the 95 % bands of a fit.
        config (YAML): Settings [default: config.yaml in the folder of the estimate, or else fit-hyd].

    Raises:
        RunError: no window, no OpenGL, no package that writes films, or the simulation diverged.
        SettingsError: another kind of file, no such arm, pose or joint, a span without time.
    """
    log = source
    if isinstance(source, str | Path) and is_file(Path(source) / "run.json"):
        if fit is not None:
            hint = f"name a log, or leave out --fit {fit}"
            raise SettingsError("is a run itself", where=str(source), hint=hint)
        fit, log = source, None if actuator else run_logs(source)[0]
    wanting = {"--collisions": collisions, "--arm": arm, "--out": out and not actuator}
    if log is None and (where := next((name for name, given in wanting.items() if given), None)):
        raise SettingsError("needs a log or a run", where=where, hint="name the log")
    if collisions:
        known = open_model(fit, config, set, nominal=True).settings if fit else None
        settings = known or load_settings(config or "fit-hyd", set)
        return _collisions(read_arms(log or "", settings, arm, angles=True, repair=repair), settings, out)
    if out is not None:
        choose_platform()
    model = open_model(fit, config, set, nominal=True)
    if actuator is not None:
        return _actuator(model, actuator, Path(out or "runs/actuator"))
    logs = None if log is None else read_arms(log, model.settings, arm, pose=pose, repair=repair)
    from hydroid.viewer.motion import simulated_motion

    if out is not None:
        from hydroid.viewer.film import check_kind, render_motion

        kind, part = check_kind(Path(out)), _span(span)
        with Progress() as progress:
            film = render_motion(simulated_motion(model, logs or {}), kind, part, progress)
        write_atomic(Path(out), film)
        return Result([str(out)], {"out": str(out)}, None)
    from hydroid.viewer.playback import Replay, make_sliders
    from hydroid.viewer.window import show

    with suppress(KeyboardInterrupt):  # as good as closing the window
        show(make_sliders(model, pose) if logs is None else Replay(simulated_motion(model, logs)))
    return Result([], {}, None)


def _collisions(logs: "dict[str, Log]", settings: "FitSettings", out: "Source | None") -> "Result[Clearance]":
    """Find which bodies meet along a trajectory, when and how deep, and how near they come otherwise."""
    from hydroid.arm.model import ALONE, load_machine
    from hydroid.reporting.collision_report import collision_table, summary

    machine = load_machine(settings.arm, pair=ALONE not in logs)
    rest = settings.arm.pose(settings.start_pose)
    angle = machine.joined({side: log.angle for side, log in logs.items()}, rest)
    result = machine.checker.clearance(next(iter(logs.values())).time, angle)
    tables, nearest = {"collisions": collision_table(result)} if result.meetings else {}, result.smallest
    keys = ("from_s", "to_s", "depth_m", "deepest_at_s")
    meetings = [
        {"bodies": [m.first, m.second]} | dict(zip(keys, (m.begins, m.ends, m.depth, m.deepest), strict=True))
        for m in result.meetings
    ]
    content = {
        "free": not meetings,
        "clearance_m": float(result.distance[nearest]),
        "clearance_at_s": float(result.time[nearest]),
        "clearance_between": [*result.nearest[nearest]],
        "collisions": meetings,
        "checked_pairs": result.checked,
        "excluded": [[*pair] for pair in result.excluded],
    }
    lines = [*tables.values(), summary(result), *(written(tables, out) if tables else [])]
    return Result(lines, content, result, exit_status=1 if meetings else 0)


def _actuator(model: IdentifiedModel, joint: int, out: Path) -> Result[None]:
    require_hydraulics(model)
    from hydroid.reporting.actuator_report import actuator_page, joint_actuator
    from hydroid.reporting.page_file import write_figures, write_page

    page = actuator_page(joint_actuator(model, joint))
    files = [str(file) for file in (*write_figures(page, out / "figures"), *write_page(page, out))]
    return Result(files[-1:], {"files": files}, None, page)


def _span(text: str) -> tuple[float, float]:
    begin, _, end = text.partition(":")
    try:
        return float(begin or 0.0), float(end or "inf")
    except ValueError:
        raise SettingsError(f"{text!r} is no span", where="--span", hint="write FROM:TO in seconds") from None
