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
    """What is drawn of one joint, T samples.

    Attributes:
        name: of the joint, and of its arm where there are two.
        command: [%], shape (T,).
        angle: `measured`, where it moved, and `simulated` [deg], shape (T,).
        pressure: of chambers A and B [bar], shape (T, 2), as far as it was measured and simulated.
    """

    name: str
    command: Array
    angle: Mapping[str, Array]
    pressure: Mapping[str, Array]


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
        angles = (signals.angle for signals in self.signals)
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
            signals.append(_signals(name, joint, {"measured": log, "simulated": predicted[side]}))
    if mirrored:
        predicted = dict.fromkeys(logs, predicted["both"])
    rest, simulated = arm.pose(model.settings.start_pose), {s: log.angle for s, log in predicted.items()}
    shown = simulated | {side: log.angle for side, log in logs.items() if _moves(log.angle)}
    measured = machine.joined(shown, rest) if any(_moves(log.angle) for log in logs.values()) else None
    return Motion(machine, first.time, machine.joined(simulated, rest), measured, tuple(signals))


def _moves(angle: Array) -> bool:
    """Whether angles, shape (T, ...), are of a motion; a log of commands stands in its start pose."""
    return bool(np.nan_to_num(np.ptp(angle, axis=0)).any())


def _signals(name: str, joint: int, both: Mapping[str, Log]) -> JointSignals:
    angles = {kind: np.degrees(log.angle[:, joint]) for kind, log in both.items()}
    if not _moves(angles["measured"]):
        del angles["measured"]
    pressures = {
        kind: 1e-5 * log.pressure[:, joint]
        for kind, log in both.items()
        if log.pressure is not None and not np.isnan(log.pressure[:, joint]).all()
    }
    return JointSignals(name, both["measured"].command[:, joint], angles, pressures)
