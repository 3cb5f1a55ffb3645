"""Kill runs at random moments, resume them, and compare what they end with with runs left alone, bit for bit.

    python benchmarks/kill_resume.py [--kills 100] [--seed 1] [--only ga nsga2 refinement multistart study]

Every run is killed (SIGKILL) twice before it may end, so that resumed runs are killed as well. Half of the
moments are drawn from the time that the run takes, the earlier the likelier; the others follow files: the
temporary twin of a checkpoint or of any file appears, or the checkpoint grows. All files are compared but
for the log, the lock and the last checkpoint but one.

Nothing in hydroid knows of this. To save time, processes are forked from one that has the imports and figures
stay empty; to be hit more often, the checkpoint is written after every generation, not every five seconds.
"""

import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

from common import EXAMPLES, Clock, options

from hydroid.commands.app import main as hydroid
from hydroid.fitting import checkpoints
from hydroid.reporting import page_file

GA = "--algorithm ga --set search.ga.population=10 --set search.ga.generations="
KINDS = {
    "ga": GA + "30 --no-refinement",
    "nsga2": "--set search.nsga2.population=10 --set search.nsga2.generations=30 --no-refinement",
    "refinement": GA + "0 --set joint_refinement=true --set parameters.M3.fixed=22.5",
    "multistart": "--algorithm multistart --set search.multistart.starts=3 --set refinement.iterations=5",
    "study": GA + "5 --set refinement.iterations=5 --runs 3",
}


def run(folder: Path, kind: str) -> None:
    """Begin or resume a run of `hydroid fit-mech` in this process."""
    checkpoints.SAVE_EVERY = 0.0
    page_file.write_page = lambda *_: []
    os.chdir(folder.parent)  # what a run stores names its folder as it was given
    out = ["--out", folder.name, "--resume", "-q"]
    sys.argv = ["hydroid", "fit-mech", "../log.csv", *KINDS[kind].split(), *out]
    hydroid()


def finish(folder: Path, kind: str, due: Callable[[], bool] = lambda: False) -> bool:
    """Run to the end, or until a moment has come; return whether the run was killed then."""
    process = get_context("fork").Process(target=run, args=(folder, kind))
    process.start()
    while process.is_alive() and not due():
        time.sleep(2e-5)
    process.kill()
    process.join()
    if process.exitcode not in (0, -signal.SIGKILL):
        raise SystemExit(f"a run ended with status {process.exitcode}")
    return process.exitcode != 0


def moment(folder: Path, duration: float, rng: random.Random) -> Callable[[], bool]:
    """Return a question that becomes true when it is time to kill."""
    if rng.random() < 0.5:
        due = time.monotonic() + duration * rng.random() ** 2
        return lambda: time.monotonic() > due
    which, times = rng.choice((".checkpoint.npz.*.part", ".*.part", "checkpoint.npz")), rng.randint(1, 40)
    seen = set[object]()

    def enough() -> bool:
        for file in folder.rglob(which):
            with suppress(OSError):
                seen.add(file if file.suffix == ".part" else (file, file.stat().st_size))
        return len(seen) >= times

    return enough


def files(folder: Path) -> dict[str, bytes | dict[str, object]]:
    """Return all that a run stored, by name; of run.json without how long the run took."""
    kept = (p for p in folder.rglob("*") if p.is_file())
    course = {".lock", "run.log", "checkpoint.previous.npz"}
    return {str(p.relative_to(folder)):
            json.loads(p.read_bytes()) | {"seconds": 0} if p.name == "run.json" else p.read_bytes()
            for p in kept if p.name not in course}  # fmt: skip


def study(kind: str, work: Path, share: int, rng: random.Random) -> int:
    """Kill runs of a kind; return how many differ."""
    whole, killed = work / "whole" / "run", work / "killed" / "run"
    for folder in (whole, killed):
        folder.parent.mkdir()
    began = time.monotonic()
    finish(whole, kind)
    duration, expected = time.monotonic() - began, files(whole)
    kills, trials, failed = 0, 0, 0
    while kills < share:
        shutil.rmtree(killed, ignore_errors=True)
        kills += sum(finish(killed, kind, moment(killed, duration, rng)) for _ in range(2))
        finish(killed, kind)
        left = files(killed)
        differing = [n for n in sorted(expected.keys() | left.keys()) if expected.get(n) != left.get(n)]
        trials, failed = trials + 1, failed + bool(differing)
        print(f"{kind}: differs in {', '.join(differing)}\n" * bool(differing), end="")
    same = f"{trials - failed} of {trials} bit-identical"
    print(f"{kind:10} {kills:4} kills in {trials} runs of {duration:.1f} s: {same}", flush=True)
    return failed


if __name__ == "__main__":
    given = options(__doc__, kills=100, seed=1, only=list(KINDS))
    rng, clock, bad = random.Random(given.seed), Clock(), 0
    for kind in given.only:
        with tempfile.TemporaryDirectory() as place:
            lines = (EXAMPLES / "logs" / "rig_shoulder_1.csv").read_text().splitlines()[:601]
            (Path(place) / "log.csv").write_text("\n".join(lines) + "\n")
            bad += study(kind, Path(place), -(-given.kills // len(given.only)), rng)
    print(f"{bad} runs that differ, {clock}")
    sys.exit(bool(bad))
