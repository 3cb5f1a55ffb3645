"""Thousands of damaged files of every kind: each is read correctly, or refused in one line.

    python benchmarks/fuzz.py [--inputs 4000] [--only KIND]

A file is made from the name of its kind and a number: `--only KIND --first N --inputs 1` repeats a failure.
Each batch runs in a process of its own. A batch that takes too long, crashes, ends with a traceback,
or misreads a log counts as failed, and is named.
"""

import argparse
import subprocess
import sys
import tempfile
import traceback
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "tests" / "helpers"))

BATCH = 50
SECONDS_PER_BATCH = 600.0


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


def batch(name: str, first: int, count: int) -> tuple[str, int, str]:
    """Read some files in another process; return their kind, whether it failed, and what it printed."""
    command = [sys.executable, str(HERE), "--batch", name, "--first", str(first), "--inputs", str(count)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=SECONDS_PER_BATCH, errors="replace"
        )
    except subprocess.TimeoutExpired:
        return name, 1, f"FAILED {name} {first} to {first + count}: more than {SECONDS_PER_BATCH:g} s\n"
    return name, int(done.returncode != 0), done.stdout + (done.stderr[-2000:] if done.returncode else "")


def main() -> None:
    """Read all kinds, two processes at a time, and print a line per kind."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--inputs", type=int, default=4000, help="files in all")
    parser.add_argument("--first", type=int, default=0, help="number of the first file of each kind")
    parser.add_argument("--only", help="one kind")
    parser.add_argument("--batch", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.batch:
        sys.exit(read(given.batch, given.first, given.inputs) > 0)
    from fuzz import KINDS

    runs = ("run.json", "config.yaml", "arm.yaml", "estimate.yaml", "checkpoint.npz")
    names = [given.only] if given.only else [*KINDS, *runs]
    count = max(1, given.inputs // len(names))
    jobs = [
        (name, given.first + start, min(BATCH, count - start))
        for name in names
        for start in range(0, count, BATCH)
    ]
    failed = dict.fromkeys(names, 0)
    with ThreadPoolExecutor(2) as pool:
        for name, failure, text in pool.map(lambda job: batch(*job), jobs):
            failed[name] += failure
            print(text, end="", flush=True)
    for name in names:
        print(f"{name:16} {count:6} files, {failed[name]} failed batches")
    sys.exit(any(failed.values()))


if __name__ == "__main__":
    main()
