"""The report of a validation: how well several fits predict several logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hydroid.fitting.validation import ErrorIndices
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report.fit_report import INDICES, INDICES_NOTE, index_cells
from hydroid.report.page import Page, Section, file_name, log_names, short_name, unique
from hydroid.report.responses import JointResponse, response_plots
from hydroid.report.table import Cell, Table


@dataclass(frozen=True, eq=False)
class Validation:
    """One fit's response to one log: outputs [rad], shape (T, K), and error indices by joint (1-based)."""

    fit: str
    log: Log
    response: Array
    indices: Mapping[int, ErrorIndices]


def validation_page(results: Sequence[Validation]) -> Page:
    """Return the page of several fits on several logs; its table is `validation` (article, table 9)."""
    logs = {result.log.source: result.log for result in results}
    names = dict(zip(logs, log_names(list(logs.values())), strict=True))
    rows: list[tuple[Cell, ...]] = []
    records: dict[object, tuple[JointResponse, dict[str, Array]]] = {}
    for result in results:
        log, name = result.log, names[result.log.source]
        for column, (joint, indices) in enumerate(result.indices.items()):
            command, measured = log.command[:, joint - 1], log.angle[:, joint - 1]
            simulated: dict[str, Array] = {}
            response = JointResponse(name, joint, log.time, command, measured, simulated)
            # fits that read the log with another delay or period were not compared with the same record
            key = name, joint, measured.tobytes(), command.tobytes()
            _, simulated = records.setdefault(key, (response, simulated))
            fit = unique(short_name(result.fit), simulated)
            simulated[fit] = result.response[:, column]
            rows.append((fit, name, joint, *index_cells(indices)))
    table = Table(
        "Output error on given logs",
        ("fit", "log", "joint", *INDICES),
        tuple(rows),
        INDICES_NOTE,
        INDICES[:3:2],
    )
    taken: set[str] = set()
    responses = {
        file_name(f"validation_{Path(each.log).stem}_joint_{each.joint}", taken): each
        for each, _ in records.values()
    }
    plots, more = response_plots(responses, [max(each.mean_squares()) for each in responses.values()])
    fits, count = len({row[0] for row in rows}), len(names)
    lead = f"{fits} fit{'s' * (fits != 1)} on {count} log{'s' * (count != 1)}.{more}"
    section = Section("Output error", tables={"validation": table}, plots=plots)
    return Page("validation", "Validation", lead, (section,))
