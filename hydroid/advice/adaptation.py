"""Adaptation: a fit moved to a changed machine by a few of its parameters, all others held at its estimate.

Which few is found by trying: the one that lowers the error most on parts of the logs left out is freed, then
the next, until none lowers it by 5 %. Candidates are what all joints share, such as the pump and the
masses: what a load, a slower engine or another day changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydroid.advice.growth import Refit, refitted
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.noise import prior_weight
from hydroid.problem.problem import Problem
from hydroid.progress import Progress, no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import MultistartSettings, RefinementSettings


@dataclass(frozen=True)
class Step:
    """What freeing one more parameter does: rms error of the logs, and of their parts left out [deg]."""

    parameter: str
    rms_deg: float
    left_out_deg: float


def adapted(model: IdentifiedModel, free: Sequence[str]) -> FitSettings:
    """Return the settings in which only some parameters of a model are free, by name, from its estimate.

    Their priors stay as wide as they were, around the estimate.

    Raises:
        SettingsError: a name that does not exist, or a parameter with neither bounds nor a prior.
    """
    settings, values, parameters = model.settings, model.values, dict(model.settings.parameters)
    for name in free:
        if name not in parameters:
            raise SettingsError(f"no parameter {name!r}", where="--free", hint=f"one of {', '.join(values)}")
        if not parameters[name].can_be_free:
            raise SettingsError(f"{name} has neither bounds nor a prior", where="--free")
    for name, own in parameters.items():
        changes = {"term": None, "fixed": values[name]}
        if name in free:
            nominal = {"nominal": values[name]} if own.has_prior else {}
            changes = {"term": None, "fixed": None, "start": values[name]} | nominal
        parameters[name] = own.changed(changes)
    ladder = settings.simulation.model == "ladder"
    return settings.changed(
        {
            "parameters": parameters,
            "simulation.model": "quasi-static" if ladder else settings.simulation.model,
            "search.algorithm": "multistart",
            "search.multistart": MultistartSettings(starts=1, horizons=(), iterations=20),
            "refinement": settings.refinement or RefinementSettings(),
        }
    )


def steps(
    model: IdentifiedModel,
    logs: Sequence[Log],
    free: Sequence[str] = (),
    progress: Progress = no_progress,
) -> tuple[Step, ...]:
    """Return what freeing parameters one after another does, after the model as it is ("").

    `free` are those to be freed; without any, those that pay.
    """
    settings = model.settings
    pool = list(free) or [
        n
        for n, p in settings.parameters.items()
        if p.joints is None and p.can_be_free and (p.fixed is None or p.term is not None)
    ]
    problem = Problem(adapted(model, pool), logs)
    row = problem.residuals(model.theta[None])[0]
    rms = float(problem.rms(row[None])[0])
    taken, last = list[str](), Refit(model.theta, rms, rms)
    path = [Step("", *np.degrees((rms, rms)).tolist())]
    while pool:
        trials = dict[str, Refit]()
        for name in pool[:1] if free else pool:
            progress(f"freeing {name}", len(taken), len(taken) + len(pool))
            own, trial = problem.varied(adapted(model, [*taken, name])), last
            for _ in range(2):  # the noise, beside which priors count, is that of the adapted model
                row = own.residuals(trial.theta[None])[0]
                trial = refitted(own, trial.theta, prior_weight(own, row))
            trials[name] = trial
        best = min(trials, key=lambda name: trials[name].left_out)
        if not free and trials[best].left_out > 0.95 * last.left_out:
            break
        taken, last = [*taken, best], trials[best]
        pool.remove(best)
        path.append(Step(best, *np.degrees((last.rms, last.left_out)).tolist()))
    return tuple(path)
