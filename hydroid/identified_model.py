"""An estimate with its settings: from a run folder, a saved plant, a file of values,
or nominal values."""

import hashlib
import json
import math
import os
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from hydroid.arrays import Array, record
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import (
    DESCRIPTION,
    NAME,
    FitSummary,
    ParameterEstimate,
    read_estimate,
)
from hydroid.files import (
    Plain,
    find_config,
    is_file,
    read_file,
    write_atomic,
    yaml_text,
)
from hydroid.progress import LOGGER, NOTE
from hydroid.quantity_table import TARGETS
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load
from hydroid.settings.problem import ParameterSettings
from hydroid.words import listed

CONFIG = "config.yaml"
ARM = "arm.yaml"
MODEL = "model/arm.xml"
"""the files of a folder that `load_identified` reads, beside the estimate"""
PAIR = "model/pair.xml"  # the machine of two arms


@record
class IdentifiedModel:
    """A model at an estimate.

    Attributes:
        settings: with the arm; after a joint refinement every parameter that has bounds
            is free.
        theta: the parameters in the order and units of the settings, shape (P,).
        source: where the estimate came from, for messages.
        summary: the fit's own account of the estimate, where a fit made it.
        nominal: parameters without a value, whose effect the settings and the arm's
            file give; they are not among the settings' parameters.
    """

    settings: FitSettings
    theta: Array
    source: str
    summary: FitSummary | None = None
    nominal: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the run folder or the file that the estimate came from."""
        file = Path(self.source)
        if file.name == NAME:
            return file.resolve().parent.name
        return file.stem

    @property
    def values(self) -> dict[str, float]:
        """The parameters by name."""
        return self.settings.parameter_set().mapping(self.theta)

    def summarise(self) -> FitSummary:
        """Return the fit's own account, or the values alone."""
        if self.summary is not None:
            return self.summary
        parameters = self.settings.parameter_set()
        values = parameters.mapping(self.theta)
        estimate = dict[str, ParameterEstimate]()
        for parameter in parameters.parameters:
            value = values[parameter.name]
            estimate[parameter.name] = ParameterEstimate(
                value=value, unit=parameter.unit
            )
        return FitSummary(stage=self.settings.stage, estimate=estimate)


def identified(
    settings: FitSettings, values: Mapping[str, Any], source: str
) -> IdentifiedModel:
    """Return the model of some settings at parameters by name; a fixed parameter may be
    left out.

    Raises SettingsError: a name that does not exist or is missing, or a value that is
    not allowed.
    """
    return IdentifiedModel(
        settings, settings.parameter_set().vector(values, source), source
    )


def load_identified(
    source: str | Path | None,
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    nominal: bool = False,
) -> IdentifiedModel:
    """Read an estimate and the settings it belongs to.

    Args:
        source: a run folder, the folder of a saved plant, an `estimate.yaml`, or a YAML
            file of values by name; None: no values.
        config: settings, a path or a shipped name; left out: those beside the estimate.
            A file of values without settings beside it has those that are shipped.
        nominal: take parameters without a value as the settings and the arm's file have
            them.

    Raises:
        RunError: the folder holds no estimate, or a fit's settings are not beside its
            estimate.
        SettingsError: a file that cannot be read, a parameter that is unknown,
            or missing and not `nominal`, or an override that fixes one at another value.
    """
    if source is not None and config is None:
        warn_of_changes(Path(source))
    model = read_identified(source, config, overrides, nominal=nominal)
    if source is not None:
        _refuse_other_values(model, overrides or {})
        _tell_idle(model.settings, overrides or {})
    return model


def _refuse_other_values(model: IdentifiedModel, overrides: Mapping[str, Any]) -> None:
    """Refuse overrides that fix parameters: their values are the estimate's."""
    for key in overrides:
        group, _, rest = key.partition(".")
        if group != "parameters":
            continue
        for name, value in model.values.items():
            fixed = model.settings.parameters[name].fixed
            is_meant = rest in ("", name) or rest.startswith(f"{name}.")
            if fixed is None or not is_meant or math.isclose(fixed, value):
                continue
            what = (
                f"{name} is fixed at {fixed:g}, but the estimate's value is {value:g}"
            )
            hint = "fit again with it, or give a YAML file of values with --fit"
            raise SettingsError(what, f"--set {key}", hint)


def _tell_idle(settings: FitSettings, overrides: Mapping[str, Any]) -> None:
    """Say which overrides of `hydraulics` change nothing, because parameters set these
    quantities."""
    for key in overrides:
        group, _, quantity = key.partition(".")
        if group != "hydraulics":
            continue
        targets = TARGETS.get(quantity, ())
        setting = [settings.parameters_of(name) for name in targets]
        # of a quantity of both sides both must be set
        if setting and all(setting):
            names = listed(sorted({*chain.from_iterable(setting)}), 3)
            text = "note: %s changes nothing: the estimate has %s"
            LOGGER.log(NOTE, text, f"--set {key}", names)


