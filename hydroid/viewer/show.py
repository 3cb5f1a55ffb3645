"""The commands `plot-actuator` and `view` as plain functions."""

from pathlib import Path

import numpy as np

from hydroid.arm.model import load_model
from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.log import Log, Warn
from hydroid.problem.problem import make_simulation
from hydroid.report.actuator import actuator_card, write_actuator
from hydroid.simulating import read_commands
from hydroid.simulation import HydraulicSimulation
from hydroid.viewer.choice import Chosen
from hydroid.viewer.player import Player
from hydroid.viewer.window import animation, play, window

PERIOD = 0.01
"""of the commands where no log says one [s]"""


def plot_actuator(chosen: Chosen, joint: int, out: Path) -> list[Path]:
    """Draw the curves of one actuator, joint 1-based, and return the files.

    Raises:
        SettingsError: no such joint, or no force-stroke curve.
        RunError: `out` cannot be written.
    """
    return write_actuator(out, actuator_card(chosen.settings.arm, chosen.candidate, joint, chosen.source))


def view(chosen: Chosen, log: Path | None, pose: str | None, warn: Warn) -> None:
    """Show the arm in MuJoCo's viewer until its window is closed.

    Args:
        chosen: the parameter set.
        log: whose commands drive; None: the viewer's sliders.
        pose: of the arm's file, to start from; by default the log's first, or the settings' start pose.
        warn: takes what is odd about the log.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
        HydroidError: what else the user can mend.
    """
    player = _player(chosen, log, pose, warn)
    with window(player) as viewer:
        play(player, viewer)


def animate(chosen: Chosen, log: Path, pose: str | None, out: Path, warn: Warn) -> None:
    """Write the arm's motion under a log's commands as an animated GIF; it needs no display."""
    write_atomic(out, animation(_player(chosen, log, pose, warn)))


def _player(chosen: Chosen, path: Path | None, pose: str | None, warn: Warn) -> Player:
    settings = chosen.settings
    for joint in range(1, 1 + len(settings.arm.joints)):
        actuator_card(settings.arm, chosen.candidate, joint, chosen.source)  # says what is wrong with one
    if path is None:
        start = settings.arm.pose(pose or settings.start_pose)
        log = Log(
            "sliders", np.array([0.0, PERIOD]), np.zeros((2, len(start))), np.tile(start, (2, 1)), PERIOD
        )
        outputs = list(range(len(start)))  # what is compared can move, and what can move has a slider
    else:
        log = read_commands(path, settings, pose, warn)
        outputs = [int(j) for j in np.flatnonzero(log.driven)]
        if not outputs:
            raise SettingsError("commands nothing", where=str(path), hint="leave it out to use the sliders")
    spec = load_model(settings.arm.model, settings.arm)
    simulation = make_simulation(spec, log, outputs, settings)
    assert isinstance(simulation, HydraulicSimulation)
    return Player(spec, settings.arm, simulation, chosen.candidate, log, live=path is None)
