"""What to do next: what each of several actions would add to what is known, by the Fisher information.

An action adds the information of one more statement, or of further measurements, to the posterior of a fit.
Measurements are simulated at the estimate, with the noise that the angles of the fit show. The error of the
model is part of it, so the forecast is no better than the fit.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.advice.commands import Experiment, Input, RandomExperiments, experiment_samples
from hydroid.advice.information import ExperimentSimulator, forecast, measured
from hydroid.errors import SettingsError
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

STATED_SD = {"weigh": 0.02, "state": 0.05}
"""relative standard deviation of a mass that was weighed, and of a value from a data sheet (ours)"""
FEWEST_TIMES = 1.5
"""factor by which an action must improve a parameter or a quantity to be listed"""
Forecast = tuple[str, str, Array]
"""an action, its subject, and rows of the information that it adds, shape (k, p)"""


def next_actions(
    problem: Problem,
    uncertainty: Uncertainty,
    slopes: Mapping[str, Array],
    *,
    simulate: bool = True,
    progress: Progress = no_progress,
) -> list[dict[str, Any]]:
    """Return the actions that would help, the best first, as JSON has them (docs/json.md).

    Of alternatives, such as bands of commands, only the best is listed.

    Args:
        problem: that was fitted.
        uncertainty: of its estimate.
        slopes: relative changes of quantities by name, per relative change of the parameters that vary, (p,).
        simulate: whether to forecast measurements too, beside statements of values.
        progress: takes how many kinds are done.
    """
    known = forecast(uncertainty.posterior)
    names = np.array(problem.parameters.names)[known.box.varied]
    sources = [_statements(problem, names.tolist())]
    if simulate:
        sources += [_further_channels(problem, uncertainty), _experiments(problem, uncertainty, known)]
    useful: list[tuple[int, float, dict[str, Any]]] = []
    for done, source in enumerate(sources):
        progress("actions", done, len(sources))
        for kind, subject, rows in source:
            after = known.add(rows)
            wide, narrow = known.deviations, after.deviations
            counts = [int(np.sum(each <= WEAK_ABOVE)) for each in (wide, narrow)]
            # the one that improves most, but for the one that is stated
            best = int(np.argmax(np.where(names == subject, 0.0, wide / narrow)))
            action = {"action": kind, "of": subject, "known_before": counts[0], "known_after": counts[1]}
            action |= {"total": len(names)} | _falls("parameter", names[best], wide[best], narrow[best])
            quantity = _quantity(slopes, known, after)
            if counts[1] > counts[0] or quantity["quantity"] or wide[best] > FEWEST_TIMES * narrow[best]:
                # that by which all deviations shrink on geometric average
                gain = float(np.mean(np.log(wide / narrow)))
                useful.append((counts[1], gain, action | quantity))
    useful.sort(key=lambda one: one[:2], reverse=True)
    kinds = [action["action"] for _, _, action in useful]
    most = {"constant commands": 1}
    return [
        action
        for i, (_, _, action) in enumerate(useful)
        if kinds[:i].count(action["action"]) < most.get(action["action"], 3)
    ]


def _falls(what: str, name: str | None, before: float = 0.0, after: float = 0.0) -> dict[str, Any]:
    """What improves, with its relative standard deviations [%]."""
    start = "" if what == "parameter" else f"{what}_"
    percent = (None, None) if name is None else (100 * float(before), 100 * float(after))
    return {what: name, f"{start}before_percent": percent[0], f"{start}after_percent": percent[1]}


def _quantity(slopes: Mapping[str, Array], known: Posterior, after: Posterior) -> dict[str, Any]:
    """The engineering quantity that improves most; none where none does by FEWEST_TIMES."""
    if slopes:
        wide, narrow = (each.sd(np.array(list(slopes.values())).T) for each in (known, after))
        most = int(np.argmax(wide / np.maximum(narrow, np.finfo(float).tiny)))
        if wide[most] > FEWEST_TIMES * narrow[most]:
            return _falls("quantity", list(slopes)[most], wide[most], narrow[most])
    return _falls("quantity", None)


def _statements(problem: Problem, names: list[str]) -> Iterator[Forecast]:
    """A weighed link, or a value of a data sheet."""
    for name, row in zip(names, np.eye(len(names)), strict=True):
        quantity = problem.settings.parameters[name].quantity
        # in stage 1 these stand for the hydraulics: no data sheet has them
        if problem.settings.stage != "mech" or quantity not in ("gain", "damping", "stiffness"):
            kind = "weigh" if quantity == "mass" else "state"
            yield kind, name, row[None] / STATED_SD[kind]


def _further_channels(problem: Problem, uncertainty: Uncertainty) -> Iterator[Forecast]:
    """Further signals of the same commands: angles of other driven joints, pressures, a known payload."""
    settings, logs = problem.settings, problem.logs
    for joint in problem.active_joints:
        if joint not in settings.outputs:
            more = Problem(settings.model_copy(update={"outputs": (*settings.outputs, joint)}), logs)
            rows = _gained(more, uncertainty, lambda channel, j=joint: channel.joint == j)
            yield "measure joint", str(joint), rows
    if settings.stage == "hyd" and not any(compared_pressures(log, settings) for log in logs):
        objective = settings.objective.model_copy(update={"pressure_weight": 1.0})
        gauged = [replace(log, pressure=np.zeros((*log.angle.shape, 2))) for log in logs]
        more = Problem(settings.model_copy(update={"objective": objective}), gauged)
        rows = _gained(more, uncertainty, lambda channel: channel.quantity != "angle")
        yield "measure pressures", "", rows
    if settings.arm.payload is not None and not settings.payloads:
        mass = round(0.1 * float(settings.arm.masses.sum()), 1)  # a tenth of the arm's
        payloads = {Path(log.source).name: mass for log in logs}
        more = Problem(settings.model_copy(update={"payloads": payloads}), logs)
        yield "payload", f"{mass:g}", _gained(more, uncertainty, lambda channel: True)


def _gained(problem: Problem, uncertainty: Uncertainty, chosen: Callable[[Channel], bool]) -> Array:
    """Return rows of the information of some channels of a problem at the estimate, (p, p)."""
    known = uncertainty.posterior
    kept = np.zeros((len(known.root), problem.measured.size))  # nothing is known along an axis that diverges
    slopes = differentiate(problem.residuals, known.box, known.axes(1.0).one_sided, former=kept)
    worst = max(uncertainty.noise, key=lambda noise: noise.level)

    def noise(channel: Channel) -> Noise:
        # a pressure gauge has a noise of 1 bar (ours), with the correlation of the angles' residuals
        level = worst.level if channel.quantity == "angle" else 1e5 * channel.weight
        return Noise(len(channel.measured), level, worst.reflection)

    return measured((slopes[:, c.rows], noise(c)) for c in problem.channels if chosen(c))


def _experiments(problem: Problem, uncertainty: Uncertainty, known: Posterior) -> Iterator[Forecast]:
    """Constant commands in three bands, and the best of six random experiments for the designed one."""
    settings = _designing(problem, uncertainty)
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, known)
    for low, high in ((10, 40), (40, 70), (70, 100)):
        trial = simulator.trial(_constant(problem, settings, np.linspace(low, high, 3)))
        if trial is not None:
            yield "constant commands", f"{low} to {high}", trial.gained
    trials = [t for _ in range(6) if (t := simulator.trial(draws.draw())) is not None]
    if trials:
        best = max(trials, key=lambda t: float(np.sum(np.log(np.diag(known.add(t.gained).root)))))
        yield "experiment", f"{settings.design.duration_s:g}", best.gained


def _designing(problem: Problem, uncertainty: Uncertainty) -> FitSettings:
    """Settings for experiments with the noise of the fit's worst angle."""
    level, time = max(
        (noise.level / channel.weight, noise.correlation_time * problem.logs[channel.log].period)
        for channel, noise in zip(problem.channels, uncertainty.noise, strict=True)
        if channel.quantity == "angle"
    )
    # what the best of a few could measure; hydroid design then looks for one free of collisions
    changes = {"noise_deg": float(np.degrees(level)), "noise_correlation_s": time, "clearance_m": None}
    design = problem.settings.design.model_copy(update=changes)
    return problem.settings.model_copy(update={"design": design})


def _constant(problem: Problem, settings: FitSettings, levels: Array) -> Experiment:
    """Each level [%] of the first output both ways, for 3 s after 3 s of rest, from the logs' start pose."""
    hold = round(3.0 / settings.log.period_s)
    steps = np.array([value for level in levels for value in (0.0, level, 0.0, -level)] + [0.0])
    starts = hold * np.arange(len(steps))
    inside = starts < experiment_samples(settings)
    return Experiment(problem.logs[0].start, {settings.outputs[0] - 1: Input(starts[inside], steps[inside])})
