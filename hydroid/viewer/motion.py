"""Arms in motion: simulated and measured angles, and the signals beside them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hydroid.arm.model import ALONE, Machine, load_machine
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.prediction import predict_log


@dataclass(frozen=True, eq=False)
class JointSignals:
    """What is drawn of one joint, T samples; what was not measured or not simulated is None."""

    name: str
    command: Array
    """[%], shape (T,)"""
    simulated: Array
    """angle [deg], shape (T,)"""
    measured: Array | None
    """angle [deg], shape (T,)"""
    pressure: Array | None
    """simulated, of chambers A and B [bar], shape (T, 2)"""
    measured_pressure: Array | None
    """[bar], shape (T, 2)"""


@dataclass(frozen=True, eq=False)
class Motion:
    """A machine under the commands of logs.

    Attributes:
        name: of the model and the log.
        machine: what moves.
        time: [s], shape (T,).
        simulated: angles of all joints of the machine [rad], shape (T, nq).
        measured: the same as logged; None where the logs hold no motion.
        signals: of the driven joints, the arms one after another.
    """

    name: str
    machine: Machine
    time: Array
    simulated: Array
    measured: Array | None
    signals: tuple[JointSignals, ...]

    def sample(self, time: float) -> int:
        """Return the number of the last sample at or before a time [s]."""
        return int(np.clip(np.searchsorted(self.time, time + 1e-9) - 1, 0, len(self.time) - 1))

    @property
    def error(self) -> float:
        """The rms difference of measured and simulated angles, as drawn [deg]; NaN: none was measured."""
        found = [s.measured - s.simulated for s in self.signals if s.measured is not None]
        return float(np.sqrt(np.mean(np.square(found)))) if found else np.nan


def simulated_motion(model: IdentifiedModel, logs: Mapping[str, Log]) -> Motion:
    """Simulate the commands of logs, by the name of the arm that they move (`Machine.sides`).

    Raises:
        SettingsError: a log commands nothing.
        RunError: the simulation diverged.
    """
    settings = model.settings
    for log in logs.values():
        if not log.driven.any():
            raise SettingsError("commands nothing", where=log.source, hint="name a log with commands")
    machine = load_machine(settings.arm, pair=ALONE not in logs)
    predicted: dict[str, Log] = {}
    signals: list[JointSignals] = []
    mirrored = len(logs) > len({id(log) for log in logs.values()})
    for side, log in logs.items():
        if mirrored and predicted:
            predicted[side] = next(iter(predicted.values()))
            continue
        predicted[side] = predict_log(model, log, all_pressures=True)
        label = "" if side == ALONE else "both " if mirrored else f"{side} "
        signals += _signals(label, settings.arm.joint_names, log, predicted[side])
    rest = settings.arm.pose(settings.start_pose)
    measured = None
    if any(_moves(log) for log in logs.values()):
        shown = {side: log.angle if _moves(log) else predicted[side].angle for side, log in logs.items()}
        measured = machine.joined(shown, rest)
    first = next(iter(logs.values()))
    return Motion(
        f"{model.name}, {first.source}",
        machine,
        first.time,
        machine.joined({side: log.angle for side, log in predicted.items()}, rest),
        measured,
        tuple(signals),
    )


def _moves(log: Log) -> bool:
    """Whether a log holds motion; a log of commands stands in its start pose."""
    return bool(np.nan_to_num(np.ptp(log.angle, axis=0)).any())


def _signals(label: str, names: tuple[str, ...], log: Log, predicted: Log) -> list[JointSignals]:
    found: list[JointSignals] = []
    for joint in np.flatnonzero(log.driven).tolist():
        measured = np.degrees(log.angle[:, joint]) if np.ptp(log.angle[:, joint]) > 0 else None
        simulated, logged = (
            None
            if one.pressure is None or np.isnan(one.pressure[:, joint]).all()
            else 1e-5 * one.pressure[:, joint]
            for one in (predicted, log)
        )
        angle = np.degrees(predicted.angle[:, joint])
        found.append(
            JointSignals(label + names[joint], log.command[:, joint], angle, measured, simulated, logged)
        )
    return found
