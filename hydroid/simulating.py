"""What the model does: commands in, angles, pressures and flows out."""

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arm.model import load_model
from hydroid.errors import RunError, SettingsError
from hydroid.files import write_atomic
from hydroid.identified import IdentifiedModel
from hydroid.log import Log, Warn, read_log, write_log
from hydroid.parameters import Array
from hydroid.problem.problem import make_simulation
from hydroid.problem.stage import Stage
from hydroid.report.actuator_report import actuator_page
from hydroid.report.joint_actuator import joint_actuator
from hydroid.report.page import write_page
from hydroid.settings.fit import FitSettings
from hydroid.simulation import HydraulicSimulation, Response

TRACED = (("pA", "bar"), ("pB", "bar"), ("qA", "Lmin"), ("qB", "Lmin"), ("spool", "mm"), ("force", "N"))
"""columns of a trace, a joint"""


def simulate_log(settings: FitSettings, log: Log, values: dict[str, Any], source: str) -> Log:
    """Return the log with the angles that the model gives for its commands, from its first pose.

    Joints that the simulation locks stay where they start; prescribed ones keep their logged motion. Stage 2
    gives the chamber pressures of driven joints too, where `log.pressure` maps columns for them.

    Raises:
        RunError: the simulation diverged.
    """
    passive = settings.simulation.other_joints == "passive"
    moving = [j + 1 for j in range(log.joints) if passive or log.driven[j]]
    angle = log.angle.copy()
    if settings.simulation.other_joints == "locked":
        angle[:] = log.start
    pressures: list[int] = []
    if settings.stage == "hyd":
        pressures = [j for j in range(log.joints) if log.driven[j] and settings.log.pressure_of(j + 1)]
    response = _response(settings, log, values, source, moving, pressures)
    angle[:, [j - 1 for j in moving]] = response.angle[0]
    pressure = None
    if response.pressure is not None:
        pressure = np.zeros((*angle.shape, 2))  # an idle cylinder's are not simulated
        pressure[:, pressures] = response.pressure[0]
    return replace(log, angle=angle, pressure=pressure)


def read_commands(path: Path, settings: FitSettings, pose: str | None, warn: Warn) -> Log:
    """Read a CSV of commands: to start in `pose`, or as logged, or in the settings' pose where unmeasured."""
    ranges = np.stack([settings.arm.lower, settings.arm.upper], axis=1)
    log, findings = read_log(path, settings.log, ranges, angles_required=False)
    for finding in findings:
        warn(finding)
    start = settings.arm.pose(pose or settings.start_pose)
    return replace(log, angle=np.where(log.measured & (pose is None), log.angle, start))


def simulate_file(
    settings: FitSettings,
    commands: Path,
    values: dict[str, Any],
    source: str,
    out: Path,
    warn: Warn,
    *,
    pose: str | None = None,
    noise_deg: float = 0.0,
    seed: int = 0,
    trace: Path | None = None,
) -> None:
    """Simulate a CSV of commands and write a log.

    Args:
        settings: the model's settings.
        commands: commands, and angles whose first sample is the start pose unless `pose` is given.
        values: parameters by name.
        source: where they came from, for messages.
        out: the log to write.
        warn: takes what is odd about the commands.
        pose: a pose of the arm to start from.
        noise_deg: standard deviation of Gaussian noise on every angle [deg].
        seed: of the noise.
        trace: a CSV of pressures, flows, spool and force of every actuator to write (stage 2).

    Raises:
        SettingsError: a trace is asked of stage 1, or the commands would be overwritten.
    """
    if out.resolve() == commands.resolve():
        raise SettingsError("would overwrite the commands", where=f"--out {out}", hint="name another file")
    if trace is not None and settings.stage != "hyd":
        raise SettingsError("stage mech has no pressures to trace", where=source, hint="set stage: hyd")
    log = read_commands(commands, settings, pose, warn)
    result = simulate_log(settings, log, values, source)
    noise = np.random.default_rng(seed).normal(0.0, np.deg2rad(noise_deg), result.angle.shape)
    write_log(out, replace(result, angle=result.angle + noise), settings.log)
    if trace is not None:
        write_atomic(trace, _trace(settings, log, values, source))


def _trace(settings: FitSettings, log: Log, values: dict[str, Any], source: str) -> str:
    """CSV of what the driven joints' actuators do, in bar, L/min, mm and N (N·m of a rotary one)."""
    stage = Stage(settings)
    theta = stage.parameters.vector(values, source)
    outputs = [int(j) for j in np.flatnonzero(log.driven)]
    simulation = make_simulation(load_model(settings.arm.model, settings.arm), log, outputs, settings)
    assert isinstance(simulation, HydraulicSimulation)
    seen = simulation.trace(stage.candidates(theta[None]))
    names, columns = ["time_s"], [log.time]
    for k, joint in enumerate(seen.joints):
        names += [f"{what}{joint}_{unit}" for what, unit in TRACED]
        columns += [
            *(seen.pressure[:, k].T / 1e5),
            *(seen.flow[:, k].T * 6e4),
            seen.spool[:, k] * 1e3,
            seen.force[:, k],
        ]
    text = io.StringIO()
    np.savetxt(
        text, np.stack(columns, axis=1), fmt="%.9g", delimiter=",", header=",".join(names), comments=""
    )
    return text.getvalue()


def respond(
    settings: FitSettings, log: Log, values: dict[str, Any], source: str, joints: Sequence[int]
) -> Array:
    """Simulate a log's commands with parameters by name; return the angles [rad] of `joints`, shape (T, K).

    Raises:
        SettingsError: a parameter that is missing or unknown.
        RunError: the simulation diverged.
    """
    return _response(settings, log, values, source, joints).angle[0]


def _response(
    settings: FitSettings,
    log: Log,
    values: dict[str, Any],
    source: str,
    joints: Sequence[int],
    pressures: Sequence[int] = (),
) -> Response:
    """The same with the pressures of some joints, 0-based, as a response of one candidate."""
    stage = Stage(settings)
    theta = stage.parameters.vector(values, source)
    outputs = [j - 1 for j in joints]
    simulation = make_simulation(
        load_model(settings.arm.model, settings.arm), log, outputs, settings, pressures
    )
    response = simulation.simulate(stage.candidates(theta[None]))
    if not response.feasible[0]:
        raise RunError("the simulation diverged with these parameters", where=source)
    return response


def plot_actuator(identified: IdentifiedModel, joint: int, out: Path) -> list[Path]:
    """Draw the curves of one actuator, joint 1-based, and return the files.

    Raises:
        SettingsError: no such joint, no hydraulics, or no force-stroke curve.
        RunError: `out` cannot be written.
    """
    settings = identified.settings
    if settings.stage != "hyd":
        hint = "use --config fit-hyd"
        raise SettingsError("stage mech has no actuators", where=identified.source, hint=hint)
    candidate = Stage(settings).candidates(identified.theta[None])
    actuator = joint_actuator(settings.arm, candidate, joint, identified.source)
    return write_page(actuator_page(actuator), out)
