"""Thousands of damaged files of every kind: each is read correctly, or refused in one line.

    python benchmarks/fuzz.py [--inputs 4000] [--first 0] [--only KIND]

A file is made from the name of its kind and a number: `--only KIND --first N --inputs 1` repeats a failure.
Each batch runs in a process of its own. A batch that takes too long, crashes, ends with a traceback,
or misreads a log counts as failed, and is named.
"""

import subprocess
import sys
import tempfile
import traceback
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import Any

from common import options

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "tests" / "helpers"))

BATCH, SECONDS_PER_BATCH = 50, 600.0
RUNS = ("run.json", "config.yaml", "arm.yaml", "estimate.yaml", "checkpoint.npz")


def read(name: str, first: int, count: int) -> int:
    """Read some files of one kind in this process; print and return the number of failures."""
    from fuzz import KINDS, run_kinds

    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "kept").mkdir()
        kinds = {kind.name: kind for kind in chain(KINDS.values(), run_kinds(Path(folder) / "kept"))}
        for number in range(first, first + count):
            try:
                kinds[name].read(Path(folder) / "room", kinds[name].make(number))
            except Exception:
                failed += 1
                print(f"FAILED {name} {number}: {traceback.format_exc()}", flush=True)
    return failed


def batch(job: tuple[str, int, int]) -> tuple[str, int, str]:
    """Read some files in another process; return their kind, whether it failed, and what it printed."""
    name, first, count = job
    command = [sys.executable, str(HERE), "--batch", name, "--first", str(first), "--inputs", str(count)]
    how: dict[str, Any] = {
        "capture_output": True,
        "text": True,
        "errors": "replace",
        "timeout": SECONDS_PER_BATCH,
    }
    try:
        done = subprocess.run(command, **how)
    except subprocess.TimeoutExpired:
        return name, 1, f"FAILED {name} {first} to {first + count}: more than {SECONDS_PER_BATCH:g} s\n"
    return name, int(done.returncode != 0), done.stdout + (done.stderr[-2000:] if done.returncode else "")


def study(names: list[str], first: int, inputs: int) -> int:
    """Read all kinds, two processes at a time, and print a line per kind; return how many batches failed."""
    count, failed = max(1, inputs // len(names)), dict.fromkeys(names, 0)
    starts = range(first, first + count, BATCH)
    jobs = [(name, start, min(BATCH, first + count - start)) for name in names for start in starts]
    with ThreadPoolExecutor(2) as pool:
        for name, failure, text in pool.map(batch, jobs):
            failed[name] += failure
            print(text, end="", flush=True)
    for name in names:
        print(f"{name:16} {count:6} files, {failed[name]} failed batches")
    return sum(failed.values())


if __name__ == "__main__":
    given = options(__doc__, inputs=4000, first=0, only="", batch="")
    if given.batch:
        sys.exit(read(given.batch, given.first, given.inputs) > 0)
    from fuzz import KINDS

    sys.exit(study([given.only] if given.only else [*KINDS, *RUNS], given.first, given.inputs) > 0)
