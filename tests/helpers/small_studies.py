"""A study of seconds for tests: two cells, two seeds, three seconds of a log of the virtual rig."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import yaml

from hydroid import read_logs
from hydroid.progress import no_progress
from hydroid.studies import Row, run_study

RIG = Path(__file__).parents[2] / "examples" / "logs" / "rig_shoulder_1.csv"


def content(**changes: Any) -> dict[str, Any]:
    """A study's file as plain values."""
    study: dict[str, Any] = {
        "title": "Two norms",
        "base": "article-mech",
        "set": {
            "search.algorithm": "ga",
            "search.ga.population": 6,
            "search.ga.generations": 2,
            "refinement": None,
        },
        "logs": ["short.csv"],
        "axes": {"norm": {"largest": {"objective.norm": "inf"}, "mean": {"objective.norm": 1}}},
        "seeds": 2,
    }
    return study | changes


def written(folder: Path, **changes: Any) -> Path:
    """The file and its log, in a folder."""
    head = RIG.read_text().splitlines()[:302]
    (folder / "short.csv").write_text("\n".join(head) + "\n")
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump(content(**changes), sort_keys=False))
    return file


def run(file: Path, out: Path) -> tuple[Row, ...]:
    """Run a study in this process."""
    with ThreadPoolExecutor(1) as executor:
        return run_study(file, out, read_logs, executor, no_progress)
