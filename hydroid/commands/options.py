"""Options that several commands share, and what makes a command of a function.

An option is `Annotated[type in Python, typer.Option(...)]`, followed by the type on the command line where
Python accepts more, a `Log` as well as a file's name, and by the default where the option stands in a
`TypedDict` of several commands.
"""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args

import typer

if TYPE_CHECKING:
    from hydroid.commands.inputs import ConfigSource, ModelSource, SettingChanges, Source
    from hydroid.commands.logs import LogSources

F = TypeVar("F", bound=Callable[..., Any])

LOGS_HELP = "Logs of commands and joint angles: CSV, .mat, Parquet, ROS bags, MCAP."
Logs = Annotated["LogSources", typer.Argument(metavar="LOG", help=LOGS_HELP), list[Path]]
MoreLogs = Annotated[
    "LogSources",
    typer.Argument(metavar="LOG", help=f"{LOGS_HELP} [default: those of the run]"),
    list[Path] | None,
]
Config = Annotated[
    "ConfigSource", typer.Option(help="Settings: a YAML file, or the name of a shipped config."), str
]
OwnConfig = Annotated[
    "ConfigSource | None",
    typer.Option(
        help="Settings: a YAML file, or the name of a shipped config [default: config.yaml in the folder of "
        "the estimate, or else fit-mech]."
    ),
    str | None,
]
Set = Annotated[
    "SettingChanges",
    typer.Option(metavar="KEY=VALUE", help="Replace a setting, such as search.ga.generations=80."),
    list[str] | None,
]
Folder = Annotated[
    "Source | None",
    typer.Option(metavar="DIR", help="Folder for the report, tables and figures."),
    Path | None,
]
FIT_HELP = (
    "An estimate: a run folder, a folder written by Plant.save (Python), an estimate.yaml, or a YAML file of "
    "values by name"
)
Fit = Annotated["ModelSource", typer.Option(metavar="RUN|YAML", help=f"{FIT_HELP}."), Path]
Repair = Annotated[
    bool,
    typer.Option(
        help="Fill gaps in the logs up to log.repair_s (0.1 s), and list what was filled. The files "
        "themselves stay as they are."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the random numbers.")]
Processes = Annotated[int, typer.Option(min=0, max=1024, help="Number of processes. 0 means one per core.")]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="local[:N]|slurm[:N]|ADDRESS",
        help="Simulate in N processes of this machine, in N Slurm jobs, or on the "
        "workers of the Dask scheduler at ADDRESS. The result is the same.",
    ),
]
DaskInsecure = Annotated[
    bool,
    typer.Option(
        help="Accept a scheduler without TLS. Anyone who can reach its port can then run code as you."
    ),
]
Arm = Annotated[
    str | None,
    typer.Option(
        metavar="right|left|both",
        help="Simulate the two-arm machine of the arm's file; the value names the arms that move. Columns "
        "such as right_u2_pct and left_q2_deg belong to one arm. All others apply to every arm that moves.",
    ),
]
Pose = Annotated[
    str | None,
    typer.Option(help="Name of the start pose in the arm's file [default: the first angles of the log]."),
]

COMMAND_LINES: dict[Callable[..., Any], tuple[str, str, list[inspect.Parameter]]] = {}
"""text, example and parameters on the command line of every command that is imported"""


def command(function: F) -> F:
    """Make a command of a function: its signature has plain types, and its docstring the options' texts.

    `command_line` keeps how a terminal calls it: text, example, and parameters for typer.
    """
    text, _, raises = inspect.cleandoc(function.__doc__ or "").partition("\n\nRaises:")
    plain, typed, arguments = list[inspect.Parameter](), list[inspect.Parameter](), list[str]()
    for parameter in _parameters(function):
        kind, option, *more = get_args(parameter.annotation)
        if kind is bool and parameter.default is False:  # no --no-... beside it
            option.param_decls = (f"--{parameter.name.replace('_', '-')}",)
        arguments.append(f"    {parameter.name}: {option.help}")
        plain.append(parameter.replace(annotation=getattr(kind, "__forward_arg__", kind)))
        default = None if parameter.default == () else parameter.default
        annotation = Annotated[more[0] if more else kind, option]
        typed.append(parameter.replace(kind=parameter.KEYWORD_ONLY, default=default, annotation=annotation))
    summary, _, example = text.partition("\n\nExample:")
    more = ["", f"Raises:{raises}"] if raises else []
    function.__doc__ = "\n".join((text, "", "Args:", *arguments, *more))
    function.__signature__ = inspect.Signature(plain)  # pyright: ignore[reportFunctionMemberAccess]
    COMMAND_LINES[function] = summary, f"Example:{example.partition(chr(10))[0]}", typed
    return function


def _parameters(function: Callable[..., Any]) -> Iterator[inspect.Parameter]:
    """Yield the parameters of a function, with those of the `TypedDict` of its further ones."""
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is not parameter.VAR_KEYWORD:
            yield parameter
            continue
        (several,) = get_args(parameter.annotation)
        for name, option in several.__annotations__.items():
            kind, _, *more = get_args(option)
            default = more[1] if len(more) > 1 else False if kind is bool else None
            yield inspect.Parameter(name, parameter.KEYWORD_ONLY, default=default, annotation=option)


def names(given: "str | list[str] | tuple[str, ...] | None") -> list[str]:
    """Return names that stand in a list, or in a text such as `K,D`."""
    parts = given.split(",") if isinstance(given, str) else given or ()
    return [name.strip() for name in parts if name.strip()]
