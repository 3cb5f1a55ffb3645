"""Experiments: a start pose and pseudo-random commands, drawn, changed at random, kept within the limits.

A command is a sequence of levels, each held for a random time, as in the article's figure 17.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.problem.bindings import Bindings
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Input:
    """One joint's command: `level[i]` [%] from sample `start[i]` to the next, and none before the first."""

    start: Ints
    level: Array


@dataclass(frozen=True, eq=False)
class Experiment:
    """Start pose [rad], shape (J,), and the inputs of the driven joints, by joint (0-based)."""

    pose: Array
    inputs: Mapping[int, Input]

    def log(self, settings: FitSettings) -> Log:
        """Return commands without motion: every angle stays in the start pose."""
        period, slew = settings.log.period_s, settings.design.slew_pct_s
        samples = experiment_samples(settings)
        command = np.zeros((samples, len(self.pose)))
        for joint, signal in self.inputs.items():
            held = np.diff(np.append(signal.start, samples))
            command[signal.start[0] :, joint] = np.repeat(signal.level, held)
            if slew is not None:
                command[:, joint] = limited(command[:, joint], signal.start, slew * period)
        angle = np.tile(self.pose, (samples, 1))
        return Log("design", period * np.arange(samples, dtype=float), command, angle, period)

    def with_input(self, joint: int, signal: Input) -> "Experiment":
        """Return the experiment with another input of one joint."""
        return replace(self, inputs={**self.inputs, joint: signal})


def limited(command: Array, start: Ints, step: float) -> Array:
    """Return a command [%], shape (T,), that is constant between `start`s, with at most `step` per sample."""
    slow, value = command.copy(), 0.0
    for first, end in zip(start, np.append(start[1:], len(command)), strict=True):
        way = command[first] - value
        ramp = np.minimum(step * np.arange(1, end - first + 1), abs(way))
        slow[first:end] = value + np.sign(way) * ramp
        value = slow[end - 1]
    return slow


def experiment_samples(settings: FitSettings) -> int:
    """Return the number of samples of an experiment."""
    return round(settings.design.duration_s / settings.log.period_s) + 1


class RandomExperiments:
    """Draws experiments, and random changes of them, that the settings allow.

    Raises:
        SettingsError: joints or poses that cannot be used.
    """

    def __init__(self, settings: FitSettings, rng: np.random.Generator) -> None:
        limits, arm = settings.design, settings.arm
        self._rng, self._limit, self._any_pose = rng, limits.command_pct, limits.poses == "any"
        self._joints, self._poses = _driven_joints(settings), _start_poses(settings)
        ranges = np.radians([joint.range for joint in arm.joints])
        inward = np.minimum(np.radians(limits.margin_deg), 0.5 * np.ptp(ranges, axis=1))
        self._lower, self._upper = ranges[:, 0] + inward, ranges[:, 1] - inward
        self._samples, self._rest = experiment_samples(settings), round(limits.rest_s / settings.log.period_s)
        self._dwell = tuple(max(1, round(t / settings.log.period_s)) for t in limits.dwell_s)

    def draw(self) -> Experiment:
        """Draw an experiment: half of them drive all allowed joints, the others a random part of them."""
        some = self._rng.random(len(self._joints)) < 0.5
        driven = self._joints if self._rng.random() < 0.5 or not some.any() else np.array(self._joints)[some]
        return Experiment(self._pose(), {int(j): self._input() for j in driven})

    def change(self, experiment: Experiment) -> Experiment:
        """Change an experiment in one to three places."""
        for _ in range(int(self._rng.integers(1, 4))):
            kind = self._rng.random()
            if kind < 0.1:
                experiment = replace(experiment, pose=self._moved(experiment.pose))
            else:
                joint = int(self._rng.choice(self._joints))
                old = experiment.inputs.get(joint)
                new = self._input() if old is None or kind < 0.15 else self._changed(old)
                experiment = experiment.with_input(joint, new)
        return experiment

    def _input(self) -> Input:
        starts = [self._rest]
        while (begin := starts[-1] + int(self._rng.integers(self._dwell[0], self._dwell[1] + 1))) < (
            self._samples - self._dwell[0]
        ):
            starts.append(begin)
        return Input(np.array(starts), self._levels(len(starts)))

    def _levels(self, count: int) -> Array:
        return np.round(self._rng.uniform(-self._limit, self._limit, count), 1)

    def _changed(self, old: Input) -> Input:
        """Redraw or move one level, move one switching time, or redraw up to four levels in a row."""
        rng, count, limit = self._rng, len(old.level), self._limit
        at, kind = int(rng.integers(count)), int(rng.integers(4))
        level = old.level.copy()
        if kind == 0:
            level[at] = self._levels(1)[0]
        elif kind == 1:
            level[at] = np.clip(level[at] + rng.normal(0.0, 0.25 * limit), -limit, limit).round(1)
        elif kind == 2 and at > 0:
            return replace(old, start=self._shifted(old.start, at))
        else:
            end = min(count, at + 1 + int(rng.integers(4)))
            level[at:end] = self._levels(end - at)
        return replace(old, level=level)

    def _shifted(self, start: Ints, at: int) -> Ints:
        """Switching times with one moved between its neighbours, each level held for an allowed time."""
        shortest, longest = self._dwell
        before, after = int(start[at - 1]), int(np.append(start, self._samples)[at + 1])
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


