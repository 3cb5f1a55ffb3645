"""Options that several commands share, as records, and what turns a function with records into a command."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from hydroid.cli import stopping
from hydroid.cli.output import log_lines

if TYPE_CHECKING:
    from hydroid.identified_model import IdentifiedModel

Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...", help="Logs of commands and joint angles: CSV, .mat, Parquet, ROS bags, MCAP."
    ),
]
Config = Annotated[str, typer.Option(help="Settings: a YAML file, or the name of a shipped config.")]
OwnConfig = Annotated[
    str | None,
    typer.Option(
        "--config",
        help="Settings: a YAML file, or the name of a shipped config [default: config.yaml in the folder of "
        "the estimate, or else fit-mech].",
    ),
]
Folder = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for the report, tables and figures.")
]
FIT = (
    "An estimate: a run folder, a folder written by Plant.save (Python), an estimate.yaml, or a YAML file of "
    "values by name"
)
Fit = Annotated[
    Path,
    typer.Option(
        "--fit",
        "--params",
        metavar="RUN|YAML",
        help=f"{FIT}.",
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a setting, such as search.ga.generations=80."),
]
Repair = Annotated[
    bool,
    typer.Option(
        "--repair",
        help="Fill gaps in the logs up to log.repair_s (0.1 s), and list what was filled. The files "
        "themselves stay as they are.",
    ),
]

DaskInsecure = Annotated[
    bool,
    typer.Option(
        "--dask-insecure",
        help="Accept a scheduler without TLS. Anyone who can reach its port can then run code as you.",
    ),
]
Arm = Annotated[
    str | None,
    typer.Option(
        "--arm",
        metavar="right|left|both",
        help="Simulate the two-arm machine of the arm's file; the value names the arms that move. Columns "
        "that begin with right_ or left_ belong to that arm. All others apply to every arm that moves.",
    ),
]


@dataclass(kw_only=True)
class Output:
    """How a command prints its result."""

    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON (docs/json.md).")] = False
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="Also print the lines that go to run.log.")
    ] = False

    @property
    def silent(self) -> bool:
        """Whether progress is hidden."""
        return self.quiet or self.json


@dataclass(kw_only=True)
class Estimate:
    """The estimate that a command uses, and its settings."""

    fit: Fit
    config: OwnConfig = None
    setting: Set = None


@dataclass(kw_only=True)
class NominalEstimate:
    """The same, with nominal values where none are given."""

    fit: Annotated[
        Path | None,
        typer.Option(
            "--fit",
            "--params",
            metavar="RUN|YAML",
            help=f"{FIT} [default: the nominal values in the arm's file and under `hydraulics` in the "
            "settings].",
        ),
    ] = None
    config: Annotated[
        str | None,
        typer.Option(help="Settings [default: config.yaml in the folder of the estimate, or else fit-hyd]."),
    ] = None
    setting: Set = None


def nominal_model(estimate: NominalEstimate, output: Output) -> "IdentifiedModel":
    """Return the model that the options name, and say which values are nominal."""
    from hydroid.identified_model import load_identified

    changes = overrides(estimate.setting)
    model = load_identified(estimate.fit, estimate.config, changes, default="fit-hyd", nominal=True)
    if model.nominal and not output.silent:
        which = ", ".join(model.nominal) if estimate.fit else "all parameters"
        typer.echo(f"hydroid: note: nominal values for {which}", err=True)
    return model


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Return a function whose parameters are those of `function`, with each record's fields in its place."""
    hints = get_type_hints(function, include_extras=True)
    records: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(function).parameters.values():
        kind = hints[parameter.name]
        if not is_dataclass(kind):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=kind))
            continue
        records[parameter.name] = kind
        own = get_type_hints(kind, include_extras=True)
        for field in fields(kind):
            default = field.default if field.default is not _MISSING else inspect.Parameter.empty
            parameters.append(
                inspect.Parameter(
                    field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=own[field.name]
                )
            )

    def run(**given: Any) -> None:
        packed = {
            name: kind(**{field.name: given.pop(field.name) for field in fields(kind)})
            for name, kind in records.items()
        }
        output = packed.get("output", Output())
        with log_lines(verbose=output.verbose, quiet=output.quiet):
            try:
                function(**given, **packed)
            except KeyboardInterrupt as stop:
                stopping.remember(stop)
                raise

    run.__name__, run.__doc__, run.__module__ = function.__name__, function.__doc__, function.__module__
    run.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def overrides(texts: list[str] | None, **flags: Any) -> dict[str, Any]:
    """Return the settings to replace, by dotted key: those of `--set`, and the options that are not None."""
    from hydroid.settings.load import parse_override

    changes = dict(parse_override(text) for text in texts or [])
    return changes | {key: value for key, value in flags.items() if value is not None}


def names(text: str) -> list[str]:
    """Split a list such as `K,D`."""
    return [name.strip() for name in text.split(",") if name.strip()]


_MISSING = fields(Estimate)[0].default
