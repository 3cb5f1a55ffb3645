"""Results to files: the report of a fit, of several runs, of a validation."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from hydroid.files import write_atomic
from hydroid.fitting.fit import Fit
from hydroid.fitting.search import HISTORY
from hydroid.fitting.validation import ErrorIndices
from hydroid.log import Log
from hydroid.parameters import Array, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.report.channels import Channel, channel, channels, file_name, log_names, short_name, unique
from hydroid.report.identifiability import direction_table, noise_table
from hydroid.report.table import Table
from hydroid.report.tables import (
    SeedResult,
    ValidationRow,
    objective_table,
    parameter_table,
    pareto_table,
    runs_table,
    validation_table,
)
from hydroid.run.folder import RunFolder
from hydroid.uncertainty.flags import Flag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# plots and pages are imported where they are made: matplotlib takes longer than a command that draws nothing

MOST_RESPONSES = 12
"""responses drawn at most, those with the largest errors: many short logs are told by the table"""


class Validated(Protocol):
    """A fit's response to a log: simulated outputs [rad], shape (T, K), and indices by joint (1-based)."""

    @property
    def fit(self) -> str: ...  # noqa: D102
    @property
    def log(self) -> Log: ...  # noqa: D102
    @property
    def response(self) -> Array: ...  # noqa: D102
    @property
    def indices(self) -> Mapping[int, ErrorIndices]: ...  # noqa: D102


def write_report(
    folder: RunFolder, problem: Problem, fit: Fit, truth: Mapping[str, float] | None = None
) -> list[Path]:
    """Write a fit's tables, figures, raw history and Pareto set, and report.html; return the files.

    Args:
        folder: the run.
        problem: the problem.
        fit: what was found.
        truth: true values by name, in a study on simulated data.

    Raises:
        RunError: the folder cannot be read or written.
    """
    from hydroid.report import plots
    from hydroid.report.page import fit_page

    tables = {
        "parameters": parameter_table(problem, fit, truth),
        "errors": objective_table(problem, fit),
        "directions": direction_table(fit.identifiability),
        "noise": noise_table(problem, fit.uncertainty),
    }
    drawn = {
        **_responses(problem, fit),
        "learning": plots.learning(problem, fit),
        "pareto": plots.pareto(problem, fit),
        "estimates": plots.estimates(problem, fit, truth),
        **plots.told(fit.uncertainty, fit.identifiability),
    }
    vector = {name: plots.svg(figure) for name, figure in drawn.items()}
    page = fit_page(folder.settings().arm.name, folder.identity(), problem, fit, tables, vector)
    written = [write_table(folder.path, name, table) for name, table in tables.items()]
    written += [write_figure(folder.path, name, figure, vector[name]) for name, figure in drawn.items()]
    files = {
        "tables/pareto.csv": pareto_table(problem, fit).csv(),
        "history.csv": _history(fit),
        "pareto.csv": _pareto(problem, fit),
        "report.html": page,
    }
    for name, content in files.items():
        write_atomic(folder.path / name, content)
    return [path for group in written for path in group] + [folder.path / name for name in files]


def write_runs(
    out: Path, results: Sequence[tuple[int, Problem, Fit]], truth: Mapping[str, float] | None = None
) -> Table:
    """Write the spread over several runs with their seeds; return the table of their final estimates."""
    parameters = results[0][1].parameters
    ignore = [
        name
        for i, name in enumerate(parameters.names)
        if all(fit.uncertainty.status[i].flag is Flag.NO_EFFECT for _, _, fit in results)
    ]
    found = {"search": [SeedResult(seed, fit.searched.theta, fit.searched.rms) for seed, _, fit in results]}
    if any(fit.refinement is not None for _, _, fit in results):
        found["refined"] = [SeedResult(seed, fit.best.theta, fit.best.rms) for seed, _, fit in results]
    return write_spread(out, parameters, found, ignore, truth)


