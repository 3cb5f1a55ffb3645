"""The arm in motion: a window in real time, or an animated GIF."""

from pathlib import Path

import numpy as np

from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.identified import IdentifiedModel
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.viewer.playback import Playback
from hydroid.viewer.window import animation, play, window


def view(identified: IdentifiedModel, log: Log | None, pose: str | None) -> None:
    """Show the arm in MuJoCo's viewer until its window is closed.

    Args:
        identified: settings and parameters.
        log: whose commands drive; None: the viewer's sliders.
        pose: of the arm's file, to start from without a log; by default the settings' start pose.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
        HydroidError: what else the user can mend.
    """
    playback = _playback(identified, log, pose)
    with window(playback.plant) as viewer:
        play(playback, viewer)


def animate(identified: IdentifiedModel, log: Log, out: Path) -> None:
    """Write the arm's motion under a log's commands as an animated GIF; it needs no display."""
    write_atomic(out, animation(_playback(identified, log, None)))


def _playback(identified: IdentifiedModel, log: Log | None, pose: str | None) -> Playback:
    settings = identified.settings
    if log is None:
        plant = Plant(identified, joints=range(1, 1 + len(settings.arm.joints)))
        return Playback(plant, pose=pose)
    driven = [int(j) + 1 for j in np.flatnonzero(log.driven)]
    if not driven:
        raise SettingsError("commands nothing", where=log.source, hint="leave it out to use the sliders")
    plant = Plant(identified, joints=driven, payload=settings.payloads.get(Path(log.source).name, 0.0))
    return Playback(plant, log)
