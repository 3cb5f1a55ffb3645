"""`hydroid simulate` and `hydroid view`: what a model predicts as a log, and as an arm in motion."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.arrays import record
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
    """Simulate commands with an estimate and write the log: a prediction, or synthetic data to test a fit.

    Of two arms neither feels the other: the carrier stands still, and they share no pump.

    Example: hydroid simulate COMMANDS.csv --fit runs/hyd --out sim.csv

        log = hydroid.simulate("commands.csv", fit="runs/a", out="predicted.csv").log

    Args:
        commands (COMMANDS.csv): A log of commands. Its angles before the first command give the start pose.
        out (LOG.csv): The log to write [default of the command line: runs/simulated.csv].
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
        noise = np.random.default_rng(seed + number).normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
        source = str(out or f"simulated {Path(log.source).name}")  # no longer the log of the commands
        logs[name] = replace(predicted, angle=predicted.angle + noise, source=source)
    columns = model.settings.log
    if out is not None:
        pairs = [(log, columns.of_arm(n) if arm else columns) for n, log in logs.items()]
        write_logs(Path(out), pairs, arm=model.settings.arm)
    first, file = next(iter(logs.values())), out and str(out)
    content = {"out": file, "samples": len(first.time), "duration_s": first.duration}
    return Simulated([file] if file else [], content, logs)


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
    """Show the moving arm in MuJoCo's viewer, in real time, beside the ghost of the measured one.

    Without a log, the sliders in the panel "Control" on the right set the commands in %. Backspace restarts.
    With -o FILE it writes a film or a picture instead. This needs no display, but OpenGL by EGL or OSMesa. In
    a program of your own, set MUJOCO_GL to egl or osmesa before anything is imported.

    Example: hydroid view runs/hyd -o arm.mp4

        hydroid.view("a.csv", out="a.png", fit="runs/a", span="2:")

    Args:
        source (RUN|LOG): A run folder, whose first log drives the arm; or a log, with --fit.
        out (FILE): Write a film (.mp4, .gif) or the beginning of the span (.png) instead of opening a window.
        fit (RUN|YAML): An estimate, as a run folder or a YAML file [default: the arm's file and `hydraulics`
            in the settings].
        span (FROM:TO): Part of the log to film [s], such as 10:20 [default: all].
        collisions: Instead, find which bodies meet along the log's joint angles: of the arm, its base and the
            floor; with --arm also of the carrier and the other arm. The exit status is 1 if bodies meet.
        config (YAML): Settings [default: config.yaml in the folder of the estimate, or else fit-hyd].

    Raises:
        RunError: no window, no OpenGL, no package that writes films, or the simulation diverged.
        SettingsError: another kind of file, no such arm or pose, a span without time.
    """
    if out is not None:
        choose_platform()  # before anything here imports MuJoCo
    log = source
    if isinstance(source, str | Path) and is_file(Path(source) / "run.json"):
        if fit is not None:
            raise SettingsError("is a run itself", source, f"name a log, or leave out --fit {fit}")
        fit, log = source, run_logs(Path(source))[0]
    wanting = {"--collisions": collisions, "--arm": arm, "--out": out}
    if log is None and (where := next((name for name, given in wanting.items() if given), None)):
        raise SettingsError("needs a log or a run", where, "name the log")
    if collisions:
        known = open_model(fit, config, set, nominal=True).settings if fit else None
        settings = known or load_settings(config or "fit-hyd", set)
        return _collisions(read_arms(log or "", settings, arm, angles=True, repair=repair), settings)
    model = open_model(fit, config, set, nominal=True)
    logs = None if log is None else read_arms(log, model.settings, arm, pose=pose, repair=repair)
    from hydroid.viewer.motion import simulated_motion

    if out is not None:
        from hydroid.viewer.film import KINDS, render_motion

        kind, part = Path(out).suffix.lower(), _span(span)
        if kind not in KINDS:
            raise SettingsError("is no film or picture", out, f"end it in {', '.join(KINDS)}")
        with Progress() as progress:
            film = render_motion(simulated_motion(model, logs or {}), kind, part, progress)
        write_atomic(Path(out), film)
        return Result([str(out)], {"out": str(out)}, None)
    from hydroid.plant import Plant
    from hydroid.viewer.film import show
    from hydroid.viewer.motion import Replay, Sliders

    with suppress(KeyboardInterrupt):  # as good as closing the window
        every = range(1, 1 + len(model.settings.arm.joints))
        shown = Sliders(Plant(model, joints=every), pose) if logs is None else None
        show(shown or Replay(simulated_motion(model, logs or {})))
    return Result([], {}, None)


def _collisions(logs: "dict[str, Log]", settings: "FitSettings") -> "Result[Clearance]":
    from hydroid.arm.model import ALONE, load_machine

    machine = load_machine(settings.arm, pair=ALONE not in logs)
    rest = settings.arm.pose(settings.start_pose)
    angle = machine.joined({side: log.posed for side, log in logs.items()}, rest)
    result = machine.checker.clearance(next(iter(logs.values())).time, angle)
    nearest = result.distance.argmin()
    content = {
        "free": not result.meetings,
        "clearance_m": result.distance[nearest],
        "clearance_at_s": result.time[nearest],
        "clearance_between": [*result.nearest[nearest]],
        "collisions": [*map(vars, result.meetings)],
        "checked_pairs": result.checked,
        "excluded": [[*pair] for pair in result.excluded],
    }
    lines = [
        f"{' and '.join(m.bodies)} meet from {m.from_s:.2f} to {m.to_s:.2f} s, {1e3 * m.depth_m:.1f} mm deep"
        for m in result.meetings
    ]
    pair, size = " and ".join(result.nearest[nearest]), f"{1e3 * result.distance[nearest]:.1f} mm"
    none = f"no bodies meet; the nearest are {pair}: {size} at {result.time[nearest]:.2f} s"
    return Result(lines or [none], content, result, exit_status=1 if lines else 0)


def _span(text: str) -> tuple[float, float]:
    begin, _, end = text.partition(":")
    try:
        return float(begin or 0.0), float(end or "inf")
    except ValueError:
        raise SettingsError(f"{text!r} is no span", "--span", "write FROM:TO in seconds") from None