def write_spread(
    out: Path,
    parameters: ParameterSet,
    found: Mapping[str, Sequence[SeedResult]],
    ignore: Collection[str],
    truth: Mapping[str, float] | None = None,
) -> Table:
    """Write tables and a figure of the spread over runs; return the table of the last estimate.

    Args:
        out: folder to write.
        parameters: of all runs.
        found: one result a run, by the name of the estimate: `search`, and `refined` where there is one.
        ignore: parameters without effect in any run.
        truth: true values by name.
    """
    from hydroid.report import plots

    tables = {name: runs_table(parameters, runs, truth, ignore, name) for name, runs in found.items()}
    for name, table in tables.items():
        write_table(out, f"runs_{name}", table)
    figure = plots.runs(parameters, found, truth, ignore)
    write_figure(out, "runs", figure, plots.svg(figure))
    return list(tables.values())[-1]


def write_validation(out: Path, results: Sequence[Validated]) -> Table:
    """Write the error indices of several fits on several logs, and overlay plots; return the table."""
    from hydroid.report import plots

    sources = list(dict.fromkeys(result.log.source for result in results))
    names = dict(zip(sources, log_names(sources), strict=True))
    rows: list[ValidationRow] = []
    overlays: dict[object, tuple[Channel, dict[str, Array]]] = {}
    for result in results:
        for column, (joint, indices) in enumerate(result.indices.items()):
            record = channel(result.log, joint, names[result.log.source])
            # fits that read the log with another delay or period were not compared with the same record
            key = (record.log, joint, record.measured.tobytes(), record.command.tobytes())
            _, overlay = overlays.setdefault(key, (record, {}))
            name = unique(short_name(result.fit), overlay)
            overlay[name] = result.response[:, column]
            rows.append(ValidationRow(name, record.log, joint, indices))
    taken: set[str] = set()
    for record, overlay in overlays.values():
        figure = plots.validation(record, overlay)
        name = file_name(f"validation_{Path(record.log).stem}_joint_{record.joint}", taken)
        taken.add(name.lower())
        write_figure(out, name, figure, plots.svg(figure))
    table = validation_table(rows)
    write_table(out, "validation", table)
    return table


def _responses(problem: Problem, fit: Fit) -> "dict[str, Figure]":
    """Figures of the channels, one by one, the worst of them where there are many."""
    from hydroid.report import plots

    known = channels(problem)
    errors = [np.mean((c.measured - c.simulated(fit.best.responses)) ** 2) for c in known]
    worst = sorted(np.argsort(np.nan_to_num(errors, nan=np.inf))[::-1][:MOST_RESPONSES])
    alone = len(known) == 1
    return {
        "response" if alone else f"response_{known[i].index[0] + 1}_joint_{known[i].joint}": plots.response(
            problem, fit, known[i]
        )
        for i in worst
    }


def write_table(out: Path, name: str, table: Table) -> list[Path]:
    """Write a table as CSV, Markdown and LaTeX under `tables`; return the files."""
    faces = {"csv": table.csv(), "md": table.markdown(), "tex": table.latex()}
    for ending, content in faces.items():
        write_atomic(out / "tables" / f"{name}.{ending}", content)
    return [out / "tables" / f"{name}.{ending}" for ending in faces]


def write_figure(out: Path, name: str, figure: "Figure", vector: bytes) -> list[Path]:
    """Write a figure, whose SVG is made already, as PNG and SVG under `figures`; return the files."""
    from hydroid.report import plots

    faces = {"png": plots.png(figure), "svg": vector}
    for ending, content in faces.items():
        write_atomic(out / "figures" / f"{name}.{ending}", content)
    return [out / "figures" / f"{name}.{ending}" for ending in faces]


def _history(fit: Fit) -> str:
    """The history to its last bit, in the units of the search: `best` and `median` in rad unless relative."""
    counts = len(HISTORY) - 2
    rows = tuple((*(int(v) for v in row[:counts]), *(float(v) for v in row[counts:])) for row in fit.history)
    return Table("", HISTORY, rows).csv()


def _pareto(problem: Problem, fit: Fit) -> str:
    """The Pareto set to its last bit, in the units of the search."""
    theta, evaluation = fit.front
    unit = "" if problem.settings.objective.relative else "_rad"
    segments = (f"segment_{s}{unit}" for s in range(1, evaluation.segments.shape[1] + 1))
    header = (*problem.parameters.names, *segments, f"overall{unit}")
    rows = np.column_stack([theta, evaluation.segments, evaluation.overall])
    return Table("", header, tuple(tuple(map(float, row)) for row in rows)).csv()
