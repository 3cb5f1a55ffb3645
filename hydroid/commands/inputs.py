"""What commands take: functions whose parameters are the options, and what is read for
them.

A docstring says what each parameter is. A line of `Args:` is `name (VALUE): text`;
VALUE is what `--help` calls it, or the range of a number. What parameters of several
commands are stands in `SHARED`. Those before `*` need no name on the command line.
Settings and estimates can be a file's name or what was read before.
"""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias, TypeVar

import typer

from hydroid.errors import SettingsError
from hydroid.estimate import FitSummary, read_estimate
from hydroid.files import Plain, find_config
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.log import FORMATS, Log
from hydroid.progress import LOGGER, NOTE
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, parse_override

F = TypeVar("F", bound=Callable[..., Any])

Source = str | Path
ConfigSource = str | Path | FitSettings
LogSource = str | Path | Log
LogSources: TypeAlias = LogSource | Sequence[LogSource] | None
ModelSource: TypeAlias = "str | Path | IdentifiedModel | Any"
"""a run or a file, a model, or what a fit returned (`commands.fit.FitResult`,
which builds on this file)"""
SettingChanges = Mapping[str, Any] | Sequence[str] | None
"""settings to replace: values by dotted key, or texts `KEY=VALUE`"""


SHARED = f"""
    logs (LOG): Logs of commands and joint angles. Formats: {FORMATS}.
    log (LOG): A log. Formats: {FORMATS}.
    fit (RUN|YAML): A fit: its run folder, its estimate.yaml, a folder that Plant.save wrote
        in Python, or a YAML file of parameter values.
    out (DIR): Folder for the tables [default: runs/COMMAND; in Python nothing is
        written].
    config (YAML): Settings: the fit.yaml that `hydroid init` wrote for your machine.
        Or, for the arm that comes with hydroid, the name of its settings:
        fit-mech or fit-hyd.
    set (KEY=VALUE): Replace a setting, such as search.ga.generations=80.
    repair: Fill gaps in the logs that are not longer than the setting log.repair_s (0.1 s),
        and list what was filled. The log files are not changed.
    seed (0 or more): Seed of the random numbers. The same seed gives exactly the same result.
    dask (local[:N]|ADDRESS): Simulate in N processes on this computer, or on a cluster: the
        workers of the Dask scheduler (dask.org) at ADDRESS. The result is the same.
    arm (right|left|both): For a machine of two arms: which of them move. Columns such
        as right_u2_pct and left_q2_deg belong to one arm. All other columns apply to
        every arm that moves.
    pose (NAME): The start pose, by its name in the arm's file [default: the first angles of the
        log].

    algorithm (NAME): Search: ga or nsga2 (genetic algorithms), multistart (least squares from
        several starts), or pymoo (an algorithm of the package pymoo: the setting
        search.pymoo.algorithm names it).
    start (RUN|YAML): Start the search from the values of a fit.
    resume: Continue the stopped run in --out; start it if there is none.
    refinement: After the search, refine its estimate by least squares.
    budget (TIME): Time for search and refinement, such as 90s, 5min or 2h. When it is
        up, hydroid keeps the best model so far. Intervals and report take some more
        time. To go on, repeat the command with --resume; it then has the
        same time again. The time is that on the clock, not processor time.
    threads (N): Number of threads (0: one per core, or with --dask one per worker).
"""

TERMINAL: Plain = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "Source": Path,
    "LogSources": Path,
    "ModelSource": Path,
    "ConfigSource": str,
    "SettingChanges": str,
}
"""what a value of a Python type is on the command line"""

LISTS = {"Sequence", "LogSources", "SettingChanges"}
"""Python types whose values are lists on the command line"""
COMMAND_LINES: dict[Callable[..., Any], tuple[str, str, list[inspect.Parameter]]] = {}
"""text, example and parameters on the command line of every command that is imported"""


def setting_changes(
    given: SettingChanges, options: Mapping[str, Any] | None = None
) -> Plain:
    """Return settings to replace by dotted key: those of `--set`,
    and the options that are not None."""
    if given is None:
        changes = Plain()
    elif isinstance(given, Mapping):
        changes = dict(given)
    else:
        changes = dict(map(parse_override, given))
    for key, value in (options or {}).items():
        if value is not None:
            changes[key] = value
    return changes


def note_shipped_arm(settings: FitSettings) -> None:
    """Say that a command without --config takes the arm that hydroid ships."""
    what = f"note: the arm is the shipped {settings.arm.name}"
    LOGGER.log(
        NOTE, f"{what}: for your machine give --config, which `hydroid init` writes"
    )


def load_settings(
    config: ConfigSource, overrides: SettingChanges = None
) -> FitSettings:
    """Read the settings of a fit, and the arm they name.

        settings = hydroid.load_settings("fit-mech", {"search.seed": 3})

    Args:
        config: a YAML file, the name of a shipped one, or settings that were read
            before.
        overrides: settings to replace, by dotted key.

    Raises:
        SettingsError: no such file, or a setting that is not allowed.
    """
    changes = setting_changes(overrides)
    if not isinstance(config, FitSettings):
        return load(find_config(config), FitSettings, changes)
    if changes:
        raise SettingsError(
            "cannot be replaced in settings that are read", ", ".join(changes)
        )
    return config