def read_identified(
    source: str | Path | None,
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    nominal: bool = False,
) -> IdentifiedModel:
    """Read as `load_identified` does, without a word on what was changed."""
    file: Path | None = None
    values: Plain = {}
    summary: FitSummary | None = None
    if source is not None:
        file, values, summary = read_estimate(Path(source))
    chosen = config
    if chosen is None:
        chosen = _config_beside(file, summary, nominal=nominal)
    settings = load(find_config(chosen), FitSettings, overrides)
    # a fit's final estimate may have terms, or be of another model than its settings
    # began with
    if config is None and summary is not None:
        settings = settings.of_estimate(summary.final)
    # parameters that the estimate has no value of
    missing = list[str]()
    stated = dict[str, ParameterSettings]()
    for name, parameter in settings.parameters.items():
        if name in values or parameter.fixed is not None:
            stated[name] = parameter
        else:
            missing.append(name)
    if nominal and missing:
        settings = settings.changed({"parameters": stated})
    origin = str(file or chosen)
    theta = settings.parameter_set().vector(values, origin)
    return IdentifiedModel(settings, theta, origin, summary, tuple(missing))


def _config_beside(
    file: Path | None, summary: FitSummary | None, *, nominal: bool
) -> str | Path:
    """Return the settings that an estimate belongs to: those in its folder, or shipped
    ones."""
    if file is not None:
        beside = file.parent / CONFIG
        if is_file(beside):
            return beside
        if summary is not None:
            what = (
                f"is missing, and {NAME} says nothing without the settings of its fit"
            )
            raise RunError(what, beside, "put it back, or name the run folder")
    return "fit-hyd" if nominal else "fit-mech"


def own_hashes(folder: Path) -> dict[str, str]:
    """Return hashes of the settings and the model in a run folder, by file."""
    files = [folder / name for name in (CONFIG, ARM, MODEL)]
    files += sorted((folder / MODEL).parent.glob("meshes/*"))
    present = filter(Path.is_file, files)
    return {file.relative_to(folder).as_posix(): file_hash(file) for file in present}


def warn_of_changes(source: Path) -> None:
    """Say which files of a run, given by its folder or its estimate,
    are not as its fit left them.

    Raises RunError: one of them is missing.
    """
    folder = source if os.path.isdir(source) else source.parent
    for name in changed_files(folder):
        if not is_file(folder / name):
            raise RunError("is missing", folder / name, "put it back, or fit again")
        text = "warning: %s: is not as the fit left it; put it back, or fit again"
        LOGGER.warning(text, folder / name)


def changed_files(folder: Path) -> list[str]:
    """Return the files of a run folder that are missing or not what its fit wrote;
    none of a folder that is no run's."""
    try:
        run = json.loads(read_file(folder / DESCRIPTION))
        written = dict(run["files"])
        if "estimate" in run:
            written[NAME] = run["estimate"]
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        # whoever needs the description says what is wrong with it
        return []
    present = own_hashes(folder)
    present[NAME] = file_hash(folder / NAME)
    return [name for name, stored in written.items() if present.get(name) != stored]


def file_hash(*files: Path) -> str:
    """Return one hash of the content of files; those that are not there count as
    empty."""
    contents = (read_file(file) for file in files if is_file(file))
    return hashlib.sha256(b"".join(contents)).hexdigest()


def start_values(settings: FitSettings) -> IdentifiedModel:
    """Return the model before any fit, where a search starts: nominal values,
    or the middle of the bounds."""
    return IdentifiedModel(settings, settings.parameter_set().start, "the start values")


def write_settings(folder: Path, settings: FitSettings) -> None:
    """Write the settings, the arm and its models to a folder, so that it can be read
    anywhere."""
    # this imports MuJoCo, which takes long
    from hydroid.mjcf import copy_models

    arm = settings.arm
    models = {Path(MODEL).name: arm.model}
    paths: dict[str, str | None] = {"model": MODEL, "pair": None}
    if arm.pair:
        models[Path(PAIR).name] = arm.pair
        paths["pair"] = PAIR
    copy_models(models, folder / Path(MODEL).parent)
    description = arm.model_dump(mode="json") | paths
    write_atomic(folder / ARM, yaml_text(description))
    # last: whoever finds it finds what it names
    write_atomic(folder / CONFIG, yaml_text(portable(settings)))


def portable(settings: FitSettings) -> dict[str, Any]:
    """Return the settings as they stand in a folder, with the arm beside them."""
    values = settings.model_dump(mode="json", exclude={"arm"})
    return {"stage": values.pop("stage"), "arm": ARM} | values
