"""`hydroid simulate` and `hydroid view`: what a model predicts as a log,
and as an arm in motion."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.arrays import Limits, record
from hydroid.commands.console import Result
from hydroid.commands.inputs import (
    ConfigSource,
    ModelSource,
    SettingChanges,
    Source,
    command,
    load_settings,
    open_model,
    refuse_overwriting,
)
from hydroid.commands.logs import read_arms, run_logs
from hydroid.commands.progress import Progress
from hydroid.errors import SettingsError
from hydroid.files import is_file, write_atomic
from hydroid.log import Log, write_logs
from hydroid.viewer import choose_platform

if TYPE_CHECKING:
    from hydroid.arm.model import Clearance
    from hydroid.identified_model import IdentifiedModel
    from hydroid.settings.fit import FitSettings


@record
class Simulated(Result[dict[str, Log]]):
    """Simulated logs by the arm's name: right, left, or alone."""

    @property
    def log(self) -> Log:
        """The log of the first arm."""
        return next(iter(self.result.values()))


@command
def simulate(
    commands: "Source | Log",
    *,
    fit: "ModelSource",
    out: "Source | None" = None,
    pose: str | None = None,
    noise_deg: float = 0.0,
    seed: int = 0,
    arm: str | None = None,
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> Simulated:
    """Simulate commands with an estimate and write the log: a prediction,
    or synthetic data to test a fit.

    A pair of arms is simulated as two separate arms: they share no pump, and their
    carrier stands still.

    Example: hydroid simulate COMMANDS.csv --fit runs/hyd --out sim.csv

        log = hydroid.simulate("commands.csv", fit="runs/a", out="predicted.csv").log

    Args:
        config (YAML): Settings; not needed if --fit is a run folder, which has its own.
        commands (COMMANDS.csv): A log of commands. Its angles before the first command
            give the start pose.
        out (LOG.csv): The log to write [default: runs/simulated.csv; in Python
            nothing is written].
        noise_deg (0 to 90): Standard deviation of Gaussian noise on the angles [deg].

    Raises:
        SettingsError: `out` would overwrite the commands.
        LogError: the commands cannot be used.
        RunError: the simulation diverged, or a file cannot be written.
    """
    refuse_overwriting(commands, out)
    model = open_model(fit, config, set)
    read = read_arms(commands, model.settings, arm, pose=pose, repair=repair)
    from hydroid.prediction import predict_log

    logs: dict[str, Log] = {}
    for number, (name, log) in enumerate(read.items()):
        predicted = predict_log(model, log)
        generator = np.random.default_rng(seed + number)
        noise = generator.normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
        # no longer the log of the commands
        source = str(out or f"simulated {Path(log.source).name}")
        logs[name] = replace(predicted, angle=predicted.angle + noise, source=source)
    first = next(iter(logs.values()))
    content = {
        "out": out and str(out),
        "samples": len(first.time),
        "duration_s": first.duration,
    }
    if out is None:
        return Simulated([], content, logs)
    columns = model.settings.log
    with_columns = [
        (log, columns.of_arm(name) if arm else columns) for name, log in logs.items()
    ]
    write_logs(Path(out), with_columns, arm=model.settings.arm)
    return Simulated([str(out)], content, logs)


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
    config: "ConfigSource | None" = None,
    set: "SettingChanges" = None,
    repair: bool = False,
) -> "Result[Clearance | None]":
    """Show the simulated arm in motion in MuJoCo's viewer, in real time, and a pale copy
    of it that moves as the measured arm did.

    Without a log, the sliders in the panel "Control" on the right set the commands in
    %. Backspace restarts. With -o FILE it writes a film or a picture instead. That
    works without a display, but needs OpenGL (EGL or OSMesa). In your own program, set
    MUJOCO_GL to egl or osmesa before you import anything.

    Example: hydroid view runs/hyd -o arm.mp4

        hydroid.view("a.csv", out="a.png", fit="runs/a", span="2:")

    Args:
        source (RUN|LOG): A run folder, whose first log drives the arm; or a log, with
            --fit.
        out (FILE): Write a film (.mp4, .gif), or a picture (.png) of its first moment,
            instead of opening a window.
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the values
            in the arm's file and under `hydraulics` in the settings].
        span (FROM:TO): Part of the log to film [s], such as 10:20 [default: all].
        collisions: Instead of showing the arm, find where it touches itself, its base or
            the floor during the log. With --arm also where
            it touches the other arm, or the body that carries both.
            The exit status is 1 if anything touches.
        config (YAML): Settings [default: config.yaml in the folder of the estimate,
            or else fit-hyd].

    Raises:
        RunError: no window, no OpenGL, no package that writes films, or the simulation
            diverged.
        SettingsError: another kind of file, no such arm or pose, a span without time.
    """
    if out is not None:
        # before anything here imports MuJoCo
        choose_platform()
    log = source
    if isinstance(source, str | Path) and is_file(Path(source) / "run.json"):
        if fit is not None:
            raise SettingsError(
                "is a run itself", source, f"name a log, or leave out --fit {fit}"
            )
        # a run names both its fit and its logs
        fit = source
        log = run_logs(Path(source))[0]
    if log is None:
        # only the sliders need no log
        for option, given in {
            "--collisions": collisions,
            "--arm": arm,
            "--out": out,
        }.items():
            if given:
                raise SettingsError("needs a log or a run", option, "name the log")
        _show(open_model(fit, config, set, nominal=True), None, pose)
        return Result([], {}, None)
    if collisions:
        if fit:
            settings = open_model(fit, config, set, nominal=True).settings
        else:
            settings = load_settings(config or "fit-hyd", set)
        logs = read_arms(log, settings, arm, angles=True, repair=repair)
        return _collisions(logs, settings)
    model = open_model(fit, config, set, nominal=True)
    logs = read_arms(log, model.settings, arm, pose=pose, repair=repair)
    if out is None:
        _show(model, logs, pose)
        return Result([], {}, None)
    _write_film(model, logs, Path(out), _span(span))
    return Result([str(out)], {"out": str(out)}, None)


