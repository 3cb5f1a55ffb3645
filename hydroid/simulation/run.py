"""One candidate of stage 2 on its way through a record."""

from dataclasses import dataclass

import numpy as np

from hydroid.hydraulics.actuator import Actuator, ActuatorState, Observation
from hydroid.hydraulics.records import JOINT_STATE
from hydroid.simulation.population import Array, Population
from hydroid.simulation.rollout import Machine, roll


@dataclass(frozen=True)
class Start:
    """Candidates at the start of a record: their arms, their actuators, and the torque of prescribed joints."""

    population: Population
    actuator: Actuator
    state: ActuatorState
    servo: Array


class HydraulicRun:
    """One candidate on its way through a record, wherever the commands come from.

    Args:
        start: a population at the start.
        candidate: which one of it.
        machine: what simulates it, and no other until this run is over.

    Attributes:
        position: angles of the record's moving joints [rad], live, shape (1, V).
    """

    def __init__(self, start: Start, candidate: int, machine: Machine) -> None:
        machine.take(start.population, candidate)
        self.position = machine.arm.angle[None]
        self._machine, self._actuator, self._member = machine, start.actuator, candidate
        self._state, self._recent = start.state.joints[candidate], start.state.commands[1:]
        self._servo = start.servo

    def step(self, command: Array) -> None:
        """Step once under a command [%], shape (J,); call it within `quiet_mujoco`."""
        self.follow(command[None], 1)

    def follow(
        self, command: Array, steps: int, *, observe: bool = False
    ) -> tuple[Array, Observation | None]:
        """Follow commands; call it within `quiet_mujoco`.

        Args:
            command: held during each step [%], shape (T steps, J).
            steps: in a sample.
            observe: whether to keep what the actuators do.

        Returns:
            Angles of the moving joints [rad], shape (1 + T, V), and what can be measured on the actuators,
            samples in the place of candidates: now and after each sample.

        Raises:
            ValueError: joints follow a log that ends before the commands do.
        """
        arm, samples = self._machine.arm, len(command) // steps
        if arm.follows.size and len(self._servo) < len(command):
            raise ValueError("the log that some joints follow is over")  # compiled code would read on
        angle = np.full((1 + samples, arm.angle.size), np.nan)
        seen = np.zeros((1 + samples if observe else 1, self._state.size), JOINT_STATE)
        angle[0], seen[0] = arm.angle, self._state
        commands = np.concatenate([self._recent, command])
        roll(
            arm,
            self._actuator.plugin,
            self._member,
            self._state,
            commands,
            self._servo[: len(command)],
            steps,
            angle[1:],
            seen[1:],
        )
        self._recent, self._servo = commands[-len(self._recent) :], self._servo[len(command) :]
        if not observe:
            return angle, None
        states, one = ActuatorState(seen, self._recent), slice(self._member, self._member + 1)
        return angle, self._actuator.observe(states, angle[:, arm.columns], one)

    @property
    def healthy(self) -> np.bool_:
        """Whether the candidate has not diverged."""
        return self._machine.healthy
