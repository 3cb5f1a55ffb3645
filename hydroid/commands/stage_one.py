"""What stage 2 takes from stage 1: its estimate, and the arm and log layout that it was made with."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydroid.assets import find_config
from hydroid.commands.inputs import ConfigSource, load_settings
from hydroid.errors import SettingsError
from hydroid.estimate import estimate_file, read_values
from hydroid.files import is_file
from hydroid.identified_model import ARM, CONFIG
from hydroid.posterior.flags import Flag
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, read_yaml

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
    mech: str | Path | None, config: ConfigSource, changes: Mapping[str, Any], logs: Sequence[str]
) -> dict[str, Any]:
    """Return changes of settings that hold the parameters of stage 1 at its estimate.

    A run folder also gives its arm, log layout, start pose and payloads where `config` has none, and its
    mechanical parameters where the arm is not the config's.

    Args:
        mech: a run folder of stage 1, or a YAML file of values by name. Its masses hold, and its damping and
            stiffness where `config` states no start or nominal value of its own. None: `config` fixes them,
            or says what is known of them (a prior or a start), and they are estimated with the others.
        config: settings of stage 2.
        changes: settings to replace; they have the last word.
        logs: names of the logs' files.

    Raises:
        RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    values, summary = ({}, None) if mech is None else read_values(Path(mech))
    if mech is not None and summary is not None:
        changes = {**_inherited(estimate_file(Path(mech)).parent, config, logs), **changes}
    settings = load_stage("hyd", config, changes)
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
        nominal, flag = settings.nominal(p), summary and summary.estimate[name].flag
        doubtful = mass and flag not in (None, Flag.IDENTIFIABLE, Flag.FIXED)
        if doubtful and nominal and abs(value - nominal) > 0.1 * nominal:
            _log.warning(
                "%s is held at %.3g kg: stage 1 moved it from %.3g kg, but its logs do not determine it "
                "(%s). Without --mech it is estimated here",
                *(name, value, nominal, flag),
            )
    return {**changes, **held}


def _inherited(folder: Path, config: ConfigSource, logs: Sequence[str]) -> dict[str, Any]:
    """Settings of stage 1's run that stage 2's config leaves open; none where the folder is no run's."""
    if not is_file(folder / CONFIG):
        return {}
    first = load(folder / CONFIG, FitSettings)
    own: dict[str, Any] = {} if isinstance(config, FitSettings) else read_yaml(find_config(config))[0]
    layout, known = own.get("log"), own.get("parameters")
    stated = layout if isinstance(layout, dict) else {}
    taken = {f"log.{k}": v for k, v in first.log.model_dump(mode="json").items() if k not in stated}
    payloads = {name: mass for name, mass in first.payloads.items() if name in logs}
    whole = {"start_pose": first.start_pose, "payloads": payloads, "arm": str((folder / ARM).resolve())}
    taken |= {key: value for key, value in whole.items() if key not in own}
    links = first.arm.link_names
    if "arm" not in own and isinstance(known, dict):
        fitting = {
            n: p for n, p in known.items() if not isinstance(p, dict) or p.get("link", links[0]) in links
        }
        if len(fitting) < len(known):  # those of another arm: stage 1's take their place
            more = (n for n in _mechanical(first) if n not in fitting)
            taken["parameters"] = fitting | {n: first.parameters[n].model_dump(mode="json") for n in more}
    return taken


def _mechanical(settings: FitSettings) -> list[str]:
    """Names of the parameters that both stages have."""
    quantities = [name for name in MECHANICAL if name != "gain"]
    return [name for name, p in settings.parameters.items() if p.quantity in quantities]
