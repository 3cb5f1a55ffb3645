"""Which parameter set is looked at: a run's, a file's, or what the arm and the settings say."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hydroid.errors import SettingsError
from hydroid.hydraulics.parameters import ActuatorParameters, nominal_parameters
from hydroid.jobs import load_settings, read_parameters
from hydroid.problem.stage import Stage
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.simulation import ArmParameters, Members

P = TypeVar("P", ArmParameters, ActuatorParameters)


@dataclass(frozen=True)
class Chosen:
    """A parameter set with the arm and settings it belongs to.

    Attributes:
        member: the one parameter set.
        nominal: names of parameters for which no value was given; the arm's and settings' own stand for them.
        source: where the values came from.
    """

    settings: FitSettings
    arm: Arm
    member: Members
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
    settings, arm = load_settings(named, changes)
    if settings.stage != "hyd":
        raise SettingsError("stage mech has no actuators", where=named, cure="use --config fit-hyd")
    values: dict[str, Any] = {}
    if params is not None:
        values = read_parameters(params)
    source = str(params or named)
    stage = Stage(arm, settings)
    known = stage.parameters.parameters
    missing = tuple(p.name for p in known if p.name not in values and p.fixed is None)
    theta = stage.parameters.vector(dict.fromkeys(missing, 0.0) | values, source)
    theta[[p.name in missing for p in known]] = np.nan
    member = _filled(stage.members(theta[None]), _nominal(arm, settings))
    return Chosen(settings, arm, member, missing, source)


def _nominal(arm: Arm, settings: FitSettings) -> Members:
    """What the arm's file and the settings say where no parameter does."""
    none = np.zeros((1, len(arm.joints)))
    return Members(
        ArmParameters(gain=none, damping=none, stiffness=none, friction=none, mass=arm.masses[None]),
        nominal_parameters(arm, settings.hydraulics, range(len(arm.joints))),
    )


def _filled(member: Members, nominal: Members) -> Members:
    assert member.actuators is not None
    assert nominal.actuators is not None
    return Members(_known(member.arm, nominal.arm), _known(member.actuators, nominal.actuators))


def _known(values: P, nominal: P) -> P:
    """Put nominal values where there is NaN."""
    pairs = {f.name: (getattr(values, f.name), getattr(nominal, f.name)) for f in fields(values)}
    return replace(nominal, **{name: np.where(np.isnan(v), n, v) for name, (v, n) in pairs.items()})
