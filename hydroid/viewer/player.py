"""One simulated candidate, and the whole arm in the pose that it has.

What is stepped is the simulation, with the joints that move; the whole arm only takes over its angles. The
controls of its motors are the commands in %: a log sets them, or the viewer's sliders do.
"""

import mujoco
import numpy as np

from hydroid.errors import RunError
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.simulation import Candidates, HydraulicSimulation
from hydroid.simulation.population import quiet_mujoco


class Player:
    """Plays one candidate, from the start of its record as often as wanted.

    Args:
        spec: the arm's MJCF; its motors become the sliders.
        arm: its settings.
        simulation: of the joints that move, on `log`.
        candidate: one parameter set.
        log: the record; joints that do not move stand as in its first sample.
        live: the sliders command, for ever; otherwise the log does, to its end.

    Attributes:
        model: the whole arm.
        data: its state; `ctrl` holds the commands [%].
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        arm: Arm,
        simulation: HydraulicSimulation,
        candidate: Candidates,
        log: Log,
        *,
        live: bool,
    ) -> None:
        self._names = [arm.joint_names[j] for j in simulation.joints]
        self._simulation, self._member, self._log, self._live = simulation, candidate, log, live
        self._step = simulation.record.arm.model.opt.timestep
        for name in arm.joint_names:
            motor = spec.actuator(name)
            if motor is None:  # a user's own model may have none
                motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.ctrllimited, motor.ctrlrange = True, [-100.0, 100.0]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._motors = np.array([self.model.actuator(name).id for name in self._names])
        self.restart()

    def restart(self) -> None:
        """Go back to the start."""
        self._run, self._taken = self._simulation.begin(self._member), 0
        mujoco.mj_resetData(self.model, self.data)
        self._take_over()

    @property
    def time(self) -> float:
        """Simulated so far [s]."""
        return self._taken * self._step

    @property
    def duration(self) -> float:
        """Of the record [s]; inf where the sliders command."""
        return np.inf if self._live else len(self._simulation.command) * self._step

    def advance(self, until: float) -> None:
        """Simulate to the step before `until` [s], or to the record's end, and pose the arm so.

        Raises:
            RunError: the simulation diverged.
        """
        with quiet_mujoco():
            while self.time + self._step <= min(until, self.duration) + 1e-9:
                if not self._live:
                    self.data.ctrl[self._motors] = self._simulation.command[self._taken]
                self._run.step(self.data.ctrl[self._motors])
                self._taken += 1
            if not self._run.healthy:
                raise RunError(f"the simulation diverged before {self.time:.2f} s")
            self._take_over()

    def words(self) -> tuple[str, str]:
        """Two columns of text beside the picture: what moves; its command, its angle, and the log's."""
        angle = np.degrees(self.data.qpos)
        seen = [
            f"{self.data.ctrl[motor]:4.0f} %  {angle[joint]:7.2f} deg{self._logged(joint)}"
            for joint, motor in zip(self._simulation.joints, self._motors, strict=True)
        ]
        return "\n".join(["time", *self._names]), "\n".join([f"{self.time:.1f} s", *seen])

    def _logged(self, joint: int) -> str:
        angle = self._log.angle[:, joint]
        if self._live or not np.ptp(angle):
            return ""
        return f"  (log {np.degrees(angle[round(self.time / self._log.period)]):.2f})"

    def _take_over(self) -> None:
        self.data.qpos[:] = self._log.start
        self.data.qpos[self._simulation.record.joints] = self._run.position[0]
        self.data.time = self.time
        mujoco.mj_forward(self.model, self.data)
