"""Kill runs at random moments, resume them, and compare what they end with with runs left alone, bit for bit.

    python benchmarks/kill_resume.py --kills 100 --seed 1

Five kinds of run: simple GA, NSGA-II, the joint refinement, multi-start least squares, and a study of
several seeds. Every run is killed (SIGKILL) twice before it may end, so that resumed runs are killed as well.
Half of the moments are drawn from the time that the run takes, the earlier the likelier; the others follow
files: the temporary twin of a checkpoint or of any file appears, or the refinement's checkpoint grows.
What a kill has met is read from what it left. All files are compared, but for the log, the lock and the last
checkpoint but one.

Nothing in hydroid knows of this. To save time, processes are forked from one that has the imports and figures
stay empty; to be hit more often, the checkpoint is written after every generation, not every five seconds.
"""

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hydroid.commands.app import main as hydroid
from hydroid.fitting import checkpoints
from hydroid.reporting import page_file

LOG = Path(__file__).parents[1] / "examples" / "logs" / "rig_shoulder_1.csv"
SAMPLES = 600
GA = ["--algorithm", "ga", "--set", "search.ga.population=10"]
KINDS: dict[str, list[str]] = {
    "ga": [*GA, "--set", "search.ga.generations=30", "--no-refinement"],
    "nsga2": [
        "--set",
        "search.nsga2.population=10",
        "--set",
        "search.nsga2.generations=30",
        "--no-refinement",
    ],
    "refinement": [
        *GA,
        "--set",
        "search.ga.generations=0",
        "--set",
        "joint_refinement=true",
        "--set",
        "parameters.M3.fixed=22.5",
    ],
    "multistart": [
        "--algorithm",
        "multistart",
        "--set",
        "search.multistart.starts=3",
        "--set",
        "refinement.iterations=5",
    ],
    "study": [*GA, "--set", "search.ga.generations=5", "--set", "refinement.iterations=5", "--runs", "3"],
}
OWN = {".lock", "run.log", "checkpoint.previous.npz"}
"""files of a run that tell of its course"""


def start(folder: Path, log: Path, options: list[str]) -> int:
    """Begin or resume the run; return the process."""
    pid = os.fork()
    if pid:
        return pid
    with (folder.parent / "stderr").open("a") as errors:
        os.dup2(errors.fileno(), 2)
        os.dup2(errors.fileno(), 1)
    checkpoints.SAVE_EVERY = 0.0
    page_file.write_page = lambda *_: []
    sys.argv = ["hydroid", "fit-mech", str(log), *options, "--out", str(folder), "--resume", "--quiet"]
    code = 99
    try:
        hydroid()
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os._exit(code)


