"""The article's tables and figures over many seeds: `make article`, and `make article QUICK=1`.

    python benchmarks/article/run.py [--quick] [--processes N] [STUDY ...]

Every run leaves a file in runs/article; what was stopped goes on with the same command, and studies share the
runs that they have in common. The results (a CSV of all runs for each study, figures, about.json) go to
docs/reproduction/, and the page that is written from them to docs/reproduction.md. The short form has two
seeds, 15 s of data and few generations, and writes to runs/article-quick alone.
"""

import argparse
import json
import os
import platform
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from figures import draw
from page import page
from statements import statements
from studies import DETERMINED_AT_DEG, Plan, Runs, load_studies

from hydroid.posterior.flags import WEAK_ABOVE
from hydroid.progress import no_progress
from hydroid.reporting.study_report import runs_csv
from hydroid.studies.execution import processes

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Run the studies, and write results and page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("studies", nargs="*")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--processes", type=int, default=0)
    given = parser.parse_args()
    folder = ROOT / "runs" / ("article-quick" if given.quick else "article")
    results = folder / "results" if given.quick else ROOT / "docs" / "reproduction"
    results.mkdir(parents=True, exist_ok=True)
    every = load_studies()
    plans = [Plan(n, every[n], given.quick) for n in every if n in (given.studies or every)]
    with processes(given.processes) as executor:
        made = [plan.run(folder, executor, no_progress) for plan in plans]
    for runs in made:
        write_study(runs, results)
    if given.studies:
        return
    text = json.dumps(account(made, quick=given.quick), indent=1, ensure_ascii=False) + "\n"
    (results / "about.json").write_text(text, encoding="utf-8")
    target = results.with_suffix(".md")
    target.write_text(page(results), encoding="utf-8")
    print(target)


def write_study(runs: Runs, results: Path) -> None:
    """Write a study's runs and the figures that are the article's."""
    if runs.rows:
        (results / f"{runs.plan.name}_runs.csv").write_text(runs_csv(runs.rows), encoding="utf-8")
    for figure in runs.plan.study.figures:
        if figure.item:
            file = results / f"{figure.item.replace(' ', '_')}.svg"
            draw(runs, figure).savefig(file, metadata={"Date": None})


def account(studies: Sequence[Runs], *, quick: bool) -> dict[str, Any]:
    """Return with what the studies were run, and what the CSV files do not tell.

    A run's seconds count as the median of its cell: a machine that slept would count otherwise.
    """
    distinct = {
        task.key(): (task.cell, result)
        for runs in studies
        for task, result in zip(runs.plan.tasks, runs.results, strict=True)
    }
    seconds = dict[str, list[float]]()
    for cell, result in distinct.values():
        seconds.setdefault(cell, []).append(result.get("seconds", 0.0))
    code = Counter(str(result.get("code", "not recorded")) for _, result in distinct.values())
    return {
        "versions": {name: version(name) for name in ("hydroid", "mujoco", "numpy", "scipy")},
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "quick": quick,
        "runs": len(distinct),
        "seconds": round(sum(float(np.median(times)) * len(times) for times in seconds.values())),
        "code": dict(code),
        "facts": {runs.plan.name: facts(runs) for runs in studies},
        "findings": {
            runs.plan.name: [
                {"says": v.says, "outcome": v.outcome.value, "detail": v.detail, "item": v.item}
                for v in statements(runs)
            ]
            for runs in studies
        },
    }


def facts(runs: Runs) -> dict[str, str]:
    """Return what was run on what."""
    plan, log = runs.plan, runs.problem.logs[0]
    found = {"base settings": plan.study.base}
    if plan.tasks:
        total = sum(row.values.get("simulations", 0.0) for row in runs.rows)
        seconds = sum(row.values.get("seconds", 0.0) for row in runs.rows)
        found["seeds"] = f"1 to {max(task.seed for task in plan.tasks)}"
        found["simulations"] = f"{total:,.0f} in {seconds:,.0f} s of one core"
    found["data"] = f"{log.duration:.3g} s, " + (
        "simulated at the truth under random commands, no noise"
        if plan.study.simulated is not None
        else ", ".join(Path(one.source).name for one in plan.logs)
    )
    if (known := runs.directions) is not None:
        limit = f"to {100 * WEAK_ABOVE:g} % or better at {DETERMINED_AT_DEG:g} deg of white noise"
        found["identifiable directions"] = f"{known.rank} of {len(known.names)} ({limit})"
    return found


if __name__ == "__main__":
    main()
