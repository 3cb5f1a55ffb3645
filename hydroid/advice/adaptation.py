"""Adaptation: a fit moved to a changed machine by a few of its parameters, all others held at its estimate.

Which few is found by trying: the one whose fit foretells parts of the logs left out best is freed, then the
next, until none foretells them clearly better (`fitting.left_out`).
Candidates are what all joints share, such as the pump and the masses, and the effects of the logs' groups:
what a load, a slower engine or another day changes.
"""

from collections.abc import Sequence

import numpy as np

from hydroid.advice.suggestions import refitted
from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.left_out import LeftOut, gain, is_better, parts, predict_parts
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import log_file
from hydroid.settings.search import MultistartSettings, RefinementSettings


def adapted(model: IdentifiedModel, free: Sequence[str], logs: Sequence[Log] = ()) -> FitSettings:
    """Return the settings in which only some parameters of a model are free, by name, from its estimate.

    Their priors stay as wide as they were, around the estimate. Of the payloads those of these logs stay.
    Raises SettingsError: a name that is none of a parameter with bounds or a prior.
    """
    settings, parameters = model.settings, dict(model.settings.parameters)
    possible = [name for name, own in parameters.items() if own.can_be_free]
    for name in free:
        if name not in possible:
            what = f"no parameter {name!r} has bounds or a prior"
            raise SettingsError(what, "--free", f"one of {', '.join(possible)}")
    for name, own in parameters.items():
        value = model.values[name]
        freed = {"fixed": None, "start": value} | ({"nominal": value} if own.has_prior else {})
        parameters[name] = own.changed({"term": None} | (freed if name in free else {"fixed": value}))
    names = {log_file(log.source).name for log in logs}
    ladder = settings.simulation.model == "ladder"
    return settings.changed(
        {
            "parameters": parameters,
            "payloads": {name: mass for name, mass in settings.payloads.items() if name in names},
            "simulation.model": "quasi-static" if ladder else settings.simulation.model,
            "search.algorithm": "multistart",
            "search.multistart": MultistartSettings(starts=1, horizons=(), iterations=20),
            "refinement": settings.refinement or RefinementSettings(),
        }
    )


def steps(
    model: IdentifiedModel, logs: Sequence[Log], free: Sequence[str], progress: Progress
) -> list[Plain]:
    """Return what freeing parameters one after another does, after the model as it is (""), as JSON has it.

    `free` are those to be freed; without any, those that pay. Errors are those of parts of the logs left out.
    """
    groups = {model.settings.log.group_of(log.source) for log in logs}
    pool = list(free) or [
        name
        for name, p in model.settings.parameters.items()
        if (p.joints is None if p.per is None else p.per in groups)
        and p.can_be_free
        and (p.fixed is None or p.term is not None)
    ]
    problem, taken = Problem(adapted(model, pool, logs), logs), list[str]()
    last = _as_it_is(problem, model)
    path = list[Plain]()
    name = ""
    while True:
        path.append({"parameter": name, "left_out_deg": last.by_joint})
        trials = dict[str, LeftOut]()
        for trial in pool[:1] if free else pool:
            progress(f"freeing {trial}", len(taken), len(taken) + len(pool))
            own = problem.varied(adapted(model, [*taken, trial], logs))
            trials[trial] = predict_parts(own, last.thetas, refitted)
        rises = {trial: gain(one, last)[0] for trial, one in trials.items()}
        name = max(rises, key=lambda trial: rises[trial], default="")
        if not name or (not free and not is_better(trials[name], last)):
            return path
        taken, last = [*taken, name], trials[name]
        pool.remove(name)


def _as_it_is(problem: Problem, model: IdentifiedModel) -> LeftOut:
    """Return what a model that is not fitted to them makes of the parts of the logs."""
    errors = problem.output_errors(model.theta[None])[0]
    thetas = np.tile(model.theta, (len(np.unique(parts(problem))), 1))
    return LeftOut(problem, thetas, errors)


def load_findings(settings: FitSettings) -> tuple[Finding, ...]:
    """Return which masses an adaptation has freed, although a load at the tip has no payload to be in."""
    own = settings.parameters.items()
    freed = tuple(name for name, p in own if p.quantity == "mass" and p.fixed is None)
    return (Finding("load as mass", "warning", freed),) if freed and not settings.payloads else ()
