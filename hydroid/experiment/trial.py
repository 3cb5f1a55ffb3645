"""Experiments simulated at the present estimate: motion, limits, information.

Only the simulated motion is kept within the limits; an arm that differs from the model moves differently.
Collisions of the arm with itself or with its surroundings are not checked.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from hydroid.arm.model import load_model
from hydroid.experiment.commands import Experiment
from hydroid.experiment.information import information, sensor_noise
from hydroid.parameters import Array
from hydroid.problem.problem import make_simulation
from hydroid.problem.stage import Stage
from hydroid.settings.arm import Arm
from hydroid.settings.experiment import DesignSettings
from hydroid.settings.fit import FitSettings
from hydroid.uncertainty.jacobian import STEP, relative_scale

MAX_REPAIRS = 60
"""changes of an experiment after which it is given up"""
RANGE_FACTORS = (-1.0, 0.5, -0.5, 0.25, -0.25, 0.0)
"""factors tried in turn on a level that leads out of a joint's range"""
SPEED_FACTORS = (0.7, 0.5, 0.35, 0.2, 0.0)
"""factors tried in turn on a level that makes a joint too fast"""


@dataclass(frozen=True, eq=False)
class Trial:
    """An experiment that keeps the limits.

    Attributes:
        experiment: its commands.
        information: about relative changes of the free parameters, shape (F, F).
        angle: simulated [rad] at the log's period, shape (T, J); joints that do not move stay in their pose.
    """

    experiment: Experiment
    information: Array
    angle: Array


@dataclass(frozen=True)
class Violation:
    """The first sample at which a joint (0-based) leaves its limits."""

    sample: int
    joint: int
    fast: bool


class Bench:
    """Simulates experiments at one parameter vector.

    Args:
        settings: model, outputs, free parameters, and the limits in `design`.
        theta: the present estimate, shape (P,).
        period: of the commands [s].
        samples: length of an experiment.
    """

    def __init__(self, settings: FitSettings, theta: Array, period: float, samples: int) -> None:
        self._spec = load_model(settings.arm.model, settings.arm)
        if settings.simulation.other_joints == "measured":  # an experiment has no measured motion
            simulation = settings.simulation.model_copy(update={"other_joints": "locked"})
            settings = settings.model_copy(update={"simulation": simulation})
        self._settings = settings
        self._outputs = [j - 1 for j in settings.outputs]
        self._period, self._samples = period, samples
        stage = Stage(settings)
        # one-sided differences take a quarter of the simulations of `jacobian` and agree to 0.1 %
        moved = theta + STEP * np.diag(relative_scale(stage.parameters, theta))[stage.parameters.free]
        self._noise = sensor_noise(settings.design, samples, period)
        self._candidates = stage.candidates(np.vstack([theta, moved]))

    def kept(self, experiment: Experiment) -> tuple[Experiment, Array] | None:
        """Return the experiment with levels reversed or reduced until it keeps the limits, and its motion.

        None where it still leaves them, or its simulation diverges.
        """
        changes: Counter[tuple[int, int]] = Counter()
        for _ in range(MAX_REPAIRS):
            angle = self._simulate(experiment, 1)
            if angle is None:
                return None
            first = violation(angle[0], self._period, self._settings.arm, self._settings.design)
            if first is None:
                return experiment, angle[0]
            if first.sample == 0:
                return None  # the start pose itself
            experiment = _repaired(experiment, first, changes)
        return None

    def trial(self, experiment: Experiment) -> Trial | None:
        """Return the experiment, changed to keep the limits, with its information; None where it cannot."""
        if (kept := self.kept(experiment)) is None:
            return None
        gained = self.information(kept[0])
        return None if gained is None else Trial(kept[0], gained, kept[1])

    def information(self, experiment: Experiment) -> Array | None:
        """Return the information of an experiment as it is, shape (F, F); None where it diverges."""
        rows = self._simulate(experiment, len(self._candidates))
        if rows is None:
            return None
        outputs = rows[:, :, self._outputs]
        slopes = (outputs[1:] - outputs[0]) / STEP
        parts = [information(slopes[:, :, k], self._noise) for k in range(len(self._outputs))]
        return np.sum(parts, axis=0)

    def _simulate(self, experiment: Experiment, candidates: int) -> Array | None:
        """Angles of all joints [rad], shape (candidates, T, J); None where a candidate diverged."""
        log = experiment.log(self._samples, self._period)
        passive = self._settings.simulation.other_joints == "passive"
        moving = np.flatnonzero(log.driven | passive | np.isin(np.arange(log.joints), self._outputs))
        simulation = make_simulation(self._spec, log, moving.tolist(), self._settings)
        response = simulation.simulate(self._candidates[:candidates])
        if not response.feasible.all():
            return None
        angle = np.tile(log.angle, (candidates, 1, 1))
        angle[:, :, moving] = response.angle
        return angle


def violation(angle: Array, period: float, arm: Arm, limits: DesignSettings) -> Violation | None:
    """Return where a motion [rad], shape (T, J), first leaves the joints' ranges or is too fast; or None."""
    margin = np.radians(limits.margin_deg)
    speed = np.abs(np.diff(angle, axis=0, prepend=angle[:1])) / period
    out = (angle < arm.lower + margin) | (angle > arm.upper - margin)
    # a joint that stands at the end of its range, and never moves, breaks no limit
    out &= np.ptp(angle, axis=0) > 0
    fast = speed > np.radians(limits.speed_deg_s)
    at = np.argwhere(out | fast)
    if not len(at):
        return None
    sample, joint = map(int, at[0])
    return Violation(sample, joint, not out[sample, joint])


def _repaired(experiment: Experiment, first: Violation, changes: Counter[tuple[int, int]]) -> Experiment:
    """Change the level before a violation, or the one before that where no factor of it has helped."""
    signal = experiment.inputs.get(first.joint)
    if signal is not None:
        factors = SPEED_FACTORS if first.fast else RANGE_FACTORS
        last = int(np.searchsorted(signal.start, first.sample - 1, side="right")) - 1
        for segment in range(last, -1, -1):
            tries = changes[first.joint, segment]
            if signal.level[segment] == 0.0 or tries >= len(factors):
                continue
            # factors are of the level as drawn: undo the one before
            before = factors[tries - 1] if tries else 1.0
            changes[first.joint, segment] += 1
            return experiment.with_level(
                first.joint, segment, factors[tries] / before * signal.level[segment]
            )
    return experiment.scaled(0.7)
