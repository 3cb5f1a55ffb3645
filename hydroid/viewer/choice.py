"""Which parameter set is looked at: a run's, a file's, or what the arm and the settings say."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import SettingsError
from hydroid.estimate import read_values
from hydroid.hydraulics.records import nominal_parameters
from hydroid.jobs import load_settings
from hydroid.problem.stage import Stage
from hydroid.settings.fit import FitSettings
from hydroid.simulation import ArmParameters, Candidates


@dataclass(frozen=True)
class Chosen:
    """A parameter set with the arm and settings it belongs to.

    Attributes:
        candidate: the one parameter set.
        nominal: names of parameters for which no value was given; the arm's and settings' own stand for them.
        source: where the values came from.
    """

    settings: FitSettings
    candidate: Candidates
    nominal: tuple[str, ...]
    source: str


def choose(config: str | None, params: Path | None, changes: dict[str, Any] | None = None) -> Chosen:
    """Find the parameter set that a command is about.

    Args:
        config: settings; by default those beside `params`, or the shipped fit-hyd.
        params: a run folder, its estimate.yaml, or a YAML file of values by name; None: nominal values.
        changes: settings to replace, by key.

    Raises:
        SettingsError: settings without hydraulics, or a parameter that does not exist.
        RunError: a run without an estimate.
    """
    folder = params if params is None or params.is_dir() else params.parent
    beside = folder / "config.yaml" if folder is not None else None
    named = config or (str(beside) if beside is not None and beside.is_file() else "fit-hyd")
    settings = load_settings(named, changes)
    if settings.stage != "hyd":
        raise SettingsError("stage mech has no actuators", where=named, hint="use --config fit-hyd")
    values: dict[str, Any] = {}
    if params is not None:
        values, _ = read_values(params)
    source = str(params or named)
    stage = Stage(settings)
    known = stage.parameters.parameters
    missing = tuple(p.name for p in known if p.name not in values and p.fixed is None)
    theta = stage.parameters.vector(dict.fromkeys(missing, 0.0) | values, source)
    theta[[p.name in missing for p in known]] = np.nan
    candidate = _filled(stage.candidates(theta[None]), _nominal(settings))
    return Chosen(settings, candidate, missing, source)


def _nominal(settings: FitSettings) -> Candidates:
    """What the arm's file and the settings say where no parameter does."""
    none = np.zeros((1, len(settings.arm.joints)))
    return Candidates(
        ArmParameters(gain=none, damping=none, stiffness=none, friction=none, mass=settings.arm.masses[None]),
        nominal_parameters(settings.arm, settings.hydraulics, range(len(settings.arm.joints))),
    )


def _filled(candidate: Candidates, nominal: Candidates) -> Candidates:
    """Put nominal values where there is NaN."""
    assert candidate.actuators is not None
    assert nominal.actuators is not None
    pairs = {
        f.name: (getattr(candidate.arm, f.name), getattr(nominal.arm, f.name)) for f in fields(candidate.arm)
    }
    arm = replace(nominal.arm, **{name: np.where(np.isnan(v), n, v) for name, (v, n) in pairs.items()})
    actuators = nominal.actuators.copy()
    for name in actuators.dtype.names or ():
        given = candidate.actuators[name]
        actuators[name] = np.where(np.isnan(given), actuators[name], given)
    return Candidates(arm, actuators)
