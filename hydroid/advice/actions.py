"""What to do next: what each of several actions would add to what is known, by the Fisher information.

The fit knows C^-1 = G' G about relative changes of its free parameters. An action adds the information of one
more statement or of further measurements. These are simulated at the estimate, with the noise that the fit's
angles show: the model's own error is part of it, so the forecast is no better than the fit. As in a design,
every parameter has a prior of ±100 % (`PRIOR_SD`), so that all deviations are finite.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from hydroid.advice.commands import Experiment, Input, RandomExperiments
from hydroid.advice.information import ExperimentSimulator, Precision
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.axes import changed, covariance_axes, room
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.noise import Noise
from hydroid.problem.problem import Problem, compared_pressures
from hydroid.progress import Progress, no_progress
from hydroid.settings.fit import FitSettings

WEIGHED_SD = 0.02
"""relative standard deviation of a mass that was weighed (ours)"""
STATED_SD = 0.05
"""of a value from a data sheet or a measurement (ours)"""
PRESSURE_SD = 1e5
"""noise of a pressure gauge [Pa] (ours), with the correlation of the angles' residuals"""
PAYLOAD_PART = 0.1
"""mass in the gripper, as a part of the arm's"""
BANDS = ((10, 40), (40, 70), (70, 100))
"""constant commands to compare, lowest and highest [%]"""
LEVELS = 3
"""constant commands in a band, each in both directions"""
HOLD_S = 3.0
"""time that each is held, and the time of rest before it [s]"""
DRAWS = 6
"""random experiments, the best of which stands for the designed one, which is at least as good"""
_STAND_INS = ("gain", "damping", "stiffness")
"""in stage 1 they stand for the hydraulics: no data sheet has them"""
FEWEST_TIMES = 1.5
"""factor by which an action must improve a parameter to be listed"""
MOST = 3
"""actions of one kind that are listed"""


class ActionKind(StrEnum):
    """What can be done."""

    WEIGH = "weigh"
    """weigh a link; the subject is its parameter"""
    STATE = "state"
    """state a parameter's value from a data sheet"""
    MEASURE_JOINT = "measure joint"
    """compare the angle of another joint that the logs drive; the subject is its number"""
    MEASURE_PRESSURES = "measure pressures"
    """add the chamber pressures of the driven joints"""
    CONSTANT_COMMANDS = "constant commands"
    """add a log of constant commands; the subject is their range [%]"""
    PAYLOAD = "payload"
    """repeat the logs with a known mass in the gripper; the subject is the mass [kg]"""
    EXPERIMENT = "experiment"
    """run the designed experiment; the subject is its duration [s]"""


@dataclass(frozen=True)
class Action:
    """One action with its predicted effect.

    Attributes:
        kind: of action.
        subject: what it is about, as its kind says.
        total: number of free parameters.
        known: number of those known to WEAK_ABOVE, before and after.
        parameter: the one that improves most, but for the one that is stated.
        deviations: its relative standard deviation before and after.
        improvement: factor by which all deviations shrink on geometric average.
        quantity: the engineering quantity that improves most; empty where none does by FEWEST_TIMES.
        quantity_deviations: its relative standard deviation before and after.
    """

    kind: ActionKind
    subject: str
    total: int
    known: tuple[int, int]
    parameter: str
    deviations: tuple[float, float]
    improvement: float
    quantity: str
    quantity_deviations: tuple[float, float]


def next_actions(
    problem: Problem,
    uncertainty: Uncertainty,
    slopes: Mapping[str, Array],
    *,
    simulate: bool = True,
    progress: Progress = no_progress,
) -> tuple[Action, ...]:
    """Return the actions that would help, the best first; without `simulate` only statements of values.

    `slopes` are relative changes of quantities by name per relative change of the free parameters, (p,).
    """
    names = [n for n, free in zip(problem.parameters.names, uncertainty.free, strict=True) if free]
    forecast = _Forecasts(names, slopes, Precision(uncertainty.root.T @ uncertainty.root, np.eye(len(names))))
    at_bound = {n for n, s in zip(problem.parameters.names, uncertainty.status, strict=True) if s.at_bound}
    sources = [_statements(problem, names, at_bound)]
    if simulate:
        sources += [
            _further_channels(problem, uncertainty),
            _payload(problem, uncertainty),
            _experiments(problem, uncertainty),
        ]
    found: list[Action] = []
    for done, source in enumerate(sources):
        progress("actions", done, len(sources))
        found += [forecast.action(*each) for each in source]
    useful = [
        a
        for a in found
        if a.known[1] > a.known[0] or a.quantity or a.deviations[0] > FEWEST_TIMES * a.deviations[1]
    ]
    useful.sort(key=lambda a: (-a.known[1], -a.improvement))
    kept = [a for i, a in enumerate(useful) if sum(b.kind is a.kind for b in useful[:i]) < _most(a.kind)]
    return tuple(kept)


