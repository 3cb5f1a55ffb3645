"""What makes a command of a function: its parameters are the options, its docstring says what each is.

A line of `Args:` is `name (VALUE): text`; VALUE is what `--help` calls it, or the range of a number. What
parameters of several commands are stands in `SHARED`. Those before `*` need no name on the command line.
"""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

import typer

P = ParamSpec("P")
R = TypeVar("R")

SHARED = """
    logs (LOG): Logs of commands and joint angles: CSV, .mat, Parquet, ROS bags, MCAP.
    fit (RUN|YAML): An estimate: a run folder, a folder written by Plant.save (Python), an estimate.yaml, or a
        YAML file of values by name.
    out (DIR): Folder for page and tables [default: runs/COMMAND on the command line; in Python nothing is
        written].
    config (YAML): Settings: a file, or the name of a shipped config. A run brings its own.
    set (KEY=VALUE): Replace a setting, such as search.ga.generations=80.
    repair: Fill gaps in the logs up to log.repair_s (0.1 s), and list what was filled. The files themselves
        stay as they are.
    seed (0 or more): Seed of the random numbers. The same seed gives exactly the same result.
    dask (local[:N]|ADDRESS): Simulate in N processes of this machine, or on the workers of the Dask
        scheduler at ADDRESS. The result is the same.
    arm (right|left|both): Simulate the two-arm machine of the arm's file; the value names the arms that move.
        Columns such as right_u2_pct and left_q2_deg belong to one arm. All others apply to every arm that
        moves.
    pose (NAME): The start pose, one of the arm's file [default: the first angles of the log].

    algorithm (NAME): Search: ga, nsga2 or multistart.
    start (RUN|YAML): Start the search from the values of an estimate.
    resume: Continue the stopped run in --out; start it if there is none.
    refinement: After the search, refine its estimate by least squares.
    threads (N): Number of threads (0: one per core, or with --dask one per worker).
"""

TERMINAL: dict[str, Any] = {
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

COMMAND_LINES: dict[Callable[..., Any], tuple[str, str, list[inspect.Parameter]]] = {}
"""text, example and parameters on the command line of every command that is imported"""


def command(function: Callable[P, R]) -> Callable[P, R]:
    """Make a command of a function: describe all its parameters in its docstring, and keep them for typer."""
    text, _, raises = inspect.cleandoc(function.__doc__ or "").partition("\n\nRaises:")
    text, _, arguments = text.partition("\n\nArgs:")
    summary, _, example = text.partition("\n\nExample:")
    entries = _entries(SHARED) | _entries(arguments)
    parameters = inspect.signature(function).parameters.values()
    lines = [f"    {p.name}: {entries[p.name][1]}" for p in parameters]
    more = ["", f"Raises:{raises}"] if raises else []
    function.__doc__ = "\n".join((text, "", "Args:", *lines, *more))
    typed = [_typed(p, *entries[p.name]) for p in parameters]
    COMMAND_LINES[function] = summary, f"Example:{example.partition(chr(10))[0]}", typed
    return function


def _entries(text: str) -> dict[str, tuple[str, str]]:
    """Return VALUE and text of the parameters that a docstring describes."""
    found = re.findall(r"^ {4}(\w+)(?: \((.+?)\))?: (.*(?:\n {8}.*)*)", text, re.MULTILINE)
    return {name: (value, " ".join(words.split())) for name, value, words in found}


def _typed(parameter: inspect.Parameter, value: str, text: str) -> inspect.Parameter:
    """Return a parameter as typer takes it."""
    names = re.findall(r"\w+", inspect.formatannotation(parameter.annotation))
    one = next(TERMINAL[name] for name in names if name in TERMINAL)
    kind = list[one] if {"Sequence", "LogSources", "SettingChanges"} & {*names} else one
    default = None if parameter.default == () else parameter.default
    spelt = [f"--{parameter.name.replace('_', '-')}"]
    if parameter.name == "out":
        spelt.append("-o")
    how: dict[str, Any] = {"metavar": value or None, "help": text}
    if limits := re.fullmatch(r"(\S+) (?:or more|to (\S+))", value):
        how |= {"metavar": None, "min": one(limits[1]), "max": limits[2] and one(limits[2])}
    if parameter.kind is parameter.POSITIONAL_OR_KEYWORD:
        option = typer.Argument(**how)
    else:  # of one that is on or left to the settings there is also --no-...
        option = typer.Option(*([] if one is bool and default is not False else spelt), **how)
    annotation = Annotated[kind | None if default is None else kind, option]
    return parameter.replace(kind=parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def names(given: str | list[str] | tuple[str, ...] | None) -> list[str]:
    """Return names that stand in a list, or in a text such as `K,D`."""
    parts = given.split(",") if isinstance(given, str) else given or ()
    return [name.strip() for name in parts if name.strip()]
