"""A study of seconds for tests: two cells, two seeds, three seconds of simulated data."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import yaml

from hydroid import read_logs
from hydroid.progress import no_progress
from hydroid.study.study import StudyRuns, plan_study, run_study

TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}


def content(**changes: Any) -> dict[str, Any]:
    """A study's file as plain values."""
    small = {"search.algorithm": "ga", "search.ga.population": 6, "search.ga.generations": 2}
    study: dict[str, Any] = {
        "title": "Two norms",
        "base": "article-mech",
        "set": small | {"refinement": None},
        "data": {"truth": TRUTH, "simulated": {"duration_s": 3}},
        "axes": {"norm": {"largest": {"objective.norm": "inf"}, "mean": {"objective.norm": 1}}},
        "seeds": 2,
        "tables": [
            {
                "title": "Errors",
                "columns": ["parameter error", "identifiable error", "rms error"],
                "article": {"mean": [9.67, None, None]},
            }
        ],
        "claims": [
            {"says": "One is better", "column": "parameter error", "lower": "largest", "than": "mean"}
        ],
    }
    return study | changes


def written(folder: Path, **changes: Any) -> Path:
    """The file, in a folder."""
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump(content(**changes), sort_keys=False))
    return file


def run(file: Path, out: Path, seeds: int | None = None) -> StudyRuns:
    """Run a study in this process."""
    plan = plan_study(file, lambda paths, settings: read_logs(paths, settings), seeds=seeds)
    with ThreadPoolExecutor(1) as executor:
        return run_study(plan, out, executor, no_progress)
