"""What stage 2 takes from stage 1: its estimate, and the arm and log layout that it was made with."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydroid.assets import find_config
from hydroid.commands.inputs import ConfigSource, load_settings
from hydroid.errors import SettingsError
from hydroid.estimate import ParameterEstimate, estimate_file, read_values
from hydroid.files import is_file
from hydroid.identified_model import ARM, CONFIG
from hydroid.posterior.flags import Flag
from hydroid.quantity_table import MECHANICAL
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, read_yaml
from hydroid.settings.parameters import nominal_value

MOVED = 0.1
"""relative change of a mass by a stage 1 whose logs do not determine it, from which on it is said"""
_log = logging.getLogger(__name__)


def with_mechanics(
    mech: str | Path | None, config: ConfigSource, overrides: Mapping[str, Any], logs: Sequence[str]
) -> dict[str, Any]:
    """Return overrides that hold the parameters of stage 1 at its estimate.

    A run folder also gives its arm, log layout, start pose and payloads where `config` has none, and its
    mechanical parameters where the arm is not the config's.

    Args:
        mech: a run folder of stage 1, or a YAML file of values by name. Its masses hold, and its damping and
            stiffness where `config` states no start or nominal value of its own. None: `config` fixes them,
            or says what is known of them (a prior or a start), and they are estimated with the others.
        config: settings of stage 2.
        overrides: settings to replace; they have the last word.
        logs: names of the logs' files.

    Raises:
        RunError, SettingsError: no values there, or one that stage 2 needs is missing.
    """
    changes = dict(overrides)
    if mech is None:
        settings = load_settings(config, changes)
        parameters = {name: settings.parameters[name] for name in _mechanical(settings)}
        free = [name for name, p in parameters.items() if p.fixed is None and not p.states_start]
        if free:
            hint = "give the run of stage 1 with --mech RUN, or set fixed, nominal or start for each"
            raise SettingsError(f"stage 2 needs the values of {', '.join(free)} from stage 1", hint=hint)
        return changes
    values, summary = read_values(Path(mech))
    folder = estimate_file(Path(mech)).parent
    if summary is not None and is_file(folder / CONFIG):
        changes = _inherited(folder, config, logs) | changes
    settings = load_settings(config, changes)
    wanted = _mechanical(settings)
    missing = [name for name in wanted if name not in values and settings.parameters[name].fixed is None]
    if missing:
        raise SettingsError(f"has no value for {', '.join(missing)}", where=str(mech))
    own = {name for name, p in settings.parameters.items() if p.states_start and p.quantity != "mass"}
    given = [
        name
        for name in wanted
        if name in values and name not in own and f"parameters.{name}.fixed" not in changes
    ]
    for name in given if summary is not None else ():
        assert summary is not None
        _doubt(name, summary.estimate[name], nominal_value(settings, settings.parameters[name]))
    return changes | {f"parameters.{name}.fixed": values[name] for name in given}


def _doubt(name: str, known: ParameterEstimate, nominal: float | None) -> None:
    """Warn of a mass that stage 1 moved from its nominal value although its logs do not determine it."""
    if known.unit != "kg" or not nominal or known.flag in (None, Flag.IDENTIFIABLE, Flag.FIXED):
        return
    if abs(known.value - nominal) > MOVED * nominal:
        _log.warning(
            "%s is held at %.3g kg: stage 1 moved it from %.3g kg, but its logs do not determine it (%s). "
            "Without --mech it is estimated here",
            *(name, known.value, nominal, known.flag),
        )


def _inherited(folder: Path, config: ConfigSource, logs: Sequence[str]) -> dict[str, Any]:
    """Settings of stage 1's run that stage 2's config leaves open."""
    first = load(folder / CONFIG, FitSettings)
    own = {} if isinstance(config, FitSettings) else read_yaml(find_config(config))[0]
    layout = own.get("log")
    taken: dict[str, Any] = {
        f"log.{key}": value
        for key, value in first.log.model_dump(mode="json").items()
        if not isinstance(layout, dict) or key not in layout
    }
    if "start_pose" not in own:
        taken["start_pose"] = first.start_pose
    if "payloads" not in own:
        taken["payloads"] = {name: mass for name, mass in first.payloads.items() if name in logs}
    if "arm" not in own:
        taken["arm"] = str((folder / ARM).resolve())
        taken |= _parameters(first, own.get("parameters"))
    return taken


def _parameters(first: FitSettings, own: Any) -> dict[str, Any]:
    """Mechanical parameters of stage 1's arm, where those of stage 2's config belong to another arm."""
    known: dict[str, Any] = own if isinstance(own, dict) else {}
    links = first.arm.link_names
    fitting = {n: p for n, p in known.items() if not isinstance(p, dict) or p.get("link", links[0]) in links}
    if len(fitting) == len(known):
        return {}
    more = {n: first.parameters[n].model_dump(mode="json") for n in _mechanical(first) if n not in fitting}
    return {"parameters": fitting | more}


def _mechanical(settings: FitSettings) -> list[str]:
    """Names of the parameters that both stages have."""
    quantities = [name for name in MECHANICAL if name != "gain"]
    return [name for name, p in settings.parameters.items() if p.quantity in quantities]
