"""Values that are allowed but look as if they had another unit: fractions for %, radians for degrees."""

from collections.abc import Iterator

import numpy as np

from hydroid.log.finding import Finding
from hydroid.log.log import Floats
from hydroid.log.signals import Recording

FRACTION = 1.0  # [%]: no valve of a manipulator opens at smaller commands
MOVES = 3.0  # [deg], of the mean over WINDOW: more than noise and settling
WINDOW = 0.5  # [s]
HALF_TURN = 3.2  # just above pi: few joints turn further, in rad
STRONG = 30.0  # [%], past the dead band of a valve
LEAST = 300.0  # [% s] of strong commands before their effect is judged
SLOWEST = 0.015  # [deg/(% s)]: 1.5 deg/s at full command; the rig's slowest joint turns 16 times as fast


def check_units(recording: Recording) -> Iterator[Finding]:
    """Report units that the arm's motion contradicts; nothing where another explanation is possible."""
    if np.isnan(recording.values).any() or len(recording.time) < 2 or (np.diff(recording.time) <= 0).any():
        return  # has faults to be mended first
    command, angle = recording.motions(max((c.joint for c in recording.signals), default=0))
    angle = np.rad2deg(angle)
    driven = np.flatnonzero(command.any(axis=0) & ~np.isnan(angle[0]))
    if not len(driven):
        return
    means = _means(recording.time, angle[:, driven])
    if np.abs(command).max() <= FRACTION:
        yield from _fractions(recording, driven, np.ptp(means, axis=0))
    elif np.nanmax(np.abs(angle)) <= HALF_TURN:
        strong = np.where(np.abs(command[:-1, driven]) > STRONG, np.abs(command[:-1, driven]), 0.0)
        yield from _radians(
            recording, driven, np.diff(recording.time) @ strong, np.abs(np.diff(means, axis=0)).sum(axis=0)
        )


def _fractions(recording: Recording, driven: np.ndarray, moved: Floats) -> Iterator[Finding]:
    most = int(moved.argmax())
    if moved[most] > MOVES:
        joint = int(driven[most]) + 1
        what = f"no command exceeds {FRACTION:g} %, yet joint {joint} turns by {moved[most]:.3g} deg"
        hint = "if commands are fractions from -1 to 1, set log.command.scale: 100"
        signal = next(c for c in recording.signals if c.kind == "command" and c.joint == joint)
        yield recording.finding("warning", what, hint, (), signal)


def _radians(recording: Recording, driven: np.ndarray, push: Floats, path: Floats) -> Iterator[Finding]:
    judged = push > LEAST
    if judged.any() and ((path > 0) & (path < SLOWEST * push))[judged].all():
        joint = int(driven[judged][0]) + 1
        what = f"no angle exceeds {HALF_TURN:g} deg, and joint {joint} hardly follows strong commands"
        signal = next(c for c in recording.signals if c.kind == "angle" and c.joint == joint)
        yield recording.finding("warning", what, "if angles are in rad, set log.angle.unit: rad", (), signal)


def _means(time: Floats, angle: Floats) -> Floats:
    """Means over windows of half a second, shape (windows, J); the last may be shorter."""
    window = np.floor((time - time[0]) / WINDOW)
    starts = np.flatnonzero(np.diff(window, prepend=-1.0))
    counts = np.diff(starts, append=len(angle))
    return np.add.reduceat(angle, starts, axis=0) / counts[:, None]