def _driven_joints(settings: FitSettings) -> list[int]:
    """Joints that may be driven, 0-based; refuse one that the arm lacks, or that stage 1 has no gain for."""
    joints = sorted(settings.design.joints or settings.outputs)
    if joints[-1] > len(settings.arm.joints):
        raise SettingsError(f"the arm has joints 1 to {len(settings.arm.joints)}", where="design.joints")
    driven = np.isin(np.arange(len(settings.arm.joints)) + 1, joints)
    Bindings(settings).refuse_idle(driven, [j - 1 for j in settings.outputs])
    return [j - 1 for j in joints]


def _start_poses(settings: FitSettings) -> Array:
    """Named start poses [rad], shape (N, J), in which the joints that move are within their limits."""
    design, arm = settings.design, settings.arm
    names = tuple(arm.poses) if design.poses is None or design.poses == "any" else design.poses
    poses = np.array([arm.pose(name) for name in names])
    moving = [j - 1 for j in {*(design.joints or ()), *settings.outputs}]
    margin = np.radians(design.margin_deg)
    inside = (poses >= arm.lower + margin) & (poses <= arm.upper - margin)
    poses = poses[inside[:, moving].all(axis=1)]
    if not len(poses) and design.poses != "any":
        raise SettingsError(
            f"no pose of {', '.join(names)} is {design.margin_deg:g} deg inside the ranges of what moves",
            where="design.poses",
            hint="add one to the arm's file, reduce design.margin_deg, or set design.poses=any",
        )
    return poses


class Violation(NamedTuple):
    """The first sample at which a joint (0-based) leaves its range, is too fast, or makes bodies meet."""

    sample: int
    joint: int
    fast: bool


def violation(angle: Array, period: float, arm: Arm, limits: DesignSettings) -> Violation | None:
    """Return where a motion [rad], shape (T, J), first leaves the joints' ranges or is too fast; or None."""
    margin = np.radians(limits.margin_deg)
    speed = np.abs(np.diff(angle, axis=0, prepend=angle[:1])) / period
    out = (angle < arm.lower + margin) | (angle > arm.upper - margin)
    # a joint that stands at the end of its range, and never moves, breaks no limit
    out &= np.ptp(angle, axis=0) > 0
    at = np.argwhere(out | (speed > np.radians(limits.speed_deg_s)))
    if not len(at):
        return None
    sample, joint = map(int, at[0])
    return Violation(sample, joint, not out[sample, joint])


def repaired(experiment: Experiment, first: Violation, changes: Counter[tuple[int, int]]) -> Experiment:
    """Change the level before a violation, or an earlier one where all factors of it have been tried."""
    signal = experiment.inputs.get(first.joint)
    if signal is not None:
        # tried in turn on a level that makes a joint too fast, or leads out of its range
        factors = (0.7, 0.5, 0.35, 0.2, 0.0) if first.fast else (-1.0, 0.5, -0.5, 0.25, -0.25, 0.0)
        last = int(np.searchsorted(signal.start, first.sample - 1, side="right")) - 1
        for segment in range(last, -1, -1):
            tries = changes[first.joint, segment]
            if signal.level[segment] != 0.0 and tries < len(factors):
                # factors are of the level as drawn: undo the one before
                factor = factors[tries] / (factors[tries - 1] if tries else 1.0)
                changes[first.joint, segment] += 1
                level = signal.level.copy()
                level[segment] = round(factor * level[segment], 1)
                return experiment.with_input(first.joint, replace(signal, level=level))
    inputs = {j: replace(one, level=np.round(0.7 * one.level, 1)) for j, one in experiment.inputs.items()}
    return replace(experiment, inputs=inputs)