def open_model(
    fit: "ModelSource | None",
    config: ConfigSource | None = None,
    overrides: SettingChanges = None,
    *,
    nominal: bool = False,
) -> IdentifiedModel:
    """Return the model of a result, or read it from a run folder, a saved plant or a
    YAML file of values.

    Where `nominal`, parameters without a value have nominal ones, which only stage 2
    has; a note names them.
    """
    changes = setting_changes(overrides)
    if fit is not None and not isinstance(fit, str | Path):
        if changes:
            hint = "name its run folder, or make the model with `identified`"
            where = ", ".join(changes)
            raise SettingsError(
                "cannot be replaced in a model that is read", where, hint
            )
        return getattr(fit, "model", fit)
    if isinstance(config, FitSettings):
        raise SettingsError(
            "settings that are read make a model with `identified`", "config"
        )
    model = load_identified(fit, config, changes, nominal=nominal)
    if model.nominal:
        if model.settings.stage != "hyd":
            hint = "give a fit of stage 2 with --fit, or use --config fit-hyd"
            raise SettingsError(
                "stage 1 (mech) does not model the actuators", model.source, hint
            )
        which = "all parameters: no fit is given"
        if fit:
            which = ", ".join(model.nominal)
        LOGGER.log(NOTE, "note: nominal values for %s", which)
    return model


def open_values(fit: ModelSource) -> tuple[Plain, FitSummary | None]:
    """Return the values of an estimate by name,
    and the fit's own account of them where there is one."""
    if isinstance(fit, str | Path):
        return read_estimate(Path(fit))[1:]
    model = open_model(fit)
    return model.values, model.summary


def refuse_overwriting(source: Any, out: Source | None) -> None:
    """Refuse to write a log over the one that is read."""
    if out is None or not isinstance(source, str | Path):
        return
    if Path(out).resolve() == Path(source).resolve():
        raise SettingsError("would overwrite the log", out, "name another file")


def as_list(sources: Any) -> list[Any]:
    """Return one or several sources as a list; an empty one for none."""
    if sources is None:
        return []
    if isinstance(sources, Sequence) and not isinstance(sources, str):
        return list(sources)
    return [sources]


def command(function: F) -> F:
    """Make a command of a function: describe all its parameters in its docstring, and
    keep them for typer."""
    text, raises = _split(inspect.cleandoc(function.__doc__ or ""), "Raises:")
    text, arguments = _split(text, "Args:")
    summary, example = _split(text, "Example:")
    shared = SHARED.replace("COMMAND", function.__name__.replace("_", "-"))
    described = _described(shared) | _described(arguments)
    parameters = [*inspect.signature(function).parameters.values()]
    lines = [text, "", "Args:"]
    lines += [f"    {p.name}: {described[p.name].text}" for p in parameters]
    if raises:
        lines += ["", f"Raises:{raises}"]
    function.__doc__ = "\n".join(lines)
    example_line = example.partition("\n")[0]
    options = [_on_command_line(p, described[p.name]) for p in parameters]
    COMMAND_LINES[function] = summary, f"Example:{example_line}", options
    return function


def _split(text: str, heading: str) -> tuple[str, str]:
    """Return a docstring before a section, and the section without its heading."""
    before, _, section = text.partition(f"\n\n{heading}")
    return before, section


class _Described(NamedTuple):
    """What a docstring says of a parameter."""

    value: str
    """what `--help` calls its value, or the range of a number; empty where it says
    nothing"""
    text: str


def _described(section: str) -> dict[str, _Described]:
    """Return what the lines of `Args:` say of each parameter, by name."""
    # lines that go on are indented by 8
    entry = r"^ {4}(\w+)(?: \((.+?)\))?: (.*(?:\n {8}.*)*)"
    found = re.findall(entry, section, re.MULTILINE)
    return {
        name: _Described(value, " ".join(text.split())) for name, value, text in found
    }


def _on_command_line(
    parameter: inspect.Parameter, described: _Described
) -> inspect.Parameter:
    """Return a parameter of a Python function as typer takes it: an argument, or an
    option."""
    # annotations are texts where their types are imported for the checker alone
    type_names = re.findall(r"\w+", inspect.formatannotation(parameter.annotation))
    value_type = next(TERMINAL[name] for name in type_names if name in TERMINAL)
    is_list = bool(LISTS & {*type_names})
    default = None if parameter.default == () else parameter.default
    details: Plain = {"help": described.text, **_limits(described.value, value_type)}
    if parameter.kind is parameter.POSITIONAL_OR_KEYWORD:
        option = typer.Argument(**details)
    else:
        flags = _flags(parameter.name)
        if value_type is bool and default is not False:
            # typer then offers --no-... too, for what is on, or left to the settings
            flags = []
        option = typer.Option(*flags, **details)
    kind: Any = list[value_type] if is_list else value_type
    if default is None:
        kind = kind | None
    annotation = Annotated[kind, option]
    return parameter.replace(
        kind=parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


def _flags(name: str) -> list[str]:
    """Return how an option is spelt."""
    flag = f"--{name.replace('_', '-')}"
    if name == "out":
        return [flag, "-o"]
    return [flag]


def _limits(value: str, value_type: Any) -> Plain:
    """Return typer's limits of a number whose value is `0 or more` or `0 to 90`,
    or else its metavar."""
    limits = re.fullmatch(r"(\S+) (?:or more|to (\S+))", value)
    if limits is None:
        return {"metavar": value or None}
    lowest, highest = limits.groups()
    return {
        "metavar": "N" if value_type is int else "NUMBER",
        "min": value_type(lowest),
        "max": None if highest is None else value_type(highest),
    }


def names(given: str | list[str] | tuple[str, ...] | None) -> list[str]:
    """Return names that stand in a list, or in a text such as `K,D`, in their order."""
    parts = given.split(",") if isinstance(given, str) else given or ()
    # Python's callers may give numbers
    stripped = (str(part).strip() for part in parts)
    return [name for name in stripped if name]
