"""Kill runs at random moments, resume them, and compare what they end with with runs left alone, bit for bit.

    python benchmarks/kill_resume.py [--kills 100] [--seed 1] [--only ga nsga2 refinement multistart study]

Five kinds of run: simple GA, NSGA-II, the joint refinement, multi-start least squares, and a study of
several seeds. Every run is killed (SIGKILL) twice before it may end, so that resumed runs are killed as well.
Half of the moments are drawn from the time that the run takes, the earlier the likelier; the others follow
files: the temporary twin of a checkpoint or of any file appears, or the refinement's checkpoint grows.
What a kill has met is read from what it left. All files are compared, but for the log, the lock and the last
checkpoint but one.

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
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import Clock, options

from hydroid.commands.app import main as hydroid
from hydroid.fitting import checkpoints
from hydroid.reporting import page_file

LOG = Path(__file__).parents[1] / "examples" / "logs" / "rig_shoulder_1.csv"
SAMPLES = 600
GA = "--algorithm ga --set search.ga.population=10 --set search.ga.generations="
KINDS = {
    "ga": GA + "30 --no-refinement",
    "nsga2": "--set search.nsga2.population=10 --set search.nsga2.generations=30 --no-refinement",
    "refinement": GA + "0 --set joint_refinement=true --set parameters.M3.fixed=22.5",
    "multistart": "--algorithm multistart --set search.multistart.starts=3 --set refinement.iterations=5",
    "study": GA + "5 --set refinement.iterations=5 --runs 3",
}
OWN = {".lock", "run.log", "checkpoint.previous.npz"}
"""files of a run that tell of its course"""


@dataclass(frozen=True)
class Run:
    """One run of `hydroid fit-mech`, begun or resumed in a folder."""

    folder: Path
    kind: str

    def start(self) -> int:
        """Return its process."""
        if pid := os.fork():
            return pid
        with (self.folder.parent / "stderr").open("a") as errors:
            os.dup2(errors.fileno(), 2)
            os.dup2(errors.fileno(), 1)
        checkpoints.SAVE_EVERY = 0.0
        page_file.write_page = lambda *_: []
        os.chdir(self.folder.parent)  # what a run stores names its folder as it was given
        out = ["--out", self.folder.name, "--resume", "--quiet"]
        sys.argv = ["hydroid", "fit-mech", "../log.csv", *KINDS[self.kind].split(), *out]
        code = 99
        try:
            hydroid()
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            os._exit(code)

    def ended(self, pid: int, flags: int = 0) -> int | None:
        """Return minus the signal that killed a process, 0 where it ended well, None while it runs."""
        done, status = os.waitpid(pid, flags)
        code = os.waitstatus_to_exitcode(status) if done else None
        if code is not None and code > 0:
            raise SystemExit(f"{self.folder}: status {code}\n{(self.folder.parent / 'stderr').read_text()}")
        return code

    def finish(self) -> float:
        """Run to the end; return the seconds it took."""
        began = time.monotonic()
        self.ended(self.start())
        return time.monotonic() - began

    def kill(self, duration: float, rng: random.Random) -> str | None:
        """Run until a moment has come, and kill; return what that met, None where the run had ended."""
        pid, due = self.start(), self.moment(duration, rng)
        while not due():
            if self.ended(pid, os.WNOHANG) is not None:
                return None
            time.sleep(2e-5)
        os.kill(pid, signal.SIGKILL)
        return self.phase() if self.ended(pid) == -signal.SIGKILL else None

    def moment(self, duration: float, rng: random.Random) -> Callable[[], bool]:
        """Return a question that becomes true when it is time to kill."""
        if rng.random() < 0.5:
            due = time.monotonic() + duration * rng.random() ** 2
            return lambda: time.monotonic() > due
        which, times = rng.choice((".checkpoint.npz.*.part", ".*.part", "checkpoint.npz")), rng.randint(1, 40)
        seen = set[object]()

        def enough() -> bool:
            for file in self.folder.rglob(which):
                try:
                    seen.add(file if file.suffix == ".part" else (file, file.stat().st_size))
                except OSError:
                    continue
            return len(seen) >= times

        return enough

    def phase(self) -> str:
        """What a killed run was doing, from what it left: the last of its seeds that had begun."""
        number = self.folder.glob("seed-*")
        run = max(number, default=self.folder, key=lambda p: int(p.name.removeprefix("seed-")))
        left = [p.name for p in run.rglob(".*.part")]
        if left:
            return f"inside {'a checkpoint' if '.checkpoint' in left[0] else 'another file'}'s write"
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

    def files(self) -> dict[str, bytes]:
        """Return all that it stored, by name; of run.json without how long the run took."""
        files = (p for p in sorted(self.folder.rglob("*")) if p.is_file() and p.name not in OWN)
        content = {p.relative_to(self.folder).as_posix(): p.read_bytes() for p in files}
        for name in content:
            if name.endswith("run.json"):
                stored = {k: v for k, v in json.loads(content[name]).items() if k != "seconds"}
                content[name] = json.dumps(stored).encode()
        return content


def study(kind: str, work: Path, share: int, rng: random.Random) -> tuple[Counter[str], int]:
    """Kill runs of a kind; return how often each phase was met, and how many runs differ."""
    whole, killed = (Run(work / name / "run", kind) for name in ("whole", "killed"))
    for run in (whole, killed):
        run.folder.parent.mkdir()
    met, trials, failed = Counter[str](), 0, 0
    duration = whole.finish()
    while met.total() < share:
        shutil.rmtree(killed.folder, ignore_errors=True)
        met.update(what for what in (killed.kill(duration, rng) for _ in range(2)) if what is not None)
        killed.finish()
        a, b = whole.files(), killed.files()
        differing = [name for name in sorted(a.keys() | b.keys()) if a.get(name) != b.get(name)]
        trials, failed = trials + 1, failed + bool(differing)
        if differing:
            print(f"{kind}: differs in {', '.join(differing)}", file=sys.stderr)
    runs = f"{trials} runs of {duration:.1f} s: {trials - failed} of {trials} bit-identical"
    print(f"{kind:10} {met.total():4} kills in {runs}", flush=True)
    return met, failed


if __name__ == "__main__":
    given = options(__doc__, kills=100, seed=1, only=list(KINDS))
    rng, clock, bad, met = random.Random(given.seed), Clock(), 0, Counter[str]()
    for kind in given.only:
        with tempfile.TemporaryDirectory() as place:
            log = "\n".join(LOG.read_text().splitlines()[: SAMPLES + 1]) + "\n"
            (Path(place) / "log.csv").write_text(log)
            phases, failed = study(kind, Path(place), -(-given.kills // len(given.only)), rng)
            met, bad = met + phases, bad + failed
    for what, count in met.most_common():
        print(f"  {count:3}  {what}")
    print(f"{met.total()} kills, {bad} runs that differ, {clock}")
    sys.exit(bool(bad))
