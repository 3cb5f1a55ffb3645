"""Settings and estimates that commands read. Each can be a file's name or what was read before."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from hydroid.errors import SettingsError
from hydroid.estimate import FitSummary, read_values
from hydroid.files import find_config
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.progress import NOTE
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, parse_override

if TYPE_CHECKING:
    from hydroid.commands.fit import FitResult
    from hydroid.log import Log

Source = str | Path
ConfigSource = str | Path | FitSettings
LogSource: TypeAlias = "str | Path | Log"
LogSources: TypeAlias = "LogSource | Sequence[LogSource] | None"
ModelSource: TypeAlias = "str | Path | IdentifiedModel | FitResult"
SettingChanges = Mapping[str, Any] | Sequence[str] | None
"""settings to replace: values by dotted key, or texts `KEY=VALUE`"""

_log = logging.getLogger(__name__)


def setting_changes(given: SettingChanges, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return settings to replace by dotted key: those of `--set`, and the options that are not None.

    Raises:
        SettingsError: a text that is no KEY=VALUE.
    """
    changes = dict(given if isinstance(given, Mapping) else map(parse_override, given or ()))
    return changes | {key: value for key, value in (options or {}).items() if value is not None}


def load_settings(config: ConfigSource, overrides: SettingChanges = None) -> FitSettings:
    """Read the settings of a fit, and the arm they name.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})

    Args:
        config: a YAML file, the name of a shipped one, or settings that were read before.
        overrides: settings to replace, by dotted key.

    Raises:
        SettingsError: no such file, or a setting that is not allowed.
    """
    changes = setting_changes(overrides)
    if not isinstance(config, FitSettings):
        return load(find_config(config), FitSettings, changes)
    if changes:
        raise SettingsError("cannot be replaced in settings that are read", where=", ".join(changes))
    return config


def open_model(
    fit: "ModelSource | None",
    config: ConfigSource | None = None,
    overrides: SettingChanges = None,
    *,
    nominal: bool = False,
) -> IdentifiedModel:
    """Return the model of a result, or read it from a run folder, a saved plant or a YAML file of values.

    Where `nominal`, parameters without a value have nominal ones, which only stage 2 has; a note names them.

    Raises:
        RunError, SettingsError: as of `load_identified`.
    """
    if fit is not None and not isinstance(fit, str | Path):
        return fit if isinstance(fit, IdentifiedModel) else fit.model
    if isinstance(config, FitSettings):
        raise SettingsError("settings that are read make a model with `identified`", where="config")
    default = "fit-hyd" if nominal else "fit-mech"
    model = load_identified(fit, config, setting_changes(overrides), nominal=nominal, default=default)
    if model.nominal:
        if model.settings.stage != "hyd":
            hint = "give a fit of stage 2 with --fit, or use --config fit-hyd"
            raise SettingsError("stage 1 (mech) does not model the actuators", where=model.source, hint=hint)
        _log.log(NOTE, "note: nominal values for %s", ", ".join(model.nominal) if fit else "all parameters")
    return model


def open_values(fit: ModelSource) -> tuple[dict[str, Any], FitSummary | None]:
    """Return the values of an estimate by name, and the fit's own account of them where there is one.

    Raises:
        RunError, SettingsError: as of `read_values`.
    """
    if isinstance(fit, str | Path):
        return read_values(Path(fit))
    model = open_model(fit)
    return model.values, model.summary


def refuse_overwriting(source: Any, out: Source | None) -> None:
    """Refuse to write a log over the one that is read."""
    if out is not None and isinstance(source, str | Path) and Path(out).resolve() == Path(source).resolve():
        raise SettingsError("would overwrite the log", where=str(out), hint="name another file")


def as_list(sources: Any) -> list[Any]:
    """Return one or several sources as a list; an empty one for none."""
    if isinstance(sources, Sequence) and not isinstance(sources, str):
        return list(sources)
    return [] if sources is None else [sources]
