"""The settled speeds of an arm in any pose, and the commands for wished ones, with what
keeps them away."""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import mujoco
import numpy as np

from hydroid.arm.locked import lock
from hydroid.arrays import Array, Index, Mask, record
from hydroid.hydraulics.kernel import Plugin
from hydroid.mjcf import quiet_mujoco
from hydroid.rungs import Rung
from hydroid.settings.arm import Arm
from hydroid.simulation import Candidates
from hydroid.simulation.rollout import SteppedArm
from hydroid.simulation.scenario import model_values
from hydroid.simulation.settled import FULL_COMMAND, settled_commands, settled_speeds

CLOSE = 1e-3
"""part of a wished speed by which the one that is had may differ"""
LEAST_SPEED = 1e-6
"""difference of speeds that is none [rad/s], or [m/s]"""


class Limit(StrEnum):
    """Why a joint does not have the speed that was wished."""

    STOP = "at its stop"
    FULL = "full command is not enough"
    PUMP = "the pump gives no more"
    SLOWEST = "cannot move that slowly"
    LEAKS = "sinks because its valve leaks"


@record
class SteadyCommands:
    """Commands for wished speeds: `Plant.commands` returns them.

    Attributes:
        command: [%], shape (J,).
        speed: what the joints then have [rad/s], of those that slide [m/s], shape (J,).
        limits: why it is not the wish, by the joint's name; the speed is then the
            nearest.
    """

    command: Array
    speed: Array
    limits: dict[str, Limit]


class Weighing:
    """The torques that hold an arm in any pose, whatever joints a plant locks.

    `slack` are the angles at which its springs are slack [rad], shape (J,).
    """

    def __init__(
        self, spec: mujoco.MjSpec, arm: Arm, candidate: Candidates, slack: Array
    ) -> None:
        # no joint is locked: the pose is another at every call
        every_joint = np.ones(len(slack), dtype=bool)
        whole = lock(spec, arm, every_joint, slack)
        whole.model.qpos_spring[:] = slack
        self._values = model_values(whole, candidate)
        self._arm = SteppedArm(whole.model)

    def loads(self, pose: Array) -> Array:
        """Return the torques [N·m] that hold the joints at angles [rad], both of shape
        (S, J)."""
        with quiet_mujoco():
            rows = [self._arm.start(self._values, [0], angle) for angle in pose]
        return np.array(rows).reshape(pose.shape)


@record
class SteadyArm:
    """The settled speeds of one candidate's actuators.

    Attributes:
        weighing: of the whole arm.
        plugin: the actuators of V joints.
        columns: these joints among the arm's, 0-based, shape (V,).
        ranges: of the arm's joints [rad], shape (J, 2).
        rung: whose law it is.
    """

    weighing: Weighing
    plugin: Plugin
    columns: Index
    ranges: Array
    rung: Rung

    def speeds(self, command: Array, pose: Array) -> Array:
        """Return settled speeds [rad/s] under commands [%] at angles [rad], all of
        shape (S, J)."""
        load = self.weighing.loads(pose)
        speeds = settled_speeds(
            self.plugin,
            pose[:, self.columns],
            load[:, self.columns],
            command[:, self.columns],
            self.rung,
        )
        return self._spread(speeds)

    def commands(
        self, speed: Array, pose: Array, load: Array | None = None
    ) -> tuple[Array, Array]:
        """Return commands [%] for wished speeds [rad/s], and the speeds they have, all
        of shape (S, J).

        A joint at an end of its range moves no further. `load` is that of `weighing`,
        where it is known.
        """
        if load is None:
            load = self.weighing.loads(pose)
        wished = np.where(self.stopped(speed, pose), 0.0, speed)
        command, reached = settled_commands(
            self.plugin,
            pose[:, self.columns],
            load[:, self.columns],
            wished[:, self.columns],
            self.rung,
        )
        return self._spread(command), self._spread(reached)

    def stopped(self, speed: Array, pose: Array) -> Mask:
        """Return where joints at an end of their range should move beyond it, (S,
        J)."""
        low, high = self.ranges.T
        downwards = (speed < 0.0) & (pose <= low)
        upwards = (speed > 0.0) & (pose >= high)
        return downwards | upwards

    def limits(
        self, speed: Array, reached: Array, command: Array, pose: Array
    ) -> list[dict[int, Limit]]:
        """Return why joints (0-based) do not have their wished speeds, for each of S
        poses."""
        # what the search for a command leaves is no limit
        close = np.maximum(CLOSE * np.abs(speed), LEAST_SPEED)
        away = np.abs(reached - speed) > close
        driven = self.columns[self.plugin.order[self.plugin.idle :]]
        away &= np.isin(np.arange(len(self.ranges)), driven)
        stopped = self.stopped(speed, pose)
        limits = [dict[int, Limit]() for _ in speed]
        rows = np.flatnonzero(away.any(axis=1))
        # a joint that an endless pump would make faster waits for the pump
        alone = self._with_endless_pump(speed[rows], pose[rows])
        gained = np.abs(alone - reached[rows]) > CLOSE * np.abs(speed[rows])
        for row, pumped in zip(rows.tolist(), gained, strict=True):
            for joint in np.flatnonzero(away[row]).tolist():
                if stopped[row, joint]:
                    limit = Limit.STOP
                elif speed[row, joint] == 0.0:
                    limit = Limit.LEAKS
                elif abs(command[row, joint]) < FULL_COMMAND - 1e-6:
                    limit = Limit.SLOWEST
                elif pumped[joint]:
                    limit = Limit.PUMP
                else:
                    limit = Limit.FULL
                limits[row][joint] = limit
        return limits

    def _with_endless_pump(self, speed: Array, pose: Array) -> Array:
        """Return the speeds that joints would reach if the pump had no limit [rad/s],
        (S, J)."""
        endless = self.plugin.coefficients.copy()
        endless["pump_flow"] = np.inf
        plugin = self.plugin._replace(coefficients=endless)
        _, reached = replace(self, plugin=plugin).commands(speed, pose)
        return reached

    def _spread(self, values: Array) -> Array:
        """Spread values of the V joints over all, 0 of the others."""
        every = np.zeros((len(values), len(self.ranges)))
        every[:, self.columns] = values
        return every


def by_name(limits: dict[int, Limit], names: Sequence[str]) -> dict[str, Limit]:
    """Return limits of joints by their names instead of their places."""
    return {names[joint]: limit for joint, limit in limits.items()}
