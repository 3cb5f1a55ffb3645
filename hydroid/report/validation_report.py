"""The report of a validation: how well several fits predict several logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hydroid.fitting.validation import ErrorIndices
from hydroid.log import Log
from hydroid.parameters import Array
from hydroid.report.fit_report import INDICES, INDICES_NOTE, MOST_RESPONSES, index_cells
from hydroid.report.joint_record import JointRecord, joint_record
from hydroid.report.names import file_name, log_names, short_name, unique
from hydroid.report.page import Page, Plot, Section
from hydroid.report.plots.responses import overlay
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
    sources = list(dict.fromkeys(result.log.source for result in results))
    names = dict(zip(sources, log_names(sources), strict=True))
    rows: list[tuple[Cell, ...]] = []
    overlays: dict[object, tuple[JointRecord, dict[str, Array]]] = {}
    for result in results:
        for column, (joint, indices) in enumerate(result.indices.items()):
            record = joint_record(result.log, joint, names[result.log.source])
            # fits that read the log with another delay or period were not compared with the same record
            key = (record.log, joint, record.measured.tobytes(), record.command.tobytes())
            _, responses = overlays.setdefault(key, (record, {}))
            name = unique(short_name(result.fit), responses)
            responses[name] = result.response[:, column]
            rows.append((name, record.log, joint, *index_cells(indices)))
    header = ("fit", "log", "joint", *INDICES)
    table = Table("Output error on given logs", header, tuple(rows), INDICES_NOTE, (INDICES[0], INDICES[2]))
    plots = _plots(list(overlays.values()))
    left_out = len(overlays) - len(plots)
    more = f" {left_out} further responses are not drawn; the table has all errors." if left_out else ""
    fits, count = len({row[0] for row in rows}), len(names)
    lead = f"{fits} fit{'s' * (fits != 1)} on {count} log{'s' * (count != 1)}.{more}"
    section = Section("Output error", tables={"validation": table}, plots=plots)
    return Page("validation", "Validation", lead, (section,))


def _plots(overlays: Sequence[tuple[JointRecord, Mapping[str, Array]]]) -> tuple[Plot, ...]:
    """Return plots of the records with the largest errors, MOST_RESPONSES at most."""
    worst = [
        max(
            float(np.nan_to_num(np.mean((record.measured - response) ** 2), nan=np.inf))
            for response in each.values()
        )
        for record, each in overlays
    ]
    taken: set[str] = set()
    plots: list[Plot] = []
    for i in sorted(np.argsort(worst, kind="stable")[::-1][:MOST_RESPONSES]):
        record, responses = overlays[i]
        name = file_name(f"validation_{Path(record.log).stem}_joint_{record.joint}", taken)
        caption = f"Joint {record.joint} in {record.log}: angle, residual and command."
        plots.append(Plot(name, caption, partial(overlay, record, responses)))
    return tuple(plots)