def _write_film(
    model: "IdentifiedModel",
    logs: "dict[str, Log]",
    out: Path,
    span: Limits,
) -> None:
    """Write a film or a picture of simulated logs, by its ending, of a span [s]."""
    from hydroid.viewer.film import KINDS, render_motion
    from hydroid.viewer.motion import simulated_motion

    kind = out.suffix.lower()
    if kind not in KINDS:
        raise SettingsError(
            "is no film or picture", out, f"end it in {', '.join(KINDS)}"
        )
    with Progress() as progress:
        film = render_motion(simulated_motion(model, logs), kind, span, progress)
    write_atomic(out, film)


def _show(
    model: "IdentifiedModel", logs: "dict[str, Log] | None", pose: str | None
) -> None:
    """Show simulated logs in a window; without logs the arm, moved by sliders."""
    from hydroid.plant import Plant
    from hydroid.viewer.film import show
    from hydroid.viewer.motion import Replay, Sliders, simulated_motion

    with suppress(KeyboardInterrupt):  # as good as closing the window
        if logs is None:
            every = range(1, 1 + len(model.settings.arm.joints))
            show(Sliders(Plant(model, joints=every), pose))
        else:
            show(Replay(simulated_motion(model, logs)))


def _collisions(logs: "dict[str, Log]", settings: "FitSettings") -> "Result[Clearance]":
    from hydroid.arm.model import ALONE, load_machine

    machine = load_machine(settings.arm, pair=ALONE not in logs)
    rest = settings.arm.pose(settings.start_pose)
    angle = machine.joined({side: log.posed for side, log in logs.items()}, rest)
    first = next(iter(logs.values()))
    result = machine.checker.clearance(first.time, angle)
    nearest = result.distance.argmin()
    distance = result.distance[nearest]
    moment = result.time[nearest]
    bodies = result.nearest[nearest]
    content = {
        "free": not result.meetings,
        "clearance_m": distance,
        "clearance_at_s": moment,
        "clearance_between": [*bodies],
        "collisions": [*map(vars, result.meetings)],
        "checked_pairs": result.checked,
        "excluded": [[*pair] for pair in result.excluded],
    }
    lines = list[str]()
    for meeting in result.meetings:
        when = f"from {meeting.from_s:.2f} to {meeting.to_s:.2f} s"
        depth = f"{1e3 * meeting.depth_m:.1f} mm deep"
        lines.append(f"{' and '.join(meeting.bodies)} meet {when}, {depth}")
    if lines:
        return Result(lines, content, result, exit_status=1)
    pair = " and ".join(bodies)
    line = f"no bodies meet; the nearest are {pair}: {1e3 * distance:.1f} mm at {moment:.2f} s"
    return Result([line], content, result)


def _span(text: str) -> Limits:
    """Return the ends of a span [s] such as 10:20, 10: or :20."""
    begin, _, end = text.partition(":")
    try:
        return float(begin or 0.0), float(end or "inf")
    except ValueError:
        raise SettingsError(
            f"{text!r} is not a span", "--span", "write FROM:TO in seconds"
        ) from None