def _most(kind: ActionKind) -> int:
    """Of alternatives, such as bands of commands, only the best is listed."""
    return 1 if kind is ActionKind.CONSTANT_COMMANDS else MOST


@dataclass(frozen=True, eq=False)
class _Forecasts:
    """What information adds to parameters of some names, and to quantities."""

    names: Sequence[str]
    slopes: Mapping[str, Array]
    precision: Precision

    def action(self, kind: ActionKind, subject: str, added: Array) -> Action:
        """Return an action that adds information, shape (p, p)."""
        before, after = self.precision.deviations(), self.precision.deviations(added)
        known = int(np.sum(before <= WEAK_ABOVE)), int(np.sum(after <= WEAK_ABOVE))
        best = int(np.argmax(np.where([name == subject for name in self.names], 0.0, before / after)))
        shrunk = float(np.exp(np.mean(np.log(before / after))))
        return Action(
            kind,
            subject,
            len(self.names),
            known,
            self.names[best],
            (float(before[best]), float(after[best])),
            shrunk,
            *self._quantity(added),
        )

    def _quantity(self, added: Array) -> tuple[str, tuple[float, float]]:
        """Name of the quantity that improves most, with its relative standard deviation before and after."""
        if not self.slopes:
            return "", (0.0, 0.0)
        rows = np.array(list(self.slopes.values()))
        before, after = self.precision.spread(rows), self.precision.spread(rows, added)
        best = int(np.argmax(before / np.maximum(after, np.finfo(float).tiny)))
        name = list(self.slopes)[best] if before[best] > FEWEST_TIMES * after[best] else ""
        return name, (float(before[best]), float(after[best]))


Forecast = tuple[ActionKind, str, Array]
"""an action, its subject, and the information that it adds, shape (p, p)"""


def _statements(problem: Problem, names: Sequence[str], left_out: Collection[str]) -> Iterator[Forecast]:
    """A weighed link, or a value of a data sheet; 5 % of a value at its bound, such as 0, says nothing."""
    for i, name in enumerate(names):
        quantity = problem.settings.parameters[name].quantity
        if name in left_out or (problem.settings.stage == "mech" and quantity in _STAND_INS):
            continue
        mass = quantity == "mass"
        added = np.zeros((len(names), len(names)))
        added[i, i] = (WEIGHED_SD if mass else STATED_SD) ** -2
        yield ActionKind.WEIGH if mass else ActionKind.STATE, name, added


def _further_channels(problem: Problem, uncertainty: Uncertainty) -> Iterator[Forecast]:
    """Further signals of the same logs: angles of other driven joints, chamber pressures."""
    settings = problem.settings
    for joint in problem.active_joints:
        if joint not in settings.outputs:
            more = settings.model_copy(update={"outputs": (*settings.outputs, joint)})
            yield (
                ActionKind.MEASURE_JOINT,
                str(joint),
                _information(
                    Problem(more, problem.logs), uncertainty, lambda channel, j=joint: channel.joint == j
                ),
            )
    if settings.stage == "hyd" and not any(compared_pressures(log, settings) for log in problem.logs):
        objective = settings.objective.model_copy(update={"pressure_weight": 1.0})
        logs = [replace(log, pressure=np.zeros((*log.angle.shape, 2))) for log in problem.logs]
        more = Problem(settings.model_copy(update={"objective": objective}), logs)
        added = _information(more, uncertainty, lambda channel: channel.quantity != "angle")
        yield ActionKind.MEASURE_PRESSURES, "", added


def _payload(problem: Problem, uncertainty: Uncertainty) -> Iterator[Forecast]:
    """The same commands with a known mass in the gripper."""
    settings = problem.settings
    if settings.arm.payload is None or settings.payloads:
        return
    mass = round(PAYLOAD_PART * float(settings.arm.masses.sum()), 1)
    payloads = {Path(log.source).name: mass for log in problem.logs}
    more = Problem(settings.model_copy(update={"payloads": payloads}), problem.logs)
    yield ActionKind.PAYLOAD, f"{mass:g}", _information(more, uncertainty, lambda channel: True)


