"""What the window shows: a plant under its sliders, or a simulated motion beside the measured one.

Both have what is drawn (`model`, `data` and, where something was measured, `ghost`), the `time` that is shown
and the `duration` after which all stands still [s].
"""

import mujoco
import numpy as np

from hydroid.plant import Plant
from hydroid.viewer.film import place
from hydroid.viewer.motion import Motion


class Sliders:
    """A plant with all joints on the viewer's sliders; its physics can be pushed about.

    Args:
        plant: the plant.
        pose: where it begins, a pose of the arm's file; by default the settings' start pose.
    """

    duration, ghost = np.inf, None

    def __init__(self, plant: Plant, pose: str | None = None) -> None:
        self.plant, self._start = plant, pose
        self.restart()
        self.model, self.data = plant.model, plant.data  # of the plant in its pose, where it locks joints

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.plant.time

    def restart(self) -> None:
        """Go back to the start."""
        self.plant.reset(self._start)
        self.advance(0.0)

    def advance(self, until: float) -> None:
        """Step to the period before `until` [s].

        Raises:
            RunError: the simulation diverged.
        """
        plant = self.plant
        while plant.time + plant.period <= until + 1e-9:
            plant.step(plant.command)
        place(plant.model, plant.data, plant.data.qpos)  # `mj_step` leaves what is drawn a step behind


class Replay:
    """A simulated motion from its start to its end.

    Args:
        motion: what is shown.
    """

    def __init__(self, motion: Motion) -> None:
        self.model, self._motion = motion.machine.model, motion
        self.data, self.duration = mujoco.MjData(self.model), float(motion.time[-1])
        self.ghost = None if motion.measured is None else mujoco.MjData(self.model)
        self.restart()

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return float(self._motion.time[self._sample])

    def restart(self) -> None:
        """Go back to the start."""
        self.advance(0.0)

    def advance(self, until: float) -> None:
        """Go on to the sample before `until` [s]."""
        motion = self._motion
        self._sample = motion.sample(until)
        place(self.model, self.data, motion.simulated[self._sample])
        self.data.time = self.time
        if self.ghost is not None and motion.measured is not None:
            place(self.model, self.ghost, motion.measured[self._sample])


Playback = Sliders | Replay
