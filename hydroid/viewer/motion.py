"""Arms in motion: simulated and measured angles, and the signals beside them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hydroid.arm.model import ALONE, Machine, load_machine
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.prediction import predict_log


class JointSignals(NamedTuple):
    """What is drawn of one joint: its name, its number from 0, and the logs that hold it."""

    name: str
    joint: int
    measured: Log
    simulated: Log

    @property
    def angles(self) -> dict[str, Array]:
        """Its measured angle, where that moved, and the simulated one [deg], shape (T,)."""
        logs = {"measured": self.measured, "simulated": self.simulated}
        angles = {kind: np.degrees(log.angle[:, self.joint]) for kind, log in logs.items()}
        return {kind: angle for kind, angle in angles.items() if kind == "simulated" or _moves(angle)}

    @property
    def pressures(self) -> dict[str, Array]:
        """Pressures of chambers A and B [bar], shape (T, 2), as far as they were measured and simulated."""
        logs = {"measured": self.measured.pressure, "simulated": self.simulated.pressure}
        bars = {
            kind: 1e-5 * pressure[:, self.joint] for kind, pressure in logs.items() if pressure is not None
        }
        return {kind: bar for kind, bar in bars.items() if not np.isnan(bar).all()}


@dataclass(frozen=True, eq=False)
class Motion:
    """A machine under the commands of logs.

    Attributes:
        machine: what moves.
        time: [s], shape (T,).
        simulated: angles of all joints of the machine [rad], shape (T, nq).
        measured: the same as logged; None where the logs hold no motion.
        signals: of the driven joints, the arms one after another.
    """

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
        angles = (signals.angles for signals in self.signals)
        errors = [angle["measured"] - angle["simulated"] for angle in angles if "measured" in angle]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan


def simulated_motion(model: IdentifiedModel, logs: Mapping[str, Log]) -> Motion:
    """Simulate the commands of logs, by the name of the arm that they move (`Machine.sides`).

    Raises:
        SettingsError: a log commands nothing.
        RunError: the simulation diverged.
    """
    arm, first = model.settings.arm, next(iter(logs.values()))
    machine = load_machine(arm, pair=ALONE not in logs)
    mirrored = len(logs) > 1 and all(log is first for log in logs.values())
    predicted: dict[str, Log] = {}
    signals: list[JointSignals] = []
    for side, log in {"both": first}.items() if mirrored else logs.items():
        if not log.driven.any():
            raise SettingsError("commands nothing", where=log.source, hint="name a log with commands")
        predicted[side] = predict_log(model, log, all_pressures=True)
        for joint in np.flatnonzero(log.driven).tolist():
            name = arm.joint_names[joint] if side == ALONE else f"{side} {arm.joint_names[joint]}"
            signals.append(JointSignals(name, joint, log, predicted[side]))
    if mirrored:
        predicted = dict.fromkeys(logs, predicted["both"])
    rest, simulated = arm.pose(model.settings.start_pose), {s: log.angle for s, log in predicted.items()}
    shown = simulated | {side: log.angle for side, log in logs.items() if _moves(log.angle)}
    measured = machine.joined(shown, rest) if any(_moves(log.angle) for log in logs.values()) else None
    return Motion(machine, first.time, machine.joined(simulated, rest), measured, tuple(signals))


def _moves(angle: Array) -> bool:
    """Whether angles, shape (T, ...), are of a motion; a log of commands stands in its start pose."""
    return bool(np.nan_to_num(np.ptp(angle, axis=0)).any())
