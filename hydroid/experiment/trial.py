"""Experiments tried on the model: their motion, whether it keeps the limits, what it would tell.

Limits hold for the simulated response at the present estimate, and for nothing else: an arm that differs from
the model moves otherwise. Collisions of the arm with itself or with anything around it are not looked for.
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

REPAIRS = 60
"""changes of an experiment after which it is given up"""
TURNED = (-1.0, 0.5, -0.5, 0.25, -0.25, 0.0)
"""factors of a level that leads out of a joint's range, tried in turn: as an operator turns the arm round"""
SLOWED = (0.7, 0.5, 0.35, 0.2, 0.0)
"""the same for a joint that becomes too fast"""


@dataclass(frozen=True, eq=False)
class Trial:
    """An experiment that keeps the limits.

    information: about relative changes of the free parameters, shape (F, F). angle: simulated [rad] at the
    log's period, shape (T, J); joints that do not move stay in their pose.
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
    """Tries experiments on the model of one parameter set.

    Args:
        arm: the arm.
        settings: model, outputs, free parameters, and the limits in `design`.
        theta: the present estimate, shape (P,).
        period: of the commands [s].
        samples: length of an experiment.
    """

    def __init__(self, settings: FitSettings, theta: Array, period: float, samples: int) -> None:
        self._arm, self._spec, self._limits = (
            settings.arm,
            load_model(settings.arm.model, settings.arm),
            settings.design,
        )
        # joints that an analysis of a log would prescribe stand still in an experiment
        how = settings.simulation
        locked = how.model_copy(update={"other_joints": "locked"}) if how.other_joints == "measured" else how
        self._settings = settings.model_copy(update={"simulation": locked})
        self._outputs = [j - 1 for j in settings.outputs]
        self._period, self._samples = period, samples
        stage = Stage(settings)
        # one-sided: a fifth of the simulations of `jacobian`, and the same to a part in a thousand
        moved = theta + STEP * np.diag(relative_scale(stage.parameters, theta))[stage.parameters.free]
        self._noise = sensor_noise(settings.design, samples, period)
        self._members = stage.candidates(np.vstack([theta, moved]))

    def kept(self, experiment: Experiment) -> tuple[Experiment, Array] | None:
        """Return the experiment, levels turned round or reduced until it keeps the limits, and its motion.

        None where it leaves them all the same, or its simulation diverges.
        """
        blamed: Counter[tuple[int, int]] = Counter()
        for _ in range(REPAIRS):
            angle = self._simulate(experiment, 1)
            if angle is None:
                return None
            found = violation(angle[0], self._period, self._arm, self._limits)
            if found is None:
                return experiment, angle[0]
            if found.sample == 0:
                return None  # the start pose itself
            experiment = _repaired(experiment, found, blamed)
        return None

    def trial(self, experiment: Experiment) -> Trial | None:
        """Return what an experiment would tell, changed to keep the limits; None where it cannot."""
        kept = self.kept(experiment)
        told = None if kept is None else self.told(kept[0])
        return None if kept is None or told is None else Trial(kept[0], told, kept[1])

    def told(self, experiment: Experiment) -> Array | None:
        """Return the information of an experiment as it is, shape (F, F); None where it diverges."""
        rows = self._simulate(experiment, len(self._members))
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
        response = simulation.simulate(self._members[:candidates])
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


def _repaired(experiment: Experiment, found: Violation, blamed: Counter[tuple[int, int]]) -> Experiment:
    """Change the level that led to a violation, or the one before it once that has come to nothing."""
    signal = experiment.inputs.get(found.joint)
    if signal is not None:
        factors = SLOWED if found.fast else TURNED
        last = int(np.searchsorted(signal.start, found.sample - 1, side="right")) - 1
        for segment in range(last, -1, -1):
            tries = blamed[found.joint, segment]
            if signal.level[segment] == 0.0 or tries >= len(factors):
                continue
            # factors are of the level as drawn: undo the one before
            before = factors[tries - 1] if tries else 1.0
            blamed[found.joint, segment] += 1
            return experiment.with_level(
                found.joint, segment, factors[tries] / before * signal.level[segment]
            )
    return experiment.scaled(0.7)
