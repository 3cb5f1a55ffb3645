"""What to measure next: what each of several actions would add to what is known, by the Fisher information.

An action adds the information of one more statement, or of one more log, to the posterior of a fit. The log
is simulated at the estimate, with the noise that the angles of the fit show. The error of the model is part
of it, so the forecast is no better than the fit.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from hydroid.advice.experiment import RandomExperiments
from hydroid.advice.information import ExperimentSimulator, forecast
from hydroid.errors import SettingsError
from hydroid.parameters import Array
from hydroid.posterior.posterior import Posterior
from hydroid.posterior.uncertainty import WEAK_ABOVE, Uncertainty
from hydroid.problem.problem import Problem

STATED_SD = {"weigh": 0.02, "state": 0.05}
"""relative standard deviation of a mass that was weighed, and of a value from a data sheet (ours)"""
FEWEST_TIMES = 1.5
"""factor by which an action must improve a parameter to be listed"""
MOST = 5
"""actions that are listed"""
Forecast = tuple[str, str, Array]
"""an action, its subject, and rows of the information that it adds, shape (k, p)"""


def next_actions(problem: Problem, known: Uncertainty) -> list[dict[str, Any]]:
    """Return the actions that would help most, the best first, as JSON has them (docs/json.md)."""
    now = forecast(known.posterior)
    names = np.array(problem.parameters.names)[now.box.varied]
    useful: list[tuple[int, float, dict[str, Any]]] = []
    for kind, subject, rows in (*_statements(problem, names.tolist()), *_experiment(problem, known, now)):
        wide, narrow = now.deviations, now.add(rows).deviations
        counts = [int(np.sum(each <= WEAK_ABOVE)) for each in (wide, narrow)]
        # the one that improves most, but for the one that is stated
        best = int(np.argmax(np.where(names == subject, 0.0, wide / narrow)))
        if counts[1] > counts[0] or wide[best] > FEWEST_TIMES * narrow[best]:
            action = {"action": kind, "of": subject, "known_before": counts[0], "known_after": counts[1]}
            action |= {"total": len(names), "parameter": str(names[best])}
            action |= {"before_percent": 100 * wide[best], "after_percent": 100 * narrow[best]}
            # by which all deviations shrink on geometric average
            useful.append((counts[1], float(np.mean(np.log(wide / narrow))), action))
    return [action for *_, action in sorted(useful, key=lambda one: one[:2], reverse=True)[:MOST]]


def _statements(problem: Problem, names: list[str]) -> Iterator[Forecast]:
    """A weighed link, or a value of a data sheet."""
    for name, row in zip(names, np.eye(len(names)), strict=True):
        quantity = problem.settings.parameters[name].quantity
        # in stage 1 these stand for the hydraulics: no data sheet has them
        if problem.settings.stage != "mech" or quantity not in ("gain", "damping", "stiffness"):
            kind = "weigh" if quantity == "mass" else "state"
            yield kind, name, row[None] / STATED_SD[kind]


def _experiment(problem: Problem, known: Uncertainty, now: Posterior) -> Iterator[Forecast]:
    """The best of six random experiments for the designed one, with the noise of the fit's worst angle."""
    level, time = max(
        (noise.level / channel.weight, noise.correlation_time * problem.logs[channel.log].period)
        for channel, noise in zip(problem.channels, known.noise, strict=True)
        if channel.quantity == "angle"
    )
    # what the best of a few could measure; hydroid design then looks for one free of collisions
    noise = {"noise_deg": float(np.degrees(level)), "noise_correlation_s": time}
    design = problem.settings.design.changed(noise | {"clearance_m": None})
    settings = problem.settings.changed({"design": design})
    try:
        draws = RandomExperiments(settings, np.random.default_rng(1))
    except SettingsError:
        return  # no pose that an experiment may start from: hydroid design says so
    simulator = ExperimentSimulator(settings, now)
    gained = [t.gained for _ in range(6) if (t := simulator.trial(draws.draw())) is not None]
    if gained:
        best = max(gained, key=lambda rows: float(np.sum(np.log(np.diag(now.add(rows).root)))))
        yield "experiment", f"{design.duration_s:g}", best
