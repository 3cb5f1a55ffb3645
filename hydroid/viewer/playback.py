"""What the window shows: a plant under its sliders, or a simulated motion beside the measured one."""

from abc import ABC, abstractmethod

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.identified_model import IdentifiedModel
from hydroid.plant import Plant
from hydroid.viewer.film import add_ghost, place
from hydroid.viewer.motion import Motion


class Playback(ABC):
    """Something that moves in a window.

    Args:
        model: in MuJoCo.
        data: its state, drawn as it is.
        ghost: the state of what was measured, drawn behind it; None: nothing was measured.
    """

    duration = np.inf
    """time after which it stands still [s]"""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, ghost: mujoco.MjData | None = None
    ) -> None:
        self.model, self.data, self._ghost = model, data, ghost
        self._seen = mujoco.MjvOption(), mujoco.MjvPerturb()
        self.restart()

    @property
    @abstractmethod
    def time(self) -> float:
        """Since the start [s]."""

    @abstractmethod
    def advance(self, until: float) -> None:
        """Go on to the sample before `until` [s].

        Raises:
            RunError: the simulation diverged.
        """

    @abstractmethod
    def captions(self) -> tuple[str, str]:
        """Return two columns of text: what moves, and how."""

    def restart(self) -> None:
        """Go back to the start."""
        self.advance(0.0)

    def draw_ghost(self, scene: mujoco.MjvScene, away: NDArray[np.float64]) -> None:
        """Add what was measured to a scene; `away` is the direction of sight, shape (3,)."""
        if self._ghost is not None:
            add_ghost(self.model, self._ghost, scene, self._seen, away)


class Sliders(Playback):
    """A plant with all joints on the viewer's sliders; its physics can be pushed about.

    Args:
        plant: the plant.
        pose: where it begins, a pose of the arm's file; by default the settings' start pose.
    """

    def __init__(self, plant: Plant, pose: str | None = None) -> None:
        self.plant, self._start = plant, pose
        plant.reset(pose)  # it builds another model where it holds other joints in place
        super().__init__(plant.model, plant.data)

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.plant.time

    def restart(self) -> None:
        """Go back to the start."""
        self.plant.reset(self._start)
        self._refresh()

    def advance(self, until: float) -> None:
        """Step to the period before `until` [s].

        Raises:
            RunError: the simulation diverged.
        """
        plant = self.plant
        while plant.time + plant.period <= until + 1e-9:
            plant.step(plant.command)
        self._refresh()

    def captions(self) -> tuple[str, str]:
        """Return the joints, and their commands and angles."""
        plant = self.plant
        names, command, angle = plant.names, plant.command, np.degrees(plant.angle)
        lines = [f"{command[j - 1]:4.0f} %  {angle[j - 1]:7.2f} deg" for j in plant.joints]
        first = ["time", *(names[j - 1] for j in plant.joints)]
        return "\n".join(first), "\n".join([f"{plant.time:.1f} s", *lines])

    def _refresh(self) -> None:
        """Bring what is drawn up to the angles: `mj_step` leaves it a step behind."""
        place(self.plant.model, self.plant.data, self.plant.data.qpos)


class Replay(Playback):
    """A simulated motion from its start to its end.

    Args:
        motion: what is shown.
    """

    def __init__(self, motion: Motion) -> None:
        model, self._motion = motion.machine.model, motion
        self.duration = float(motion.time[-1])
        ghost = None if motion.measured is None else mujoco.MjData(model)
        super().__init__(model, mujoco.MjData(model), ghost)

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return float(self._motion.time[self._sample])

    def advance(self, until: float) -> None:
        """Go on to the sample before `until` [s]."""
        motion = self._motion
        self._sample = motion.sample(until)
        place(self.model, self.data, motion.simulated[self._sample])
        self.data.time = self.time
        if self._ghost is not None and motion.measured is not None:
            place(self.model, self._ghost, motion.measured[self._sample])

    def captions(self) -> tuple[str, str]:
        """Return the driven joints, and their commands, angles and pressures."""
        first, second, k = ["time"], [f"{self.time:.1f} s"], self._sample
        for signals in self._motion.signals:
            line = f"{signals.command[k]:4.0f} %  {signals.simulated[k]:7.2f} deg"
            if signals.measured is not None:
                line += f"  (log {signals.measured[k]:.2f})"
            if signals.pressure is not None:
                line += "  {:.0f} / {:.0f} bar".format(*signals.pressure[k])
            first.append(signals.name)
            second.append(line)
        return "\n".join(first), "\n".join(second)


def make_sliders(model: IdentifiedModel, pose: str | None = None) -> Sliders:
    """Return the plant of a model with all joints on sliders."""
    return Sliders(Plant(model, joints=range(1, 1 + len(model.settings.arm.joints))), pose)
