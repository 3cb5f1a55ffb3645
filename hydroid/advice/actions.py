"""What to do next: what each of several actions would add to what is known, by the Fisher information.

An action adds the information of one more statement, or of further measurements, to the posterior of a fit.
Measurements are simulated at the estimate, with the noise that the angles of the fit show. The error of the
model is part of it, so the forecast is no better than the fit.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from hydroid.advice.commands import Experiment, Input, RandomExperiments
from hydroid.advice.information import ExperimentSimulator, forecast, measured
from hydroid.errors import SettingsError
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.posterior.noise import Noise
from hydroid.posterior.posterior import Posterior
from hydroid.problem.channels import Channel
from hydroid.problem.problem import Problem, compared_pressures
from hydroid.progress import Progress, no_progress
from hydroid.search.axes import differentiate
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

    `slopes` are relative changes of quantities by name per relative change of the parameters that vary, (p,).
    """
    known = forecast(uncertainty.posterior)
    names = [n for n, each in zip(problem.parameters.names, known.box.varied, strict=True) if each]
    sources = [_statements(problem, names)]
    if simulate:
        sources += [_further_channels(problem, uncertainty), _experiments(problem, uncertainty, known)]
    found: list[Action] = []
    for done, source in enumerate(sources):
        progress("actions", done, len(sources))
        found += [
            _action(kind, subject, (known, known.add(rows)), names, slopes) for kind, subject, rows in source
        ]
    useful = [
        a
        for a in found
        if a.known[1] > a.known[0] or a.quantity or a.deviations[0] > FEWEST_TIMES * a.deviations[1]
    ]
    useful.sort(key=lambda a: (-a.known[1], -a.improvement))
    # of alternatives, such as bands of commands, only the best is listed
    most = {ActionKind.CONSTANT_COMMANDS: 1}
    return tuple(
        a for i, a in enumerate(useful) if sum(b.kind is a.kind for b in useful[:i]) < most.get(a.kind, MOST)
    )


def _action(
    kind: ActionKind,
    subject: str,
    known: tuple[Posterior, Posterior],
    names: Sequence[str],
    slopes: Mapping[str, Array],
) -> Action:
    """Return an action from what is known before and after it."""
    before, after = (each.deviations for each in known)
    best = int(np.argmax(np.where(np.array(names) == subject, 0.0, before / after)))
    quantity, spread = "", (0.0, 0.0)
    if slopes:
        wide, narrow = (each.sd(np.array(list(slopes.values())).T) for each in known)
        most = int(np.argmax(wide / np.maximum(narrow, np.finfo(float).tiny)))
        spread = float(wide[most]), float(narrow[most])
        quantity = list(slopes)[most] if spread[0] > FEWEST_TIMES * spread[1] else ""
    return Action(
        kind,
        subject,
        len(names),
        (int(np.sum(before <= WEAK_ABOVE)), int(np.sum(after <= WEAK_ABOVE))),
        names[best],
        (float(before[best]), float(after[best])),
        float(np.exp(np.mean(np.log(before / after)))),
        quantity,
        spread,
    )


Forecast = tuple[ActionKind, str, Array]
"""an action, its subject, and rows of the information that it adds, shape (k, p)"""


def _statements(problem: Problem, names: Sequence[str]) -> Iterator[Forecast]:
    """A weighed link, or a value of a data sheet."""
    for name, row in zip(names, np.eye(len(names)), strict=True):
        quantity = problem.settings.parameters[name].quantity
        if problem.settings.stage == "mech" and quantity in _STAND_INS:
            continue
        if quantity == "mass":
            yield ActionKind.WEIGH, name, row[None] / WEIGHED_SD
        else:
            yield ActionKind.STATE, name, row[None] / STATED_SD


def _further_channels(problem: Problem, uncertainty: Uncertainty) -> Iterator[Forecast]:
    """Further signals of the same commands: angles of other driven joints, pressures, a known payload."""
    settings, logs = problem.settings, problem.logs
    for joint in problem.active_joints:
        if joint not in settings.outputs:
            more = Problem(settings.model_copy(update={"outputs": (*settings.outputs, joint)}), logs)
            rows = _gained(more, uncertainty, lambda channel, j=joint: channel.joint == j)
            yield ActionKind.MEASURE_JOINT, str(joint), rows
    if settings.stage == "hyd" and not any(compared_pressures(log, settings) for log in logs):
        objective = settings.objective.model_copy(update={"pressure_weight": 1.0})
        gauged = [replace(log, pressure=np.zeros((*log.angle.shape, 2))) for log in logs]
        more = Problem(settings.model_copy(update={"objective": objective}), gauged)
        rows = _gained(more, uncertainty, lambda channel: channel.quantity != "angle")
        yield ActionKind.MEASURE_PRESSURES, "", rows
    if settings.arm.payload is not None and not settings.payloads:
        mass = round(PAYLOAD_PART * float(settings.arm.masses.sum()), 1)
        payloads = {Path(log.source).name: mass for log in logs}
        more = Problem(settings.model_copy(update={"payloads": payloads}), logs)
        yield ActionKind.PAYLOAD, f"{mass:g}", _gained(more, uncertainty, lambda channel: True)


def _gained(problem: Problem, uncertainty: Uncertainty, chosen: Callable[[Channel], bool]) -> Array:
    """Return rows of the information of some channels of a problem at the estimate, (p, p)."""
    known = uncertainty.posterior
    kept = np.zeros((len(known.root), problem.measured.size))  # nothing is known along an axis that diverges
    slopes = differentiate(problem.residuals, known.box, known.axes(1.0).one_sided, former=kept)
    worst = max(uncertainty.noise, key=lambda noise: noise.level)

    def noise(channel: Channel) -> Noise:
        level = worst.level if channel.quantity == "angle" else PRESSURE_SD * channel.weight
        return Noise(len(channel.measured), level, worst.reflection)

    return measured((slopes[:, c.rows], noise(c)) for c in problem.channels if chosen(c))


def _experiments(problem: Problem, uncertainty: Uncertainty, known: Posterior) -> Iterator[Forecast]:
    """Constant commands, and the best of a few random experiments."""
    settings = _designing(problem, uncertainty)
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, known)
    joint = settings.outputs[0] - 1
    for low, high in BANDS:
        trial = simulator.trial(_constant(problem.logs[0], joint, np.linspace(low, high, LEVELS), settings))
        if trial is not None:
            yield ActionKind.CONSTANT_COMMANDS, f"{low} to {high}", trial.gained
    trials = [t for _ in range(DRAWS) if (t := simulator.trial(draws.draw())) is not None]
    if trials:
        best = max(trials, key=lambda t: float(np.sum(np.log(np.diag(known.add(t.gained).root)))))
        yield ActionKind.EXPERIMENT, f"{settings.design.duration_s:g}", best.gained


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
