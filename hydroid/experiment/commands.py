"""Experiments: a start pose and pseudo-random commands, drawn and changed at random.

A command is a sequence of levels, each held for a random time, as in the article's figure 17.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.stage import Stage
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Input:
    """One joint's command: `level[i]` [%] from sample `start[i]` to the next; start[0] is 0."""

    start: Ints
    level: Array

    def command(self, samples: int) -> Array:
        """Return the command at every sample [%], shape (samples,)."""
        return np.repeat(self.level, np.diff(np.append(self.start, samples)))


@dataclass(frozen=True, eq=False)
class Experiment:
    """Start pose [rad], shape (J,), and the inputs of the driven joints, by joint (0-based)."""

    pose: Array
    inputs: Mapping[int, Input]

    def log(self, samples: int, period: float) -> Log:
        """Return commands without motion: every angle stays in the start pose."""
        command = np.zeros((samples, len(self.pose)))
        for joint, signal in self.inputs.items():
            command[:, joint] = signal.command(samples)
        angle = np.tile(self.pose, (samples, 1))
        return Log("design", period * np.arange(samples, dtype=float), command, angle, period)

    def scaled(self, factor: float) -> "Experiment":
        """Return the experiment with all commands times a factor."""
        inputs = {j: replace(i, level=np.round(factor * i.level, 1)) for j, i in self.inputs.items()}
        return replace(self, inputs=inputs)

    def with_level(self, joint: int, segment: int, level: float) -> "Experiment":
        """Return the experiment with one level [%] of one joint replaced."""
        levels = self.inputs[joint].level.copy()
        levels[segment] = round(level, 1)
        changed = replace(self.inputs[joint], level=levels)
        return replace(self, inputs={**self.inputs, joint: changed})


class Draw:
    """Draws experiments, and changes them, from one random stream.

    Args:
        settings: the joints that may be driven, their commands, the start poses.
        rng: the stream.

    Raises:
        SettingsError: joints or poses that cannot be.
    """

    def __init__(self, settings: FitSettings, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings.design, rng
        self._joints, self._poses = driven_joints(settings), start_poses(settings)
        self._lower, self._upper = pose_limits(settings.arm, np.radians(settings.design.margin_deg))
        self._any_pose = settings.design.poses == "any"
        self.period = settings.log.period_s
        """of the commands [s]"""
        self.samples = round(settings.design.duration_s / self.period) + 1
        self._dwell = tuple(max(1, round(t / self.period)) for t in settings.design.dwell_s)

    def new(self) -> Experiment:
        """Draw an experiment: half of them drive all allowed joints, the others a random part of them."""
        some = self._rng.random(len(self._joints)) < 0.5
        driven = self._joints if self._rng.random() < 0.5 or not some.any() else np.array(self._joints)[some]
        return Experiment(self._pose(), {int(j): self._input() for j in driven})

    def integer(self, below: int) -> int:
        """Draw an integer from 0 to below - 1."""
        return int(self._rng.integers(below))

    def changed(self, experiment: Experiment) -> Experiment:
        """Change an experiment in one to three places."""
        for _ in range(int(self._rng.integers(1, 4))):
            kind = self._rng.random()
            if kind < 0.1:
                experiment = replace(experiment, pose=self._moved(experiment.pose))
            else:
                joint = int(self._rng.choice(self._joints))
                old = experiment.inputs.get(joint)
                new = self._input() if old is None or kind < 0.15 else self._varied(old)
                experiment = replace(experiment, inputs={**experiment.inputs, joint: new})
        return experiment

    def _input(self) -> Input:
        starts = [0]
        while (begin := starts[-1] + int(self._rng.integers(self._dwell[0], self._dwell[1] + 1))) < (
            self.samples - self._dwell[0]
        ):
            starts.append(begin)
        return Input(np.array(starts), self._level(len(starts)))

    def _level(self, count: int) -> Array:
        limit = self._settings.command_pct
        return np.round(self._rng.uniform(-limit, limit, count), 1)

    def _varied(self, old: Input) -> Input:
        """One level redrawn or moved, one switch moved, or a stretch drawn anew."""
        rng, count = self._rng, len(old.level)
        at, kind = int(rng.integers(count)), int(rng.integers(4))
        level, limit = old.level.copy(), self._settings.command_pct
        if kind == 0:
            level[at] = self._level(1)[0]
        elif kind == 1:
            level[at] = np.clip(level[at] + rng.normal(0.0, 0.25 * limit), -limit, limit).round(1)
        elif kind == 2 and at > 0:
            return replace(old, start=self._shifted(old.start, at))
        else:
            end = min(count, at + 1 + int(rng.integers(4)))
            level[at:end] = self._level(end - at)
        return replace(old, level=level)

    def _shifted(self, start: Ints, at: int) -> Ints:
        """Switch times with one moved between its neighbours, each level held for an allowed time."""
        shortest, longest = self._dwell
        before, after = int(start[at - 1]), int(np.append(start, self.samples)[at + 1])
        low, high = max(before + shortest, after - longest), min(after - shortest, before + longest)
        moved = start.copy()
        if low <= high:
            moved[at] = self._rng.integers(low, high + 1)
        return moved

    def _pose(self) -> Array:
        if self._any_pose and (not len(self._poses) or self._rng.random() < 0.75):
            return self._rng.uniform(self._lower, self._upper)
        return self._poses[self._rng.integers(len(self._poses))]

    def _moved(self, pose: Array) -> Array:
        if not self._any_pose:
            return self._pose()
        step = self._rng.normal(0.0, 0.1, len(pose)) * (self._upper - self._lower)
        return np.clip(pose + step, self._lower, self._upper)


def pose_limits(arm: Arm, margin: float) -> tuple[Array, Array]:
    """Lower and upper start angles [rad], shape (J,), `margin` [rad] inside the joints' ranges."""
    ranges = np.radians([joint.range for joint in arm.joints])
    inward = np.minimum(margin, 0.5 * np.ptp(ranges, axis=1))
    return ranges[:, 0] + inward, ranges[:, 1] - inward


def driven_joints(settings: FitSettings) -> list[int]:
    """Joints that may be driven, 0-based.

    Raises:
        SettingsError: one that the arm lacks, or that stage 1 has no gain for.
    """
    joints = sorted(settings.design.joints or settings.outputs)
    if joints[-1] > len(settings.arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(settings.arm.joints)}", where="design.joints")
    driven = np.isin(np.arange(len(settings.arm.joints)) + 1, joints)
    Stage(settings).refuse_idle(driven, [j - 1 for j in settings.outputs])
    return [j - 1 for j in joints]


def start_poses(settings: FitSettings) -> Array:
    """Named start poses [rad], shape (N, J), in which the joints that move are within their limits.

    Raises:
        SettingsError: a name that does not exist, or none is left.
    """
    design = settings.design
    names = tuple(settings.arm.poses) if design.poses is None or design.poses == "any" else design.poses
    poses = np.array([settings.arm.pose(name) for name in names])
    moving = [j - 1 for j in {*(design.joints or ()), *settings.outputs}]
    margin = np.radians(design.margin_deg)
    inside = (poses >= settings.arm.lower + margin) & (poses <= settings.arm.upper - margin)
    poses = poses[inside[:, moving].all(axis=1)]
    if not len(poses) and design.poses != "any":
        raise SettingsError(
            f"no pose of {', '.join(names)} is {design.margin_deg:g} deg inside the ranges of what moves",
            where="design.poses",
            hint="add one to the arm's file, reduce design.margin_deg, or set design.poses=any",
        )
    return poses
