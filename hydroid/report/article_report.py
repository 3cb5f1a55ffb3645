"""The article's evaluation as a page: every table and figure with its verdicts; and what was run, as data."""

import os
import platform
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from hydroid.report.page import Page, Section
from hydroid.report.study_report import QUICK, facts
from hydroid.report.table import Table
from hydroid.study.claims import Outcome, Verdict
from hydroid.study.study import StudyRuns


def article_page(studies: Sequence[StudyRuns], items: Iterable[str], seconds: float) -> Page:
    """Return the page of all studies: the verdicts on each of the article's items, and where they stand."""
    by_study = {runs.plan.name: runs for runs in studies}
    every = [v for runs in studies for v in (*runs.verdicts, *runs.findings)]
    rows = []
    for item in items:
        makers = [name for name, runs in by_study.items() if item in runs.plan.study.items]
        titles = "; ".join(by_study[name].plan.study.title for name in makers)
        rows.append((item, tally(v for v in every if v.item == item and not v.ours), titles))
    overview = Table("Tables and figures", ("item", "verdicts", "made in"), tuple(rows))
    sections = [Section("Every table and figure", tables={"items": overview})]
    for runs in studies:
        points = tuple(v.sentence for v in (*runs.verdicts, *runs.findings))
        text, link = ", ".join(runs.plan.study.items).capitalize(), f"{runs.plan.name}/{runs.plan.name}.html"
        sections.append(Section(runs.plan.study.title, text, points, link=link))
    quick = (QUICK,) if any(runs.plan.quick for runs in studies) else ()
    count = sum(len(runs.rows) for runs in studies)
    lead = (
        f"Of the article's conclusions: {tally(v for v in every if not v.ours)}. "
        f"{count} runs of {len(studies)} studies; this call took {seconds:.0f} s."
    )
    return Page("article", "The article, put to the test", lead, tuple(sections), quick)


def tally(verdicts: Iterable[Verdict]) -> str:
    """Return how many verdicts there are of each kind, in words."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    return ", ".join(f"{counts[outcome]} {outcome.value}" for outcome in Outcome if counts[outcome])


def account(studies: Sequence[StudyRuns], *, quick: bool) -> dict[str, Any]:
    """Return with what the studies were run, and what the CSV files of their runs do not tell, as JSON.

    A run's seconds count as the median of its cell: a machine that slept would count otherwise.
    """
    distinct = {
        task.key(): (task.cell, result)
        for s in studies
        for task, result in zip(s.plan.tasks, s.results, strict=True)
    }
    code = Counter(str(result.get("code", "not recorded")) for _, result in distinct.values())
    seconds = dict[str, list[float]]()
    for cell, result in distinct.values():
        seconds.setdefault(cell, []).append(result.get("seconds", 0.0))
    return {
        "versions": {name: version(name) for name in ("hydroid", "mujoco", "numpy", "scipy")},
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "quick": quick,
        "runs": len(distinct),
        "seconds": round(sum(float(np.median(times)) * len(times) for times in seconds.values())),
        "code": dict(code),
        "facts": {s.plan.name: dict(facts(s)) for s in studies},
        "findings": {s.plan.name: [_finding(v) for v in s.findings] for s in studies},
    }


def _finding(verdict: Verdict) -> Mapping[str, str]:
    return {
        "says": verdict.says,
        "outcome": verdict.outcome.value,
        "detail": verdict.detail,
        "item": verdict.item,
    }
