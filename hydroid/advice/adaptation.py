"""Adaptation: a fit moved to a changed machine by a few of its parameters,
all others held at its estimate.

Which few is found by trying: the one whose fit foretells parts of the logs left out
best is freed, then the next, until none foretells them clearly better
(`fitting.left_out`). Candidates are what all joints share, such as the pump and the
masses, the effects of the logs' groups, and a load at the tip: what a load, a slower
engine or another day changes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.left_out import LeftOut, gain, is_better, not_fitted, refit
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.progress import Progress
from hydroid.settings.arm import TIP_LOAD
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings
from hydroid.settings.search import MultistartSettings, RefinementSettings

LEAST_LOAD = 1e-9
"""part of the arm's mass that is no load: a mass must be above 0"""
FIRST_LOAD = 0.03
"""part of the arm's mass from which a load is sought"""


def adapted(
    model: IdentifiedModel, free: Sequence[str], logs: Sequence[Log] = ()
) -> FitSettings:
    """Return the settings in which only some parameters of a model are free, by name,
    from its estimate.

    Their priors stay as wide as they were, around the estimate. Of the payloads those
    of these logs stay.

    Raises SettingsError: a name that is none of a parameter with bounds or a prior.
    """
    if TIP_LOAD in free:
        model = carrying(model)
    settings = model.settings
    _refuse_unknown(free, settings)
    parameters: dict[str, ParameterSettings] = {}
    for name, parameter in settings.parameters.items():
        value = model.values[name]
        changes: Plain = {"term": None, "fixed": value}
        if name in free:
            start = value
            if name == TIP_LOAD:
                start = first_guess(model)
            changes |= {"fixed": None, "start": start}
            if parameter.has_prior:
                changes["nominal"] = value
        parameters[name] = parameter.changed(changes)
    names = {settings.payload_name(log.source) for log in logs}
    kept = {name: mass for name, mass in settings.payloads.items() if name in names}
    # a ladder that kept its first model: the others are not tried again
    return settings.on(settings.rung).changed(
        {
            "parameters": parameters,
            "payloads": kept,
            "search.algorithm": "multistart",
            # a search in name only: the refinement goes on from the fit's own estimate
            "search.multistart": MultistartSettings(
                starts=1, horizons=(), iterations=20
            ),
            "refinement": settings.refinement or RefinementSettings(),
        }
    )


def carrying(model: IdentifiedModel) -> IdentifiedModel:
    """Return a model that can carry a load at its tip: its last parameter is the mass
    of it, held at next to nothing."""
    settings = model.settings
    if TIP_LOAD in settings.parameters:
        return model
    most = float(settings.arm.masses.sum())
    none = LEAST_LOAD * most
    load = ParameterSettings(
        quantity="mass", link=TIP_LOAD, bounds=(none, most), fixed=none
    )
    loaded = settings.changed({"arm.load": none}).with_parameters({TIP_LOAD: load})
    return replace(
        model, settings=loaded, theta=np.append(model.theta, none), summary=None
    )


def first_guess(model: IdentifiedModel) -> float:
    """Return the load from which one is sought [kg]."""
    return FIRST_LOAD * float(model.settings.arm.masses.sum())


def _refuse_unknown(names: Sequence[str], settings: FitSettings) -> None:
    """Refuse names of no parameter that could be free."""
    possible = [name for name, p in settings.parameters.items() if p.can_be_free]
    for name in names:
        if name not in possible:
            what = f"no parameter {name!r} that could be free"
            raise SettingsError(what, "--free", f"choose from {', '.join(possible)}")


def steps(
    model: IdentifiedModel, logs: Sequence[Log], free: Sequence[str], progress: Progress
) -> list[Plain]:
    """Return what freeing parameters one after another does, after the model as it is
    (""), as JSON has it.

    `free` are those to be freed; without any, those that pay.
    Errors are those of parts of the logs left out.
    """
    pool = list(free) or [*_candidates(model.settings, logs), TIP_LOAD]
    if TIP_LOAD in pool:
        model = carrying(model)
    problem = Problem(adapted(model, pool, logs), logs)
    taken = list[str]()
    last = _as_it_is(problem, model)
    path: list[Plain] = [{"parameter": "", "left_out_deg": last.by_joint}]
    while pool:
        # parameters that are asked for are freed in their order
        tried = pool[:1] if free else pool
        trials = dict[str, LeftOut]()
        for name in tried:
            progress(f"freeing {name}", len(taken), len(taken) + len(pool))
            freed = problem.varied(adapted(model, [*taken, name], logs))
            trials[name] = refit(freed, _begun(model, last, name))
        rises = {name: gain(trial, last)[0] for name, trial in trials.items()}
        best = max(rises, key=rises.__getitem__)
        if not free and not is_better(trials[best], last, len(trials)):
            break
        last = trials[best]
        path.append({"parameter": best, "left_out_deg": last.by_joint})
        taken.append(best)
        pool.remove(best)
    return path


def _begun(model: IdentifiedModel, last: LeftOut, name: str) -> Array:
    """Return where a fit with another free parameter begins, shape (P,): where the last
    one ended, and a load at the tip at a first guess."""
    begun = last.theta.copy()
    if name == TIP_LOAD:
        begun[-1] = first_guess(model)
    return begun


def _candidates(settings: FitSettings, logs: Sequence[Log]) -> list[str]:
    """Return the parameters that another day may change: those that all joints share,
    and the effects of the logs' groups."""
    groups = {settings.log.group_of(log.source) for log in logs}
    names = list[str]()
    for name, parameter in settings.parameters.items():
        is_effect = parameter.per is not None
        changes = parameter.per in groups if is_effect else parameter.joints is None
        estimated = parameter.fixed is None or parameter.term is not None
        if changes and estimated and parameter.can_be_free:
            names.append(name)
    return names


def _as_it_is(problem: Problem, model: IdentifiedModel) -> LeftOut:
    """Return what a model that is not fitted to them makes of the parts of the logs."""
    errors = problem.output_errors(model.theta[None])[0]
    return not_fitted(problem, model.theta, errors)


def load_findings(settings: FitSettings) -> tuple[Finding, ...]:
    """Return which masses an adaptation has freed,
    although a load at the tip has no payload to be in."""
    parameters = settings.parameters.items()
    freed = tuple(
        name for name, p in parameters if p.quantity == "mass" and p.fixed is None
    )
    if not freed or settings.payloads:
        return ()
    return (Finding("load as mass", "warning", freed),)
