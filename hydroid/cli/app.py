"""`hydroid`: the commands in their groups, and how they end.

Nothing heavy is imported before a command runs, so that `--help` answers at once.
"""

import sys
from typing import Any

import typer
from typer.core import TyperGroup

from hydroid.cli import (
    convert,
    fit,
    judge,
    look,
    model,
    motion,
    options,
    plan,
    report,
    start,
    stopping,
    study,
)

STOPPED = 130
"""exit status of a command that Ctrl-C or a signal stopped, as in shells"""
GROUPS = {
    "start": "Start with your own arm and log",
    "look": "Look at logs, at the arm and at its actuators",
    "fit": "Fit parameters to logs",
    "judge": "Judge a fit",
    "plan": "Plan what to do next",
    "model": "Use and build models",
    "study": "Compare settings over many seeds",
}


class Grouped(TyperGroup):
    """Lists the commands of a group under its heading."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write one section for each group."""
        width = max(map(len, self.commands))
        for name, heading in GROUPS.items():
            commands = [(n, c) for n, c in self.commands.items() if getattr(c, "rich_help_panel", "") == name]
            with formatter.section(heading):
                limit = formatter.width - 6 - width
                formatter.write_dl([(n.ljust(width), c.get_short_help_str(limit)) for n, c in commands])


app = typer.Typer(
    name="hydroid",
    cls=Grouped,
    help="Estimate the physical parameters of a hydraulic arm from logs of commands and joint angles.",
    epilog="Where to start: with the shipped arm, hydroid check and hydroid fit-mech; with your own arm, "
    "hydroid init. 'The article' is Montazeri et al. 2017, whose method hydroid follows.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help: importing rich would triple the time it takes
    pretty_exceptions_enable=False,
)


COMMANDS = (
    ("start", start.init, "write a project from an arm's CAD and a log", "mine --arm robot.urdf --log a.csv"),
    ("look", look.check, "find faults in logs", "LOG.csv"),
    ("look", convert.convert, "write a log of any format as plain CSV", "LOG.mat --out LOG.csv"),
    ("look", motion.view, "show the arm in motion", "runs/hyd"),
    ("look", motion.render, "film the arm beside the ghost of the measured one", "runs/hyd -o arm.mp4"),
    ("look", motion.collisions, "find bodies that meet along a trajectory", "LOG.csv --arm right"),
    ("look", look.plot_actuator, "draw the curves of an actuator", "--fit runs/hyd --joint 2"),
    ("fit", fit.fit_mech, "stage 1: gain, damping, stiffness, masses", "LOG.csv --out runs/mech"),
    ("fit", fit.fit_hyd, "stage 2: the hydraulic actuators", "LOG.csv --mech runs/mech --out runs/hyd"),
    ("fit", fit.collect, "merge runs with different seeds", "'runs/array/seed-*'"),
    ("judge", judge.validate, "test fits on other logs", "OTHER.csv --fit runs/mech --fit runs/hyd"),
    ("judge", judge.identifiability, "find what the logs determine", "LOG.csv --fit runs/hyd --profile A_A"),
    ("judge", judge.sensitivity, "draw the effect of each parameter", "LOG.csv --fit runs/mech"),
    ("judge", judge.surface, "draw the error over two parameters", "LOG.csv --fit runs/mech --over K,D"),
    ("judge", report.report, "draw reports anew, several side by side", "runs/hyd runs/validation"),
    ("plan", plan.suggest, "find what the model lacks, and what to do next", "--fit runs/hyd"),
    ("plan", plan.design, "design the next experiment", "LOG.csv --fit runs/mech --duration 30"),
    ("model", model.simulate, "simulate commands, write a log", "COMMANDS.csv --fit runs/hyd --out sim.csv"),
    ("study", study.study, "run a study of your own", "my-study.yaml --seeds 10"),
)
"""group, function, summary and example of each command"""

for _group, _function, _summary, _example in COMMANDS:
    _name = _function.__name__.replace("_", "-")
    app.command(
        _name, rich_help_panel=_group, short_help=_summary, epilog=f"Example: hydroid {_name} {_example}"
    )(options.command(_function))


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
    from hydroid.cli.output import show_error, show_usage_error
    from hydroid.errors import HydroidError

    stopping.listen()
    try:
        code = app(standalone_mode=False)
    except typer.Exit as end:
        code = end.exit_code
    except HydroidError as error:
        show_error(error)
        code = 2
    except KeyboardInterrupt:
        code = STOPPED
    except BrokenPipeError:
        sys.stderr.close()  # the reader has left; Python would complain at exit
        code = 0
    except Exception as error:
        if stopping.asked():  # what the interrupt met may have made another error of it
            code = STOPPED
        elif getattr(error, "show", None) is None:
            raise  # a defect of hydroid
        else:
            show_usage_error(error)
            code = int(getattr(error, "exit_code", 2))
    if code == STOPPED:
        typer.echo(f"hydroid: stopped{stopping.kept()}", err=True)
    sys.exit(code or 0)
