"""`hydroid validate`, `identifiability`, `sensitivity` and `surface`."""

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import FIT, Estimate, Folder, Logs, Output, OwnConfig, Repair, Set, names, overrides
from hydroid.cli.output import rows, show
from hydroid.cli.progress import Progress

if TYPE_CHECKING:
    from hydroid.identified_model import IdentifiedModel
    from hydroid.report.uncertainty_report import UncertaintyStudy


class Stage(Enum):
    """The two stages."""

    MECH = "mech"
    HYD = "hyd"


def validate(
    logs: Logs,
    output: Output,
    fit: Annotated[
        list[Path],
        typer.Option(
            "--fit",
            "--params",
            metavar="RUN|YAML",
            help=f"{FIT}. Repeat the option for several estimates.",
        ),
    ],
    out: Folder = Path("runs/validation"),
    setting: Set = None,
    repair: Repair = False,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out",
            help="Give the fit's own logs. For each of them: refit without it, and predict it.",
        ),
    ] = False,
) -> None:
    """Test fits on logs that they were not fitted to: error indices (article, table 9) and plots."""
    from hydroid.api.judge import validate
    from hydroid.identified_model import load_identified

    models = [load_identified(path, overrides=overrides(setting)) for path in fit]
    study = validate(models, logs, out, repair=repair, leave_one_out=leave_one_out)
    found = [row for result in study.result for row in result.plain()]
    warnings = [f"- {warning}" for warning in study.page.warnings]
    table = study.page.tables["errors"]
    show(output, lambda: {"results": found}, [table, *warnings, str(out / "validation.html")])


def identifiability(
    logs: Logs,
    output: Output,
    fit: Annotated[
        Path | None,
        typer.Option(
            "--fit",
            "--params",
            metavar="RUN|YAML",
            help=f"{FIT} [default: the start values of the parameters].",
        ),
    ] = None,
    config: OwnConfig = None,
    stage: Annotated[
        Stage,
        typer.Option(
            help="Settings to use if neither --config nor a run folder gives any: those of fit-mech (mech) "
            "or of fit-hyd (hyd)."
        ),
    ] = Stage.MECH,
    profile: Annotated[
        str,
        typer.Option(
            metavar="K,D", help="Parameters to profile. Each point of a profile takes a refinement."
        ),
    ] = "",
    out: Folder = Path("runs/identifiability"),
    setting: Set = None,
    repair: Repair = False,
) -> None:
    """Find which parameters, and which combinations of parameters, the logs determine.

    Prints the standard deviation and the 95 % interval of each parameter, and the combinations that the logs
    do not determine.
    """
    from hydroid.api.judge import identifiability
    from hydroid.api.look import load_settings, read_logs
    from hydroid.identified_model import load_identified, start_values
    from hydroid.words import sentence

    default, changes = f"fit-{stage.value}", overrides(setting)
    if fit is None:
        model = start_values(load_settings(config or default, changes))
    else:
        model = load_identified(fit, config, changes, default=default)
    with Progress(quiet=output.silent) as progress:
        study = identifiability(
            model,
            read_logs(logs, model.settings, repair=repair),
            out,
            profile=names(profile),
            progress=progress,
        )
    notes = [f"- {sentence(finding)}" for finding in study.result.summary.findings]
    moved = [study.result.moved] if study.result.moved else []
    lines = [study.result.table, *moved, *notes, str(out / "identifiability.html")]
    show(output, lambda: _uncertainty(study.result), lines)


def sensitivity(
    logs: Logs,
    estimate: Estimate,
    output: Output,
    out: Folder = Path("runs/sensitivity"),
    repair: Repair = False,
) -> None:
    """Draw the effect of each free parameter on each output over time (article, figure 10).

    One figure shows the change of the output when a parameter of the estimate grows by 1 %. The other shows
    the response for 20 values of the parameter within its bounds. Both are also written as CSV.
    """
    from hydroid.api.judge import sensitivity
    from hydroid.api.look import read_logs

    model = _model(estimate)
    with Progress(quiet=output.silent) as progress:
        study = sensitivity(model, read_logs(logs, model.settings, repair=repair), out, progress=progress)
    found = rows(study.table, "log", "output", "parameter", "rms_per_percent")
    show(output, lambda: {"results": found}, [study.table, str(out / f"{study.page.name}.html")])


def surface(
    logs: Logs,
    estimate: Estimate,
    output: Output,
    over: Annotated[list[str], typer.Option(metavar="K,D", help="Two parameters; repeat for several pairs.")],
    points: Annotated[int, typer.Option(min=3, max=301, help="Grid points along each axis.")] = 31,
    around: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1000,
            metavar="PCT",
            help="Draw ±PCT % around the estimate [default: from bound to bound].",
        ),
    ] = None,
    out: Folder = Path("runs/surface"),
    repair: Repair = False,
) -> None:
    """Draw the error as a function of two parameters, with the others at the estimate (article, figure 11).

    The error is that of the whole log. The setting objective.norm says which one: inf is the largest error,
    2 the rms error, 1 the mean absolute error. Change it with --set objective.norm=2.
    """
    from hydroid.api.judge import surface
    from hydroid.api.look import read_logs

    pairs = [_pair(text) for text in over]
    model = _model(estimate)
    grid = points, None if around is None else around / 100
    with Progress(quiet=output.silent) as progress:
        study = surface(
            model, read_logs(logs, model.settings, repair=repair), pairs, out, grid=grid, progress=progress
        )
    error = "error" if model.settings.objective.relative else "error_deg"
    keys = ("parameters", "first_lowest", "second_lowest", f"lowest_{error}")
    found = rows(study.table, *keys, "first_estimate", "second_estimate", f"estimate_{error}")
    show(output, lambda: {"results": found}, [study.table, str(out / f"{study.page.name}.html")])


def _model(estimate: Estimate) -> "IdentifiedModel":
    from hydroid.identified_model import load_identified

    return load_identified(estimate.fit, estimate.config, overrides(estimate.setting))


def _pair(text: str) -> tuple[str, str]:
    pair = names(text)
    if len(pair) != 2:
        raise typer.BadParameter(f"{text!r} is no pair of parameters, such as K,D", param_hint="--over")
    return pair[0], pair[1]


def _uncertainty(study: "UncertaintyStudy") -> dict[str, Any]:
    from hydroid.estimate import finite

    content, profiles = study.summary.plain(), {p.name: p.interval for p in study.profiles}
    for name, parameter in content["estimate"].items():
        parameter["profile_interval"] = [finite(end) for end in profiles[name]] if name in profiles else None
    rank = study.identifiability.rank
    return {"at": study.source, "rank": rank} | {key: content[key] for key in ("findings", "estimate")}
