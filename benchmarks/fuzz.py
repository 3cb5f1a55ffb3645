"""Damaged files of every kind that hydroid reads: each is read rightly or refused in one line.

Each file is made from its kind's name and a number, so that a failure is found again with
`--only KIND --first N --inputs 1`. Workers read the files; one that says nothing for 10 s is ended and its
file counts as failed, as does one that crashes, leaves a traceback, reads other values than an independent
reader does (tests/fuzz_oracles.py says what is compared), or writes anything outside its own folder.

What this does not see: a value misread into another allowed one by hydroid and by the independent reader
alike; whether a damaged model that MuJoCo accepts is the arm that was meant; what a whole fit makes of an
accepted file. Every fourth accepted file is used as well: a config's parameters are simulated, an arm's model
is built, a model is copied into a run folder.
"""

import argparse
import os
import queue
import resource
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "tests"))

PATIENCE = 10.0  # seconds for one file
MEMORY = 8 << 30  # address space of a worker
SHARES = {
    "log": 20,
    "config": 18,
    "set": 6,
    "arm": 12,
    "values": 10,
    "run": 8,
    "checkpoint": 8,
    "model": 8,
    "mesh": 8,
}
SHARES["page"] = 2
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=12_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first file of each kind")
    parser.add_argument("--only", help="one kind")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/fuzz"), help="folder for files that failed")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        return work(given.worker)
    shares = {given.only: 1} if given.only else SHARES
    counts = {kind: round(given.inputs * share / sum(shares.values())) for kind, share in shares.items()}
    jobs: queue.Queue[tuple[str, int]] = queue.Queue()
    for kind, count in counts.items():
        for start in range(given.first, given.first + count, 50):
            jobs.put((kind, start))
    last = {kind: given.first + count for kind, count in counts.items()}
    results: dict[str, Counter[str]] = {kind: Counter() for kind in counts}
    started = time.perf_counter()
    watchers = [
        threading.Thread(target=supervise, args=(jobs, last, results, given.out))
        for _ in range(given.workers)
    ]
    for watcher in watchers:
        watcher.start()
    for watcher in watchers:
        watcher.join()
    show(results, given.first, time.perf_counter() - started)
    sys.exit(any(c["FAILED"] for c in results.values()))


def show(results: dict[str, Counter[str]], first: int, wall: float) -> None:
    print(f"\nfiles numbered from {first}, {wall:.0f} s")
    print(f"{'kind':<12}{'files':>8}{'read rightly':>14}{'one line':>10}{'FAILED':>8}{'slowest [s]':>13}")
    total: Counter[str] = Counter()
    for kind, count in results.items():
        slowest = count.pop("slowest", 0) / 1000
        total += count
        print(f"{kind:<12}{sum(count.values()):>8}{count['accepted']:>14}{count['refused']:>10}", end="")
        print(f"{count['FAILED']:>8}{slowest:>13.2f}")
    print(
        f"{'all':<12}{sum(total.values()):>8}{total['accepted']:>14}{total['refused']:>10}{total['FAILED']:>8}"
    )


