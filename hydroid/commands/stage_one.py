"""What stage 2 takes from stage 1: its estimate."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydroid.commands.inputs import ConfigSource, ModelSource, load_settings, open_model
from hydroid.errors import SettingsError
from hydroid.estimate import estimate_file, read_values
from hydroid.files import is_file
from hydroid.identified_model import CONFIG
from hydroid.posterior.flags import Flag
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load
from hydroid.settings.parameters import nominal_value

_log = logging.getLogger(__name__)


def load_stage(stage: str, config: ConfigSource, changes: Mapping[str, Any]) -> FitSettings:
    """Read the settings of a stage.

    Raises:
        SettingsError: as of `load_settings`, or they are those of the other stage.
    """
    settings = load_settings(config, changes)
    if settings.stage != stage:
        what = f"has stage: {settings.stage}, but hydroid fit-{stage} needs stage: {stage}"
        hint = f"use hydroid fit-{settings.stage}, or another --config"
        raise SettingsError(what, where=str(config), hint=hint)
    return settings


def with_mechanics(
    mech: ModelSource | None, config: ConfigSource, changes: Mapping[str, Any]
) -> dict[str, Any]:
    """Return changes of settings that hold the parameters of stage 1 at its estimate.

    Args:
        mech: a run folder or a result of stage 1, or a YAML file of values by name. Its masses hold, and its
            damping and stiffness where `config` states no start or nominal value of its own. None: `config`
            fixes them, or says what is known of them (a prior or a start), and they are estimated with the
            others.
        config: settings of stage 2.
        changes: settings to replace; they have the last word.

    Raises:
        RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    values, summary, first = dict[str, Any](), None, None
    if isinstance(mech, str | Path):
        values, summary = read_values(Path(mech))
        beside = estimate_file(Path(mech)).parent / CONFIG
        first = load(beside, FitSettings) if is_file(beside) else None
    elif mech is not None:
        model = open_model(mech)
        values, summary, first = model.values, model.summary, model.settings
    settings = load_stage("hyd", config, changes)
    if first is not None:
        same = "start_pose", "payloads"
        other = [name for name in same if getattr(first, name) != getattr(settings, name)]
        other += ["arm"] * (first.arm.joint_names != settings.arm.joint_names)
        if other:
            _log.warning("stage 1 (%s) had another %s than %s", mech, " and ".join(other), config)
    parameters = {name: settings.parameters[name] for name in _mechanical(settings)}
    missing = [
        name
        for name, p in parameters.items()
        if values.get(name) is None and p.fixed is None and (mech is not None or not p.states_start)
    ]
    if missing:
        hint = "give the run of stage 1 with --mech RUN, or set fixed, nominal or start for each"
        what = f"stage 2 needs the values of {', '.join(missing)} from stage 1"
        raise SettingsError(what, where=str(mech or ""), hint=hint)
    held: dict[str, Any] = {}
    for name, p in parameters.items():
        value, key, mass = values.get(name), f"parameters.{name}.fixed", p.quantity == "mass"
        if value is None or key in changes or (p.states_start and not mass):
            continue
        held[key] = value
        nominal, flag = (
            nominal_value(settings.arm, settings.hydraulics, p),
            summary and summary.estimate[name].flag,
        )
        doubtful = mass and flag not in (None, Flag.IDENTIFIABLE, Flag.FIXED)
        if doubtful and nominal and abs(value - nominal) > 0.1 * nominal:
            _log.warning(
                "%s is held at %.3g kg: stage 1 moved it from %.3g kg, but its logs do not determine it "
                "(%s). Without --mech it is estimated here",
                *(name, value, nominal, flag),
            )
    return {**changes, **held}


def _mechanical(settings: FitSettings) -> list[str]:
    """Names of the parameters that both stages have."""
    quantities = [name for name in MECHANICAL if name != "gain"]
    return [name for name, p in settings.parameters.items() if p.quantity in quantities]
