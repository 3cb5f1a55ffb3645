"""A study as a page: verdicts, tables with the article's numbers, figures, failed runs; all runs as CSV."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.report.page import Page, Plot, Section, file_name
from hydroid.report.study_figures import draw
from hydroid.report.table import Cell, Table
from hydroid.settings.study_shown import StudyTable
from hydroid.study.claims import Verdict
from hydroid.study.measures import Row
from hydroid.study.study import StudyPlan, StudyRuns

SPREAD = "Ours: median of the seeds [lowest, highest]."
CAPTIONS = {
    "convergence": "Best objective so far: median over the seeds; shaded: the middle half of them.",
    "spread": "One dot per run, a line at the median of each cell, a cross at the article's value.",
    "responses": "Dashed: the data. Of each cell the run whose error is the median of its seeds.",
    "commands": "The command is held between samples.",
    "segments": "Each segment of the record is one objective.",
    "segment bests": "Thin: the best candidate of each segment. Thick: the estimate, their average.",
    "sensitivity": "Dark: lower bound; light: upper bound; dashed: the data. All else is at the truth.",
    "surface": "All other parameters are at the truth.",
    "arm": "Drawn from the meshes of the arm's file.",
    "flow chart": "With the settings of the study's first cell.",
}
"""what each kind of figure shows"""
QUICK = "The short form: few seeds, short data, few generations. It shows that the study runs, nothing else."


def study_page(runs: StudyRuns) -> Page:
    """Return the page of a study; what its titles have before a colon names tables and figures.

    Its CSV holds every run.
    """
    study, plan = runs.plan.study, runs.plan
    taken: set[str] = set()
    tables = study_tables(runs)
    plots: list[Plot] = []
    for figure in study.figures:
        name = _name(figure.title, taken)
        plots.append(Plot(name, f"{figure.title}. {CAPTIONS[figure.kind]}", partial(draw, runs, figure)))
    found = conclusions([*runs.verdicts, *runs.findings])
    sections = [Section(heading, points=tuple(sentences)) for heading, sentences in found.items()]
    sections.append(Section("What was compared", text=study.about, facts=facts(runs)))
    if tables:
        sections.append(Section("Numbers", tables=tables))
    if plots:
        sections.append(Section("Figures", plots=tuple(plots)))
    failed = failures(runs.rows)
    if failed.rows:
        sections.append(Section("Runs that failed", tables={"failed": failed}))
    warnings = [QUICK] if plan.quick else []
    if failed.rows:
        warnings.append(f"{len(failed.rows)} of {len(runs.rows)} runs failed; they are listed below.")
    lead = (
        f"{len(plan.cells)} cells over {plan.seeds} seeds." if plan.tasks else "Drawn at the true parameters."
    )
    data = {f"{plan.name}_runs.csv": runs_csv(runs.rows)} if runs.rows else {}
    return Page(plan.name, study.title, lead, tuple(sections), tuple(warnings), data=data)


def study_tables(runs: StudyRuns) -> dict[str, Table]:
    """Return the tables of a study by name, such as table_6."""
    plan, taken = runs.plan, set[str]()
    return {
        _name(table.title, taken): study_table(table, runs.rows, list(plan.cells), plan.units)
        for table in plan.study.tables
    }


def _name(title: str, taken: set[str]) -> str:
    return file_name(title.partition(":")[0].lower(), taken)


def study_table(
    table: StudyTable, rows: Sequence[Row], cells: Sequence[str], units: Mapping[str, str]
) -> Table:
    """Return a table with our median and spread of its cells, and the article's values below it."""
    lines: list[tuple[Cell, ...]] = []
    for cell in table.cells or cells:
        mine = [row for row in rows if row.cell == cell]
        good = [row for row in mine if not row.failed]
        count = f"{len(good)}" if len(good) == len(mine) else f"{len(good)} of {len(mine)}"
        lines.append((cell, "ours", count, *(spread([row.values[c] for row in good]) for c in table.columns)))
        if cell in table.article:
            printed = ("" if v is None else f"{v:g}" for v in table.article[cell])
            lines.append((cell, "article", "", *printed))
    named = (f"{c} [{units[c]}]" if units[c] else c for c in table.columns)
    return Table(
        table.title, ("cell", "from", "runs", *named), tuple(lines), f"{SPREAD} {table.note}".strip()
    )


def spread(values: Sequence[float]) -> str:
    """Return median, lowest and highest of some values, as text."""
    known = np.array(values, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size:
        return ""
    low, middle, high = (_short(float(f(known))) for f in (np.min, np.median, np.max))
    return f"{middle} [{low}, {high}]" if known.size > 1 else middle


def _short(value: float) -> str:
    """Return a number with three digits, or all of those before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def conclusions(verdicts: Sequence[Verdict]) -> dict[str, list[str]]:
    """Return what was found of the claims, in sentences, by heading."""
    found = {
        "Claims": [v.sentence for v in verdicts if not v.ours],
        "Further claims, not the article's": [v.sentence for v in verdicts if v.ours],
    }
    return {heading: sentences for heading, sentences in found.items() if sentences}


def facts(runs: StudyRuns) -> tuple[tuple[str, str], ...]:
    """Return what was run on what."""
    plan = runs.plan
    found = [("base settings", plan.study.base), ("cells", "; ".join(plan.cells))]
    if plan.tasks:
        total = sum(row.values.get("simulations", 0.0) for row in runs.rows)
        seconds = sum(row.values.get("seconds", 0.0) for row in runs.rows)
        found += [
            ("seeds", f"1 to {plan.seeds}"),
            ("simulations", f"{total:,.0f} in {seconds:,.0f} s of one core"),
        ]
    found.append(("data", _data(plan)))
    if runs.directions is not None:
        known = runs.directions
        at = f"{plan.study.data.determined_at_deg:g} deg of white noise"
        limit = f"to {100 * WEAK_ABOVE:g} % or better at {at}"
        found.append(("identifiable directions", f"{known.rank} of {len(known.names)} ({limit})"))
    return tuple(found)


def _data(plan: StudyPlan) -> str:
    simulated, logs = plan.study.data.simulated, plan.data.logs
    if simulated is None:
        return ", ".join(f"{Path(log.source).name}, {log.duration:.4g} s" for log in logs)
    noise = f"{simulated.noise_deg:g} deg of noise" if simulated.noise_deg else "no noise"
    return f"simulated at the truth under random commands, {logs[0].duration:.3g} s, {noise}"


def failures(rows: Sequence[Row]) -> Table:
    """Return the runs that failed, and why."""
    failed = tuple((row.cell, row.seed, row.failed) for row in rows if row.failed)
    return Table("Failed runs", ("cell", "seed", "why"), failed)


def runs_csv(rows: Sequence[Row]) -> str:
    """Return all runs with all measures."""
    names = sorted({name for row in rows for name in row.values})
    cells = tuple((r.cell, r.seed, r.failed, *(r.values.get(n) for n in names)) for r in rows)
    return Table("", ("cell", "seed", "failed", *names), cells).csv()