def supervise(
    jobs: "queue.Queue[tuple[str, int]]", last: dict[str, int], results: dict[str, Counter[str]], out: Path
) -> None:
    """Feed one worker at a time; end it where it hangs, and go on with another."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as room:
        worker: Worker | None = None
        while True:
            try:
                kind, start = jobs.get_nowait()
            except queue.Empty:
                break
            for number in range(start, min(start + 50, last[kind])):
                worker = worker or Worker(Path(room))
                began = time.perf_counter()
                outcome, detail = worker.ask(kind, number)
                count = results[kind]
                count[outcome] += 1
                count["slowest"] = max(count["slowest"], round(1000 * (time.perf_counter() - began)))
                if outcome == "FAILED":
                    print(f"FAILED {kind} {number}: {detail.splitlines()[-1]}", flush=True)
                    keep(out, kind, number, detail)
                    if not worker.alive:
                        worker.end()
                        worker = None
        if worker:
            worker.end()


def keep(out: Path, kind: str, number: int, detail: str) -> None:
    from fuzz_kinds import KINDS

    out.mkdir(parents=True, exist_ok=True)
    (out / f"{kind}-{number}.txt").write_text(detail, encoding="utf-8", errors="backslashreplace")
    (out / f"{kind}-{number}.bin").write_bytes(KINDS[kind].make(number))


class Worker:
    """A process that reads files; asked over its standard input, and answering over its output."""

    def __init__(self, room: Path) -> None:
        self.alive = True
        self._room = Path(tempfile.mkdtemp(dir=room))
        for name in ("cwd", "tmp", "home", "files"):
            (self._room / name).mkdir()
        environment = os.environ | {"TMPDIR": str(self._room / "tmp"), "HOME": str(self._room / "home")}
        environment |= {
            "MPLCONFIGDIR": str(self._room / "tmp"),
            "NUMBA_NUM_THREADS": "1",
            "OMP_NUM_THREADS": "1",
        }
        self._process = subprocess.Popen(
            [sys.executable, str(HERE), "--worker", str(self._room)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=(self._room / "stderr").open("wb"),
            cwd=self._room / "cwd",
            env=environment,
            text=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        self._lines.get(timeout=300)  # it has imported everything

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def ask(self, kind: str, number: int) -> tuple[str, str]:
        """Have one file read; return how it ended, and what there is to say."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{kind} {number}\n")
        self._process.stdin.flush()
        try:
            answer = self._lines.get(timeout=PATIENCE)
        except queue.Empty:
            self.alive = False
            return "FAILED", f"no answer within {PATIENCE:g} s"
        if not answer:
            self.alive = False
            errors = (self._room / "stderr").read_text(errors="replace")[-3000:]
            return "FAILED", f"{errors}\nthe process ended with status {self._process.wait()}"
        outcome, _, detail = answer.strip().partition(" ")
        return outcome, detail.encode().decode("unicode_escape", "replace")

    def end(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()


def work(room: str) -> None:
    """Read the files that standard input asks for."""
    import fuzz_kinds
    from fuzz_kinds import KINDS

    from hydroid.errors import HydroidError

    # the intact run is made before the watch begins, and the models' code is compiled
    fuzz_kinds.kept_room()
    answers, sys.stdout = sys.stdout, sys.stderr
    for kind in KINDS.values():
        kind.seeds()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    allowed = (os.path.join(room, "files"), str(fuzz_kinds.kept_room()))
    written: list[str] = []
    sys.addaudithook(lambda event, details: written.extend(_outside(event, details, allowed)))
    before = {str(p) for folder in ("cwd", "home", "tmp") for p in (Path(room) / folder).iterdir()}
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        name, number = line.split()
        written.clear()
        try:
            KINDS[name].try_one(int(number), Path(room) / "files")
            outcome = "accepted"
        except HydroidError as error:
            text = str(error)
            fair = text.isprintable() and 0 < len(text) < 2000
            outcome = "refused" if fair else f"FAILED not one plain line: {text!a}"
        except BaseException:
            outcome = "FAILED " + ascii(traceback.format_exc())[1:-1]
        beside = [str(p) for folder in ("cwd", "home", "tmp") for p in (Path(room) / folder).iterdir()]
        strays = [p for p in beside if p not in before] + written
        if strays:
            outcome = f"FAILED written outside: {strays!a}"
        print(outcome, file=answers, flush=True)


def _outside(event: str, details: tuple[Any, ...], allowed: tuple[str, str]) -> list[str]:
    """What Python is about to write, make, move or remove elsewhere."""
    if event == "open":
        path, _, flags = details
        if not (isinstance(flags, int) and flags & WRITING) or isinstance(path, int):
            return []
        paths = [path]
    elif event in ("os.mkdir", "os.remove", "os.rmdir", "os.truncate", "os.chmod"):
        if isinstance(details[-1], int) and details[-1] >= 0 and event in ("os.remove", "os.rmdir"):
            return []  # relative to an open folder: shutil.rmtree of this program
        paths = [details[0]]
    elif event in ("os.rename", "os.link", "os.symlink"):
        paths = [*details[:2]]
    elif event in ("subprocess.Popen", "os.system", "os.exec", "socket.connect"):
        return [f"{event} {details!r}"]
    else:
        return []
    full = [os.path.abspath(os.fsdecode(p)) for p in paths if isinstance(p, str | bytes | os.PathLike)]
    return [
        f"{event} {p}"
        for p in full
        if not p.startswith(allowed) and "__pycache__" not in p and p != os.devnull
    ]


if __name__ == "__main__":
    main()
