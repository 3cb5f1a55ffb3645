"""`hydroid`: the commands in their groups, and how they end.

A command's module is imported when the command is called, so that `--help` answers at once.
"""

import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from hydroid.commands import stopping
from hydroid.commands.console import log_lines, show, show_error, show_usage_error
from hydroid.commands.options import command_line
from hydroid.commands.progress import shown
from hydroid.errors import HydroidError

if TYPE_CHECKING:
    from typer.core import TyperCommand

STOPPED = 130
"""exit status of a command that Ctrl-C or a signal stopped, as in shells"""
GROUPS = {
    "Start with your own arm and log": {"init": "write a project from an arm's CAD and a log"},
    "Look at logs and at the arm": {
        "check": "find faults in logs",
        "convert": "write a log of any format as plain CSV",
        "view": "show or film the arm in motion, its collisions, its actuators",
    },
    "Fit parameters to logs": {
        "fit-mech": "stage 1: gain, damping, stiffness, masses",
        "fit-hyd": "stage 2: the hydraulic actuators",
    },
    "Judge a fit": {
        "validate": "test fits on other logs",
        "analyse": "find what the logs determine, and what each parameter does",
        "report": "draw reports anew, several side by side, or runs with different seeds as one",
    },
    "Plan what to do next": {
        "suggest": "find what the model lacks, and what to do next",
        "design": "design the next experiment",
    },
    "Use the model": {"simulate": "simulate commands, write a log"},
    "Compare settings": {"study": "fit with several settings, each over many seeds"},
}
"""every command with a summary, by the heading of its group; its module has its name"""
COMMANDS = [name for commands in GROUPS.values() for name in commands]
PLAIN: Any = {"add_completion": False, "rich_markup_mode": None, "pretty_exceptions_enable": False}
"""of typer's apps; plain help: importing rich would triple the time it takes"""


class Ended(Exception):
    """Ctrl-C or a signal ended a command; `kept`, what remains of it, follows the word `stopped`."""

    def __init__(self, stop: KeyboardInterrupt) -> None:
        kept = getattr(stop, "kept", None)
        self.kept = "" if kept is None else f"; {kept or 'nothing was written'}"
        super().__init__(self.kept)


class LazyGroup(TyperGroup):
    """Imports a command's module when the command is called, and lists the commands under their headings."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return COMMANDS

    def get_command(self, ctx: Any, cmd_name: str) -> "TyperCommand | None":
        """Return a command by its name."""
        return click_command(cmd_name) if cmd_name in COMMANDS else None

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write one section for each group."""
        width = max(map(len, COMMANDS))
        for heading, commands in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(width), summary) for name, summary in commands.items()])


def click_command(command: str) -> "TyperCommand":
    """Import a command's module and return the command."""
    name = command.replace("-", "_")
    function = getattr(import_module(f"hydroid.commands.{name}"), name)
    text, example, _ = command_line(function)
    app = typer.Typer(**PLAIN)
    app.command(command, help=text, epilog=example)(_printing(function))
    return typer.main.get_command(app)  # pyright: ignore[reportReturnType]  # a group only of several commands


def _printing(function: Callable[..., Any]) -> Callable[..., None]:
    """Return a function that calls a command and prints its result, with the options that say how."""

    def run(json: bool, quiet: bool, verbose: bool, **given: Any) -> None:
        with log_lines(verbose=verbose, quiet=quiet), shown(not (quiet or json)):
            try:
                result = function(**given)
            except KeyboardInterrupt as stop:
                raise Ended(stop) from None
        if json or not quiet:
            show(result, as_json=json)
        if result.exit_status:
            raise typer.Exit(result.exit_status)

    printed = {
        "json": Annotated[bool, typer.Option("--json", help="Print the result as JSON (docs/json.md).")],
        "quiet": Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")],
        "verbose": Annotated[
            bool, typer.Option("-v", "--verbose", help="Also print the lines that go to run.log.")
        ],
    }
    parameters = [
        *command_line(function).parameters,
        *(
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=option)
            for name, option in printed.items()
        ),
    ]
    run.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


app = typer.Typer(
    name="hydroid",
    cls=LazyGroup,
    help="Estimate the physical parameters of a hydraulic arm from logs of commands and joint angles.",
    epilog="Where to start: with the shipped arm, hydroid check and hydroid fit-mech; with your own arm, "
    "hydroid init. 'The article' is Montazeri et al. 2017, whose method hydroid follows.",
    no_args_is_help=True,
    **PLAIN,
)


def _version(wanted: bool) -> None:
    if wanted:
        from hydroid import __version__

        typer.echo(f"hydroid {__version__}")
        raise typer.Exit


@app.callback()
def _root(  # pyright: ignore[reportUnusedFunction]  # typer calls it
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    pass


def main() -> None:
    """Run a command: exit 0 when it is done, 2 for an error of the input, 130 when it was stopped."""
    stopping.listen()
    code, kept = 0, ""
    try:
        code = app(standalone_mode=False)
    except typer.Exit as end:
        code = end.exit_code
    except HydroidError as error:
        show_error(error)
        code = 2
    except (Ended, KeyboardInterrupt) as stop:
        code, kept = STOPPED, str(stop)
    except BrokenPipeError:
        sys.stderr.close()  # the reader has left; Python would complain at exit
    except Exception as error:
        if stopping.asked():  # what the interrupt met may have made another error of it
            code = STOPPED
        elif getattr(error, "show", None) is None:
            raise  # a defect of hydroid
        else:
            show_usage_error(error)
            code = int(getattr(error, "exit_code", 2))
    if code == STOPPED:
        typer.echo(f"hydroid: stopped{kept}", err=True)
    sys.exit(code or 0)
