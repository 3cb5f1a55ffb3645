"""`hydroid`: the commands in their groups, and how they end.

A command's module is imported when the command is called, so that `--help` answers at
once.
"""

import errno
import inspect
import os
import sys
from collections.abc import Callable
from itertools import chain
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import hydroid
from hydroid.commands.console import log_lines, program, show, show_error, tell
from hydroid.commands.progress import VISIBLE, listen, stopped
from hydroid.errors import HydroidError, RunError, Stopped

if TYPE_CHECKING:
    from typer.core import TyperCommand

GROUPS = {
    "Start with your own arm and log": {
        "init": "write a project from an arm's CAD and a log"
    },
    "Look at logs and at the arm": {
        "check": "find faults in logs",
        "convert": "write a log of any format as plain CSV",
        "view": "show or film the arm in motion, and find its collisions",
    },
    "Fit parameters to logs": {
        "fit-mech": "stage 1: gain, damping, stiffness, masses",
        "fit-hyd": "stage 2: the hydraulic actuators",
        "adapt": "refit a few parameters to new logs",
    },
    "Judge a fit": {
        "validate": "test fits on other logs",
        "analyse": "find which parameters the logs determine, and how well",
        "report": "draw reports anew, or merge runs with different seeds",
    },
    "Plan what to do next": {
        "suggest": "find what the model lacks, and what to do next",
        "design": "design the next experiment",
    },
    "Use the model": {
        "simulate": "simulate commands, write a log",
        "follow": "find commands that lead the arm along a path",
        "export": "write the fitted machine for other programs",
    },
    "Compare settings": {"study": "fit with several settings, each over many seeds"},
}
"""every command with a summary, by the heading of its group"""
COMMANDS = [*chain.from_iterable(GROUPS.values())]
PLAIN: Any = {
    "add_completion": False,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}
"""of typer's apps; plain help: importing rich would triple the time it takes"""


OUT = {"simulate": "runs/simulated.csv", "follow": "runs/follow/commands.csv"}
"""what commands write without --out, where it is no folder of their name"""
SYSTEM = (
    errno.ENAMETOOLONG,
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.EACCES,
    errno.EIO,
    errno.EMFILE,
)
"""what a system refuses that no program can help"""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""what keeps linear algebra from sums over several threads,
whose last bits depend on how many there are"""
STOPPED = 130
"""exit status of what was interrupted, as in shells"""
VERBOSE = "Also print all tables, findings, and the lines that go to run.log."


class LazyGroup(TyperGroup):
    """Imports a command's module when the command is called,
    and lists the commands under their headings."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return COMMANDS

    def get_command(self, ctx: Any, cmd_name: str) -> "TyperCommand | None":
        """Return a command by its name."""
        if cmd_name in COMMANDS:
            return click_command(cmd_name)
        return None

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write one section for each group."""
        # of all groups, so that their columns are aligned
        width = max(map(len, COMMANDS))
        for heading, commands in GROUPS.items():
            rows = [(name.ljust(width), summary) for name, summary in commands.items()]
            with formatter.section(heading):
                formatter.write_dl(rows)


def click_command(command: str) -> "TyperCommand":
    """Return a command, which prints the result of the function of its name."""
    function: Callable[..., Any] = getattr(hydroid, command.replace("-", "_"))
    from hydroid.commands.inputs import COMMAND_LINES

    text, example, parameters = COMMAND_LINES[function]

    def run(
        *,
        json: Annotated[
            bool,
            typer.Option("--json", help="Print the result as JSON (docs/json.md)."),
        ] = False,
        quiet: Annotated[
            bool, typer.Option("-q", "--quiet", help="Print errors only.")
        ] = False,
        verbose: Annotated[bool, typer.Option("-v", "--verbose", help=VERBOSE)] = False,
        **given: Any,
    ) -> None:
        # in Python nothing is written then
        if given.get("out", "") is None and command != "view":
            given["out"] = OUT.get(command, f"runs/{command}")
        VISIBLE.set(not (quiet or json))
        with log_lines(verbose=verbose, quiet=quiet):
            result = function(**given)
        if json or not quiet:
            show(result, as_json=json, verbose=verbose)
        raise typer.Exit(result.exit_status)

    *printing, _ = inspect.signature(run).parameters.values()
    run.__signature__ = inspect.Signature([*parameters, *printing])  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ |= {
        parameter.name: parameter.annotation for parameter in parameters
    }
    alone = typer.Typer(**PLAIN)
    alone.command(command, help=text, epilog=example)(run)
    # a group only of several commands
    made: Any = typer.main.get_command(alone)
    for parameter in made.params:
        if parameter.param_type_name == "argument":
            # its name says what it is; typer would add the type of Python
            parameter.display_type_rich = _no_type
    return made


def _no_type(ctx: Any) -> str:
    """Return what stands behind the name of an argument: nothing."""
    return ""


ABOUT = "Estimate the physical parameters of a hydraulic arm from logs of commands and joint angles."
WHERE_TO_START = (
    "Where to start: hydroid init for your own arm; hydroid check and hydroid fit-mech for the arm "
    "that comes with hydroid.  'The article' is Montazeri et al. 2017, whose method hydroid follows."
)

app = typer.Typer(
    name="hydroid", cls=LazyGroup, help=ABOUT, epilog=WHERE_TO_START, **PLAIN
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"hydroid {hydroid.__version__}")
        raise typer.Exit


@app.callback()
def _root(  # pyright: ignore[reportUnusedFunction]  # typer calls it
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    pass


def main() -> None:
    """Run a command: exit 0 when it is done, 2 for an error of the input,
    130 when it was stopped."""
    # numpy is not imported yet
    for variable in ONE_THREAD:
        os.environ.setdefault(variable, "1")
    code = 0
    kept: str | None = None
    try:
        code = _run()
    except KeyboardInterrupt as stop:
        code = STOPPED
        kept = None
        if isinstance(stop, Stopped):
            kept = str(stop)
    except BrokenPipeError:
        # the reader has left; Python would complain at exit
        sys.stderr.close()
    except Exception as error:
        code = _ending(error)
    if code == STOPPED:
        rest = ""
        if kept is not None:
            rest = f"; {kept or 'nothing was written'}"
        tell(f"hydroid: stopped{rest}")
    sys.exit(code)


def _run() -> int:
    """Run the command of the command line, and return its exit status."""
    try:
        listen()
        group: Any = typer.main.get_command(app)
        with group.make_context(program(), sys.argv[1:] or ["--help"]) as context:
            group.invoke(context)
    except typer.Exit as end:
        return end.exit_code
    return 0


def _ending(error: Exception) -> int:
    """Say what is wrong, and return the exit status; raise a defect of hydroid
    again."""
    is_users = isinstance(error, HydroidError) or hasattr(error, "format_message")
    if is_users:
        show_error(error)
        return 2
    if isinstance(error, OSError) and error.errno in SYSTEM:
        what = f"cannot be used ({error.strerror})"
        where = error.filename or "a temporary file, or numba's cache,"
        hint = "" if error.filename else "see TMPDIR and NUMBA_CACHE_DIR"
        show_error(RunError(what, where, hint))
        return 2
    # what the interrupt met may have made another error of it
    if stopped():
        return STOPPED
    raise error
