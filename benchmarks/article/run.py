"""The article's tables and figures over many seeds: `make article`, and `make article ARGS=--quick`.

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
from importlib.metadata import version
from pathlib import Path

import pandas
from figures import draw
from measures import DETERMINED_AT_DEG
from page import page
from studies import Plan, Runs, load_studies

from hydroid.posterior.uncertainty import WEAK_ABOVE
from hydroid.studies import processes

ROOT = Path(__file__).parents[2]


def main(chosen: list[str], processes_at_most: int, *, quick: bool) -> None:
    """Run the studies, and write results and page."""
    folder = ROOT / "runs" / ("article-quick" if quick else "article")
    results = folder / "results" if quick else ROOT / "docs" / "reproduction"
    results.mkdir(parents=True, exist_ok=True)
    plans = [Plan(n, study, quick) for n, study in load_studies().items() if n in chosen or not chosen]
    with processes(processes_at_most) as executor:
        made = [plan.run(folder, executor) for plan in plans]
    for runs in made:
        if runs.rows:
            rows = [{"cell": r.cell, "seed": r.seed, "failed": r.failed, **r.values} for r in runs.rows]
            pandas.DataFrame(rows).to_csv(results / f"{runs.plan.name}_runs.csv", index=False)
        for figure in runs.plan.study.figures:
            draw(runs, figure, results / f"{figure.item.replace(' ', '_')}.svg")
    if not chosen:
        about = {
            "versions": {name: version(name) for name in ("hydroid", "mujoco", "numpy", "scipy")},
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            "quick": quick,
            "facts": {runs.plan.name: facts(runs) for runs in made},
        }
        text = json.dumps(about, indent=1, ensure_ascii=False) + "\n"
        (results / "about.json").write_text(text, encoding="utf-8")
        target = results.with_suffix(".md")
        target.write_text(page(results), encoding="utf-8")
        print(target)


def facts(runs: Runs) -> dict[str, str]:
    """Return what was run on what."""
    plan, log = runs.plan, runs.problem.logs[0]
    data = "simulated at the truth under random commands, no noise"
    if plan.study.simulated is None:
        data = ", ".join(Path(one.source).name for one in plan.logs)
    found = {"base settings": plan.study.base, "data": f"{log.duration:.3g} s, {data}"}
    if (known := runs.directions) is not None:
        limit = f"to {100 * WEAK_ABOVE:g} % or better at {DETERMINED_AT_DEG:g} deg of white noise"
        count = int(known.parameters.free.sum())
        found["identifiable directions"] = f"{known.rank} of {count} ({limit})"
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--processes", type=int, default=0)
    given = parser.parse_args()
    main(given.studies, given.processes, quick=given.quick)
