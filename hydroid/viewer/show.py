"""The command `view` as plain functions: a window in real time, or an animated GIF."""

from pathlib import Path

import numpy as np

from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.identified import IdentifiedModel
from hydroid.log import Warn
from hydroid.plant import Plant
from hydroid.simulating import read_commands
from hydroid.viewer.playback import Playback
from hydroid.viewer.window import animation, play, window


def view(identified: IdentifiedModel, log: Path | None, pose: str | None, warn: Warn) -> None:
    """Show the arm in MuJoCo's viewer until its window is closed.

    Args:
        identified: settings and parameters.
        log: whose commands drive; None: the viewer's sliders.
        pose: of the arm's file, to start from; by default the log's first, or the settings' start pose.
        warn: receives warnings about the log.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
        HydroidError: what else the user can mend.
    """
    playback = _playback(identified, log, pose, warn)
    with window(playback.plant) as viewer:
        play(playback, viewer)


def animate(identified: IdentifiedModel, log: Path, pose: str | None, out: Path, warn: Warn) -> None:
    """Write the arm's motion under a log's commands as an animated GIF; it needs no display."""
    write_atomic(out, animation(_playback(identified, log, pose, warn)))


def _playback(identified: IdentifiedModel, path: Path | None, pose: str | None, warn: Warn) -> Playback:
    settings = identified.settings
    if path is None:
        plant = Plant(identified, joints=range(1, 1 + len(settings.arm.joints)))
        return Playback(plant, pose=pose)
    log = read_commands(path, settings, pose, warn)
    driven = [int(j) + 1 for j in np.flatnonzero(log.driven)]
    if not driven:
        raise SettingsError("commands nothing", where=str(path), hint="leave it out to use the sliders")
    plant = Plant(identified, joints=driven, payload=settings.payloads.get(path.name, 0.0))
    return Playback(plant, log)
