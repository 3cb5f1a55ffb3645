"""Thousands of damaged files of every kind: each is read correctly, or refused in one line.

    python benchmarks/fuzz.py [--inputs 4000] [--first 0] [--only KIND]

A file is made from the name of its kind and a number: `--only KIND --first N --inputs 1` repeats a failure.
Every kind is read in two processes of its own. A file that ends with a traceback, is misread, or takes too
long is named. A file that kills its process ends the kind: its batch is named, with those after it.
"""

import os
import sys
import tempfile
import traceback
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from common import ROOT, options

sys.path.insert(0, str(ROOT / "tests" / "helpers"))

RUNS = ("run.json", "config.yaml", "arm.yaml", "estimate.yaml", "checkpoint.npz")
BATCH = 50


def read(name: str, numbers: range, place: Path) -> list[str]:
    """Read some files of one kind; return what failed."""
    from fuzz import KINDS, run_kinds

    kept = place / str(os.getpid())  # a run of this process, for what needs one
    kept.mkdir(exist_ok=True)
    kind, failed = (KINDS | {kind.name: kind for kind in run_kinds(kept)})[name], list[str]()
    for number in numbers:
        try:
            with tempfile.TemporaryDirectory(dir=place) as room:
                kind.read(Path(room), kind.make(number))
        except Exception:
            failed.append(f"FAILED {name} {number}: {traceback.format_exc()}")
    return failed


def study(name: str, first: int, count: int) -> int:
    """Read all files of a kind, print what failed, and return how many did."""
    batches, failed = [range(first + count)[n:][:BATCH] for n in range(first, first + count, BATCH)], 0
    with tempfile.TemporaryDirectory() as place, ProcessPoolExecutor(2) as pool:
        for batch, job in [(batch, pool.submit(read, name, batch, Path(place))) for batch in batches]:
            try:
                failures = job.result()
            except Exception as error:
                failures = [f"FAILED {name} {batch[0]} to {batch[-1]}: {error}"]
            failed += len(failures)
            print(*failures, sep="\n", end="")
    print(f"{name:16} {count:6} files, {failed} failed", flush=True)
    return failed


if __name__ == "__main__":
    from fuzz import KINDS

    given = options(__doc__, inputs=4000, first=0, only="")
    names = [given.only] if given.only else [*KINDS, *RUNS]
    sys.exit(sum(study(name, given.first, max(1, given.inputs // len(names))) for name in names) > 0)
