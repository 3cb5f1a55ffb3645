"""`hydroid`: one file a command, and how commands end.

Nothing heavy is imported before a command runs, so that `--help` answers at once.
"""

import sys

import typer

from hydroid.cli import (
    check,
    collect,
    design,
    fit,
    identifiability,
    model,
    plot_actuator,
    sensitivity,
    simulate,
    stopping,
    surface,
    validate,
    view,
)

STOPPED = 130
"""exit status of what Ctrl-C or a signal ended, as shells have it"""

app = typer.Typer(
    name="hydroid",
    help="Find the physical parameters of a hydraulic manipulator from logs of commands and joint angles.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help: importing rich would triple the time it takes
    pretty_exceptions_enable=False,
)
app.command("fit-mech")(fit.fit_mech)
app.command("fit-hyd")(fit.fit_hyd)
app.command("validate")(validate.validate)
app.command("simulate")(simulate.simulate)
app.command("check")(check.check)
app.command("collect")(collect.collect)
app.command("identifiability")(identifiability.identifiability)
app.command("sensitivity")(sensitivity.sensitivity)
app.command("surface")(surface.surface)
app.command("design")(design.design)
app.command("plot-actuator")(plot_actuator.plot_actuator)
app.command("view")(view.view)
app.command("build-model")(model.build_model)


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
    """Run a command: exit 0 done, 2 for what the user can mend, 130 when stopped."""
    from hydroid.errors import HydroidError

    stopping.listen()
    try:
        code = app(standalone_mode=False)
    except typer.Exit as end:
        code = end.exit_code
    except HydroidError as error:
        code = _fail(str(error))
    except KeyboardInterrupt:
        code = STOPPED
    except BrokenPipeError:
        sys.stderr.close()  # the reader has left; Python would complain at exit
        code = 0
    except Exception as error:  # after a notice: what the interrupt met may have made another error of it
        code = STOPPED if stopping.asked() else _usage(error)
    if code == STOPPED:
        message = "stopped; what was computed is kept, and the same command with --resume goes on"
        typer.echo(f"hydroid: {message}", err=True)
    sys.exit(code or 0)


def _fail(message: str) -> int:
    typer.echo(f"hydroid: {' '.join(message.split())}", err=True)
    return 2


def _usage(error: Exception) -> int:
    """Show click's own errors (a missing argument, an unknown option) its way; let defects through."""
    show = getattr(error, "show", None)
    if show is None:
        raise error
    show()
    return int(getattr(error, "exit_code", 2))
