"""Arms in motion: simulated and measured angles of a machine."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydroid.arm.model import ALONE, Machine, load_machine
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.prediction import predict_log


@dataclass(frozen=True, eq=False)
class Motion:
    """A machine under the commands of logs.

    Attributes:
        machine: what moves.
        time: [s], shape (T,).
        simulated: angles of all joints of the machine [rad], shape (T, nq).
        measured: the same as logged; None where the logs hold no motion.
        error: rms difference of the driven joints that were measured [deg]; NaN: there are none.
    """

    machine: Machine
    time: Array
    simulated: Array
    measured: Array | None
    error: float

    def sample(self, time: float) -> int:
        """Return the number of the last sample at or before a time [s]."""
        return int(np.clip(np.searchsorted(self.time, time + 1e-9) - 1, 0, len(self.time) - 1))


def simulated_motion(model: IdentifiedModel, logs: Mapping[str, Log]) -> Motion:
    """Simulate the commands of logs, by the name of the arm that they move (`Machine.sides`).

    Raises:
        SettingsError: a log commands nothing.
        RunError: the simulation diverged.
    """
    arm, first = model.settings.arm, next(iter(logs.values()))
    machine = load_machine(arm, pair=ALONE not in logs)
    predicted: dict[int, Log] = {}  # by the log: arms that are mirror images share one
    errors: list[Array] = []
    for log in logs.values():
        if not log.driven.any():
            raise SettingsError("commands nothing", where=log.source, hint="name a log with commands")
        predicted[id(log)] = one = predicted.get(id(log)) or predict_log(model, log)
        shown = np.logical_and(log.driven, _moves(log.angle))
        errors.append((log.angle - one.angle)[:, shown].ravel())
    rest, error = arm.pose(model.settings.start_pose), np.concatenate(errors)
    simulated = {side: predicted[id(log)].angle for side, log in logs.items()}
    moved = {side: log.angle for side, log in logs.items() if _moves(log.angle).any()}
    measured = machine.joined(simulated | moved, rest) if moved else None
    rms = float(np.degrees(np.sqrt(np.mean(error**2)))) if error.size else np.nan
    return Motion(machine, first.time, machine.joined(simulated, rest), measured, rms)


def _moves(angle: Array) -> NDArray[np.bool_]:
    """Which angles, shape (T, J), are of a motion, (J,); a log of commands stands in its start pose."""
    return np.nan_to_num(np.ptp(angle, axis=0)) > 0
