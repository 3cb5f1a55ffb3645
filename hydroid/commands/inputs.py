"""Settings and estimates that commands read. Each can be a file's name or what was read before."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from hydroid.errors import SettingsError
from hydroid.files import find_config
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.progress import NOTE
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, parse_override

if TYPE_CHECKING:
    from hydroid.fitting.validation import Prediction
    from hydroid.fitting.verdict import Baselines
    from hydroid.problem.problem import Problem


class Fitted(Protocol):
    """What a fit returns, as far as commands read it (`commands.fit.FitResult`)."""

    @property
    def model(self) -> IdentifiedModel:
        """At the final estimate."""
        ...

    @property
    def problem(self) -> "Problem":
        """The logs and the model."""
        ...

    @property
    def predictions(self) -> "tuple[Prediction, ...]":
        """Of its own logs."""
        ...

    @property
    def baselines(self) -> "Baselines":
        """Fitted to the same logs."""
        ...


Source = str | Path
ConfigSource = str | Path | FitSettings
ModelSource = str | Path | IdentifiedModel | Fitted
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
    fit: ModelSource | None,
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
    default = {"default": "fit-hyd"} if nominal else {}
    model = load_identified(fit, config, setting_changes(overrides), nominal=nominal, **default)
    if model.nominal:
        require_hydraulics(model)
        _log.log(NOTE, "note: nominal values for %s", ", ".join(model.nominal) if fit else "all parameters")
    return model


def require_hydraulics(model: IdentifiedModel) -> None:
    """Refuse a model of stage 1."""
    if model.settings.stage != "hyd":
        hint = "give a fit of stage 2 with --fit, or use --config fit-hyd"
        raise SettingsError("stage 1 (mech) does not model the actuators", where=model.source, hint=hint)


def refuse_overwriting(source: Any, out: Source | None) -> None:
    """Refuse to write a log over the one that is read."""
    if out is not None and isinstance(source, str | Path) and Path(out).resolve() == Path(source).resolve():
        raise SettingsError("would overwrite the log", where=str(out), hint="name another file")


def as_list(sources: Any) -> list[Any]:
    """Return one or several sources as a list; an empty one for none."""
    if isinstance(sources, Sequence) and not isinstance(sources, str):
        return list(sources)
    return [] if sources is None else [sources]
