"""A plant under the commands of a log, or under those of the viewer's sliders."""

from pathlib import Path

import mujoco
import numpy as np

from hydroid.errors import SettingsError
from hydroid.identified import IdentifiedModel
from hydroid.log import Log
from hydroid.plant import Plant


def make_playback(identified: IdentifiedModel, log: Log | None, pose: str | None = None) -> "Playback":
    """Return the playback of a log, or one with all joints on sliders that starts in a pose.

    Raises:
        SettingsError: a log that commands nothing, or what `Plant` refuses.
    """
    settings = identified.settings
    if log is None:
        return Playback(Plant(identified, joints=range(1, 1 + len(settings.arm.joints))), pose=pose)
    driven = [int(j) + 1 for j in np.flatnonzero(log.driven)]
    if not driven:
        raise SettingsError("commands nothing", where=log.source, hint="leave it out to use the sliders")
    payload = settings.payloads.get(Path(log.source).name, 0.0)
    return Playback(Plant(identified, joints=driven, payload=payload), log)


class Playback:
    """Plays a plant from its start as often as wanted.

    Args:
        plant: the plant; its joints are on sliders.
        log: whose commands drive, from its first pose to its end; None: the sliders command, for ever.
        pose: where the sliders begin, a pose of the arm's file; by default the settings' start pose.
    """

    def __init__(self, plant: Plant, log: Log | None = None, pose: str | None = None) -> None:
        self.plant, self._log = plant, log
        self._start = pose if log is None else log.start
        self.restart()

    @property
    def duration(self) -> float:
        """Of the log [s]; inf where the sliders command."""
        return np.inf if self._log is None else (len(self._log.time) - 1) * self._log.period

    def restart(self) -> None:
        """Go back to the start."""
        self.plant.reset(self._start)
        self._refresh()

    def advance(self, until: float) -> None:
        """Step to the period before `until` [s], or to the log's end.

        Raises:
            RunError: the simulation diverged.
        """
        plant = self.plant
        while plant.time + plant.period <= min(until, self.duration) + 1e-9:
            if self._log is None:
                command = plant.command
            else:
                command = self._log.command[round(plant.time / self._log.period)]
            plant.step(command)
        self._refresh()

    def captions(self) -> tuple[str, str]:
        """Two columns of text beside the picture: what moves; its command, its angle, and the log's."""
        plant = self.plant
        names, command, angle = plant.names, plant.command, np.degrees(plant.angle)
        lines = [
            f"{command[j - 1]:4.0f} %  {angle[j - 1]:7.2f} deg{self._logged(j - 1)}" for j in plant.joints
        ]
        first = ["time", *(names[j - 1] for j in plant.joints)]
        return "\n".join(first), "\n".join([f"{plant.time:.1f} s", *lines])

    def _logged(self, joint: int) -> str:
        if self._log is None or not np.ptp(self._log.angle[:, joint]):
            return ""
        return f"  (log {np.degrees(self._log.angle[round(self.plant.time / self._log.period), joint]):.2f})"

    def _refresh(self) -> None:
        """Bring what is drawn up to the angles: `mj_step` leaves it a step behind."""
        model, data = self.plant.model, self.plant.data
        for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_tendon):
            update(model, data)
