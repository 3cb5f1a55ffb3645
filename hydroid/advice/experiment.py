"""Experiments: a start pose and pseudo-random commands, drawn and changed at random,
kept within the limits.

A command is a sequence of levels, each held for a random time, as in the article's
figure 17.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from hydroid.arrays import Array, Ints, Mask, record
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.problem.bindings import Bindings
from hydroid.settings.fit import FitSettings


class Input(NamedTuple):
    """One joint's command: `level[i]` [%] from sample `start[i]` to the next,
    and none before the first."""

    start: Ints
    level: Array


@record
class Experiment:
    """Start pose [rad], shape (J,), and the inputs of the driven joints, by joint
    (0-based)."""

    pose: Array
    inputs: Mapping[int, Input]

    def log(self, settings: FitSettings) -> Log:
        """Return commands without motion: every angle stays in the start pose."""
        period = settings.log.period_s
        slew = settings.design.slew_pct_s
        largest_step = np.inf
        if slew is not None:
            largest_step = slew * period
        samples = experiment_samples(settings)
        command = np.zeros((samples, len(self.pose)))
        for joint, signal in self.inputs.items():
            held = np.diff(np.append(signal.start, samples))
            command[signal.start[0] :, joint] = np.repeat(signal.level, held)
            command[:, joint] = _slewed(command[:, joint], largest_step)
        angle = np.tile(self.pose, (samples, 1))
        return Log(
            "design", period * np.arange(samples, dtype=float), command, angle, period
        )

    def with_level(
        self, joint: int, place: slice | int, level: Array | float
    ) -> "Experiment":
        """Return the experiment with other levels of one joint, rounded to 0.1 %."""
        signal = self.inputs[joint]
        levels = signal.level.copy()
        levels[place] = np.round(level, 1)
        inputs = {**self.inputs, joint: Input(signal.start, levels)}
        return replace(self, inputs=inputs)


def _slewed(command: Array, largest_step: float) -> Array:
    """Return a command, (T,), that follows another by steps of a largest size, from
    0."""

    def followed(now: float, wanted: float) -> float:
        return min(max(wanted, now - largest_step), now + largest_step)

    _, *commands = accumulate(command.tolist(), followed, initial=0.0)
    return np.array(commands)


def experiment_samples(settings: FitSettings) -> int:
    """Return the number of samples of an experiment."""
    return round(settings.design.duration_s / settings.log.period_s) + 1


class RandomExperiments:
    """Draws experiments, and random changes of them, that the settings allow."""

    def __init__(self, settings: FitSettings, rng: np.random.Generator) -> None:
        limits = settings.design
        arm = settings.arm
        period = settings.log.period_s
        self._rng = rng
        self._limit = limits.command_pct
        self._any_pose = limits.poses == "any"
        count = len(arm.joints)
        joints = sorted(limits.joints or settings.outputs)
        if joints[-1] > count:
            raise SettingsError(f"the arm has joints 1 to {count}", "design.joints")
        driven = np.isin(np.arange(count) + 1, joints)
        Bindings(settings).refuse_idle(driven, [j - 1 for j in settings.outputs])
        self._joints = np.flatnonzero(driven).tolist()
        self._poses = _possible_poses(settings)
        lower, upper = np.array([joint.limits for joint in arm.joints]).T
        inward = np.minimum(np.radians(limits.margin_deg), 0.5 * (upper - lower))
        self._lower = lower + inward
        # where the margins meet, rounding must not put the upper one below
        self._upper = np.maximum(upper - inward, self._lower)
        self._samples = experiment_samples(settings)
        self._rest = round(limits.rest_s / period)
        self._shortest, self._longest = (
            max(1, round(t / period)) for t in limits.dwell_s
        )

    def random(self) -> Experiment:
        """Draw an experiment: half of them drive all allowed joints,
        the others a random part of them."""
        some = self._rng.random(len(self._joints)) < 0.5
        driven = self._joints
        if self._rng.random() >= 0.5 and some.any():
            driven = np.array(self._joints)[some]
        return Experiment(self._pose(), {j: self._input() for j in driven})

    def change(self, experiment: Experiment) -> Experiment:
        """Change an experiment in one to three places: its pose, a joint's input,
        or some levels of it."""
        for _ in range(self._rng.integers(1, 4)):
            experiment = self._changed_once(experiment)
        return experiment

    def _changed_once(self, experiment: Experiment) -> Experiment:
        """Return an experiment with another pose, another input of a joint, levels a
        little off, or levels drawn anew."""
        kind = self._rng.random()
        joint = self._rng.choice(self._joints)
        if kind < 0.1:
            return replace(experiment, pose=self._moved(experiment.pose))
        if kind < 0.25 or joint not in experiment.inputs:
            inputs = {**experiment.inputs, joint: self._input()}
            return replace(experiment, inputs=inputs)
        level = experiment.inputs[joint].level
        first = self._rng.integers(len(level))
        place = slice(first, first + 1 + self._rng.integers(4))
        steps = self._rng.normal(0.0, 0.25 * self._limit)
        near = np.clip(level[place] + steps, -self._limit, self._limit)
        # drawn even where it is not taken: the generator's state is part of the result
        far = self._levels(len(near))
        if kind < 0.5:
            return experiment.with_level(joint, place, near)
        return experiment.with_level(joint, place, far)

    def _input(self) -> Input:
        """Draw levels and for how long each is held, after the rest."""
        starts = [self._rest]
        while True:
            lasts = self._rng.integers(self._shortest, self._longest + 1)
            start = starts[-1] + int(lasts)
            if start >= self._samples - self._shortest:
                return Input(np.array(starts), self._levels(len(starts)))
            starts.append(start)

    def _levels(self, count: int) -> Array:
        levels = self._rng.uniform(-self._limit, self._limit, count)
        # a tenth of a per cent is fine enough for whoever plays them
        return np.round(levels, 1)

    def _pose(self) -> Array:
        """Draw a start pose: a named one, or, where any is allowed, mostly one between
        the ends of the ranges."""
        if self._any_pose and (not len(self._poses) or self._rng.random() < 0.75):
            return self._rng.uniform(self._lower, self._upper)
        return self._poses[self._rng.integers(len(self._poses))]

    def _moved(self, pose: Array) -> Array:
        if not self._any_pose:
            return self._pose()
        share = self._rng.normal(0.0, 0.1, len(pose))
        step = share * (self._upper - self._lower)
        return np.clip(pose + step, self._lower, self._upper)


def _possible_poses(settings: FitSettings) -> Array:
    """Return the named poses in which the joints that move are within their limits
    [rad], (n, J).

    Raises SettingsError: there are none, and others are not allowed.
    """
    limits = settings.design
    arm = settings.arm
    names = limits.poses
    if names is None or names == "any":
        names = tuple(arm.poses)
    poses = np.array([arm.pose(name) for name in names])
    numbers = {*(limits.joints or ()), *settings.outputs}
    moving = [number - 1 for number in numbers]
    margin = np.radians(limits.margin_deg)
    inside = (poses >= arm.lower + margin) & (poses <= arm.upper - margin)
    possible = poses[inside[:, moving].all(axis=1)]
    if not len(possible) and limits.poses != "any":
        within = f"{limits.margin_deg:g} deg inside the ranges of what moves"
        raise SettingsError(
            f"no pose of {', '.join(names)} is {within}",
            "design.poses",
            "add one to the arm's file, reduce design.margin_deg, or set design.poses=any",
        )
    return possible


class Violation(NamedTuple):
    """A limit that a motion breaks: the first sample at which a joint (0-based) leaves
    its range, is too fast, or makes bodies meet."""

    sample: int
    joint: int
    fast: bool


def violation(angle: Array, settings: FitSettings) -> Violation | None:
    """Return where a motion [rad], shape (T, J), first leaves the joints' ranges or is
    too fast; or None."""
    outside, fast = beyond(angle, settings)
    broken = np.argwhere(outside | fast)
    if not len(broken):
        return None
    sample, joint = broken[0].tolist()
    return Violation(sample, joint, not outside[sample, joint])


def beyond(angle: Array, settings: FitSettings) -> tuple[Mask, Mask]:
    """Return where joints of a motion [rad], (T, J), are outside their ranges, and too
    fast: both (T, J)."""
    limits = settings.design
    arm = settings.arm
    margin, largest_speed = np.radians([limits.margin_deg, limits.speed_deg_s])
    way = np.abs(np.diff(angle, axis=0, prepend=angle[:1]))
    speed = way / settings.log.period_s
    outside = (angle < arm.lower + margin) | (angle > arm.upper - margin)
    # a joint that stands at the end of its range, and never moves, breaks no limit
    moves = np.ptp(angle, axis=0) > 0
    return outside & moves, speed > largest_speed


def repaired(experiment: Experiment, first: Violation) -> Experiment:
    """Reduce the last level before a violation; turn it round where it leads out of a
    range."""
    signal = experiment.inputs.get(first.joint)
    if signal is not None:
        is_earlier = signal.start < first.sample
        earlier = np.flatnonzero(is_earlier & (signal.level != 0.0))
        if len(earlier):
            last = earlier[-1]
            # less of what was too fast, and back from an end that came too near
            factor = 0.7 if first.fast else -0.7
            level = factor * signal.level[last]
            # below 10 % an earlier level is to blame
            if abs(level) <= 10.0:
                level = 0.0
            return experiment.with_level(first.joint, last, level)
    # nothing that the joint did led there: another one moved it
    for joint, signal in experiment.inputs.items():
        experiment = experiment.with_level(joint, slice(None), 0.7 * signal.level)
    return experiment