def _experiments(problem: Problem, uncertainty: Uncertainty) -> Iterator[Forecast]:
    """Constant commands, and the best of a few random experiments."""
    settings = _designing(problem, uncertainty)
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, uncertainty.theta)
    joint = settings.outputs[0] - 1
    for low, high in BANDS:
        experiment = _constant(problem.logs[0], joint, np.linspace(low, high, LEVELS), settings)
        trial = simulator.trial(experiment)
        if trial is not None:
            yield ActionKind.CONSTANT_COMMANDS, f"{low} to {high}", trial.information
    trials = [t for _ in range(DRAWS) if (t := simulator.trial(draws.draw())) is not None]
    if trials:
        precision = Precision(uncertainty.root.T @ uncertainty.root, np.eye(len(uncertainty.root)))
        best = max(trials, key=lambda t: precision.score(t.information, "D"))
        yield ActionKind.EXPERIMENT, f"{settings.design.duration_s:g}", best.information


def _designing(problem: Problem, uncertainty: Uncertainty) -> FitSettings:
    """Settings for experiments with the noise of the fit's worst angle."""
    angles = [
        (noise.level / channel.weight, noise.correlation_time * problem.logs[channel.log].period)
        for channel, noise in zip(problem.channels, uncertainty.noise, strict=True)
        if channel.quantity == "angle"
    ]
    level, time = max(angles)
    settings = problem.settings
    # what the best of a few could measure; hydroid design then looks for one free of collisions
    changes = {"noise_deg": float(np.degrees(level)), "noise_correlation_s": time, "clearance_m": None}
    design = settings.design.model_copy(update=changes)
    return settings.model_copy(update={"design": design})


def _constant(log: Log, joint: int, levels: Array, settings: FitSettings) -> Experiment:
    """Each level in both directions after a rest, from a log's start pose."""
    hold = round(HOLD_S / settings.log.period_s)
    steps = [value for level in levels for value in (0.0, level, 0.0, -level)]
    samples = round(settings.design.duration_s / settings.log.period_s) + 1
    starts = hold * np.arange(len(steps) + 1)
    inside = starts < samples
    return Experiment(log.start, {joint: Input(starts[inside], np.array([*steps, 0.0])[inside])})


def _information(problem: Problem, uncertainty: Uncertainty, chosen: Callable[..., bool]) -> Array:
    """Information of some channels of a problem at the estimate, (p, p), in plain least squares."""
    theta, free, scale = uncertainty.theta, uncertainty.free, uncertainty.jacobian.scale
    axes = covariance_axes(uncertainty.root, room(problem.parameters, theta, scale), step=1.0)
    steps = axes.steps[:, :1]  # to one side
    changes = np.zeros((len(steps), len(theta)))
    changes[:, free] = steps * axes.directions * scale[free]
    rows = problem.residuals(np.vstack([theta, changed(problem.parameters, theta, changes)]))
    slopes = axes.by_parameter(np.nan_to_num((rows[1:] - rows[0]) / steps))
    worst = max(uncertainty.noise, key=lambda noise: noise.level)
    total = np.zeros((len(slopes), len(slopes)))
    for channel in problem.channels:
        if chosen(channel):
            level = worst.level if channel.quantity == "angle" else PRESSURE_SD * channel.weight
            part = slopes[:, channel.rows]
            total += least_squares_information(part, Noise(part.shape[1], level, worst.reflection))
    return total


def least_squares_information(slopes: Array, noise: Noise) -> Array:
    """Inverse covariance of a least-squares estimate from derivatives, (p, T), with correlated noise.

    (J J') (J S J')^-1 (J J'), which is less than the Fisher information unless the noise is white.
    """
    directions, values, effects = np.linalg.svd(slopes, full_matrices=False)
    measured = values > 1e-9 * values.max(initial=0.0)
    directions, values, effects = directions[:, measured], values[measured], effects[measured]
    if not measured.any():
        return np.zeros((len(slopes), len(slopes)))
    root = directions * values
    return np.asarray(root @ np.linalg.pinv(noise.covariance_of(effects)) @ root.T, dtype=np.float64)