def ended(pid: int) -> int | None:
    """Exit status of a process that has ended, -9 where it was killed."""
    done, status = os.waitpid(pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if done else None


def finish(folder: Path, log: Path, options: list[str]) -> float:
    """Run to the end; return the seconds it took."""
    began = time.monotonic()
    pid = start(folder, log, options)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    if code:
        raise SystemExit(f"{folder}: exit status {code}\n{(folder.parent / 'stderr').read_text()}")
    return time.monotonic() - began


def moment(folder: Path, duration: float, rng: random.Random) -> Callable[[], bool]:
    """A question that becomes true when it is time to kill."""
    began = time.monotonic()
    match rng.choice(["time", "time", "time", "checkpoint", "file", "size"]):
        case "checkpoint":
            return seen(lambda: parts(folder, ".checkpoint.npz."), rng.randint(1, 20))
        case "file":
            return seen(lambda: parts(folder, "."), rng.randint(1, 60))
        case "size":
            return seen(lambda: sizes(folder), rng.randint(1, 60))
        case _:
            after = duration * rng.random() ** 2
            return lambda: time.monotonic() - began > after


def seen(look: Callable[[], set[object]], times: int) -> Callable[[], bool]:
    """A question that becomes true when something has taken so many different values."""
    values = set[object]()

    def enough() -> bool:
        values.update(look())
        return len(values) >= times

    return enough


def parts(folder: Path, prefix: str) -> set[object]:
    places = [folder, *folder.glob("seed-*")]
    return {
        name
        for place in places
        if place.is_dir()
        for name in os.listdir(place)
        if name.startswith(prefix) and name.endswith(".part")
    }


def sizes(folder: Path) -> set[object]:
    found = set[object]()
    for file in (folder / "checkpoint.npz", *folder.glob("seed-*/checkpoint.npz")):
        try:
            found.add((file, file.stat().st_size))
        except OSError:
            continue
    return found


def kill(folder: Path, log: Path, options: list[str], duration: float, rng: random.Random) -> str | None:
    """Run until the moment has come, and kill; return what that met, None where the run had ended before."""
    pid = start(folder, log, options)
    due = moment(folder, duration, rng)
    while not due():
        if (code := ended(pid)) is not None:
            if code:
                raise SystemExit(f"{folder}: exit status {code}\n{(folder.parent / 'stderr').read_text()}")
            return None
        time.sleep(2e-5)
    os.kill(pid, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return phase(folder) if code == -signal.SIGKILL else None


def phase(folder: Path) -> str:
    """What a killed run was doing, from what it left: the last of its seeds that had begun."""
    run = max(folder.glob("seed-*"), default=folder, key=lambda p: int(p.name.removeprefix("seed-")))
    left = [p.name for p in run.rglob(".*.part")] if run.exists() else []
    if any(name.startswith(".checkpoint") for name in left):
        return "inside a checkpoint's write"
    if left:
        return "inside another file's write"
    if not (run / "run.json").exists():
        return "before the run had begun"
    if json.loads((run / "run.json").read_text())["status"] == "done":
        return "between runs, or at the end"
    if (run / "estimate.yaml").exists():
        return "report"
    if not (run / "checkpoint.npz").exists():
        return "search, before its first checkpoint"
    with np.load(run / "checkpoint.npz", allow_pickle=False) as stored:
        refines = any(name.startswith(("refined/", "joint/")) for name in stored.files)
    return "refinement" if refines else "search, after a checkpoint"


def differences(one: Path, other: Path) -> list[str]:
    """Files that two runs do not share bit for bit."""

    def files(folder: Path) -> dict[str, bytes]:
        found = (p for p in sorted(folder.rglob("*")) if p.is_file() and p.name not in OWN)
        return {p.relative_to(folder).as_posix(): without_times(p) for p in found}

    def without_times(path: Path) -> bytes:
        """A file's content; of run.json without how long the run took."""
        if path.name != "run.json":
            return path.read_bytes()
        return json.dumps({k: v for k, v in json.loads(path.read_text()).items() if k != "seconds"}).encode()

    a, b = files(one), files(other)
    return [name for name in sorted(a.keys() | b.keys()) if a.get(name) != b.get(name)]


def trial(
    name: str, work: Path, log: Path, duration: float, rng: random.Random
) -> tuple[list[str], list[str]]:
    """Kill one run twice, let it end; return what was met and what differs."""
    folder = work / f"{name}-killed"
    shutil.rmtree(folder, ignore_errors=True)
    met = [kill(folder, log, KINDS[name], duration, rng) for _ in range(2)]
    finish(folder, log, KINDS[name])
    return [m for m in met if m is not None], differences(work / f"{name}-whole", folder)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100, help="over all kinds together")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--only", choices=KINDS, help="one kind")
    options = parser.parse_args()
    kinds = [options.only] if options.only else list(KINDS)
    rng, began, bad, met = random.Random(options.seed), time.monotonic(), 0, Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        log = work / "log.csv"
        log.write_text("\n".join(LOG.read_text().splitlines()[: SAMPLES + 1]) + "\n")
        for i, name in enumerate(kinds):
            duration = finish(work / f"{name}-whole", log, KINDS[name])
            share = (options.kills * (i + 1)) // len(kinds) - (options.kills * i) // len(kinds)
            kills = trials = failed = 0
            while kills < share:
                hits, differ = trial(name, work, log, duration, rng)
                met.update(hits)
                kills, trials, failed = kills + len(hits), trials + 1, failed + bool(differ)
                if differ:
                    print(f"{name}: differs in {', '.join(differ)}", file=sys.stderr)
            bad += failed
            same = f"{trials - failed} of {trials} bit-identical"
            print(f"{name:10} {kills:4} kills in {trials} runs of {duration:.1f} s: {same}", flush=True)
    for what, count in met.most_common():
        print(f"  {count:3}  {what}")
    print(f"{sum(met.values())} kills, {bad} runs that differ, {time.monotonic() - began:.0f} s")
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
