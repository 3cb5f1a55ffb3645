"""Options that several commands share, and what makes a command of a function.

An option is `Annotated[type in Python, typer.Option(...)]`, followed by the type on the command line where
Python accepts more: a `Log` as well as a file's name.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar, get_args

import typer

if TYPE_CHECKING:
    from hydroid.commands.inputs import ConfigSource, LogSources, ModelSource, SettingChanges, Source

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
        metavar="local[:N]|slurm|ADDRESS",
        help="Simulate in N processes of this machine, in Slurm jobs (see the setting cluster), or on the "
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


def command(function: F) -> F:
    """Make a command of a function: `help()` shows what the options' texts say, and plain types."""
    own = inspect.signature(function).parameters.values()
    head, _, raises = inspect.cleandoc(function.__doc__ or "").partition("\n\nRaises:")
    arguments = [f"    {p.name}: {get_args(p.annotation)[1].help}" for p in own]
    function.__doc__ = "\n".join(
        (head, "", "Args:", *arguments, *(["", f"Raises:{raises}"] if raises else []))
    )
    shown = [p.replace(annotation=_python_type(p.annotation)) for p in own]
    function.__signature__ = inspect.Signature(shown)  # pyright: ignore[reportFunctionMemberAccess]
    return function


class CommandLine(NamedTuple):
    """What `hydroid COMMAND --help` shows of a command: its text, its example and its parameters."""

    text: str
    example: str
    parameters: list[inspect.Parameter]


def command_line(function: Callable[..., Any]) -> CommandLine:
    """Return how a terminal calls a command: its docstring without the Python, and typer's parameters."""
    paragraphs = (function.__doc__ or "").partition("\nArgs:")[0].split("\n\n")
    text = [p for p in paragraphs if not p.startswith(("    ", "Example:"))]
    (example,) = (p for p in paragraphs if p.startswith("Example:"))
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(function).parameters.values():
        kind, option, *typed = get_args(function.__annotations__[parameter.name])
        if kind is bool and parameter.default is False:  # no --no-... beside it
            option.param_decls = (f"--{parameter.name.replace('_', '-')}",)
        parameters.append(
            parameter.replace(
                kind=parameter.KEYWORD_ONLY,
                default=None if parameter.default == () else parameter.default,
                annotation=Annotated[typed[0] if typed else kind, option],
            )
        )
    return CommandLine("\n\n".join(text).strip(), example, parameters)


def _python_type(declared: Any) -> Any:
    kind = get_args(declared)[0]
    return getattr(kind, "__forward_arg__", kind)


def names(given: "str | list[str] | tuple[str, ...] | None") -> list[str]:
    """Return names that stand in a list, or in a text such as `K,D`."""
    parts = given.split(",") if isinstance(given, str) else given or ()
    return [name.strip() for name in parts if name.strip()]
