"""Runs that are killed and resumed end as if nobody had touched them."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from pathlib import Path

import pytest
from log_files import head
from taken import without_times
from warm import Command, warm_process

SHORT = ["--quiet", "--set", "search.ga.population=10", "--algorithm", "ga"]
STAGE_1 = "{K: 0.2, D: 80, S: 0, M1: 4.6, M2: 5.1, M3: 22.5, M4: 1.6, M5: 4, M6: 4.7}"
"""what stage 2 takes of stage 1"""
Process = subprocess.Popen[str] | Command
OWN = {".lock", "run.log", "checkpoint.previous.npz"}
"""files of a run that tell of its course"""


@pytest.fixture(scope="module")
def warm() -> Generator[str]:
    """The address of a process that begins commands at once."""
    with warm_process() as address:
        yield address


def start(
    cwd: Path,
    *options: object,
    out: str,
    command: str = "fit-mech",
    warm: str | None = None,
) -> "Process":
    """Begin or resume a run of six seconds of a virtual rig's log, by a warm process or
    as a new Python; checkpoints after every generation."""
    if not (cwd / "log.csv").exists():
        head(cwd / "log.csv", 600)
        (cwd / "mech.yaml").write_text(STAGE_1)
    words = [command, "log.csv", *map(str, options), "--out", out, "--resume"]
    always = "import hydroid.fitting.checkpoints as s; s.SAVE_EVERY = 0; "
    if warm is not None:
        return Command(warm, words, cwd, before=always)
    # what the tests ignore (SIGHUP under nohup, SIGINT in the background) the run would too
    code = "import signal; signal.signal(signal.SIGHUP, signal.SIG_DFL); "
    code += "signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += always + "import hydroid.commands.app as a; a.main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: "Process", code: int = 0) -> str:
    out, errors = process.communicate(timeout=300)
    assert process.returncode == code, out + errors
    return errors


def wait_for(process: "Process", run: Path, pattern: str) -> None:
    while not any(run.rglob(pattern)) and process.poll() is None:
        time.sleep(1e-3)


def content(folder: Path) -> dict[str, object]:
    """Files by name; of run.json and pages what they say besides how long the run
    took."""
    found = {
        p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()
    }
    return {
        name: json.loads(p.read_bytes()) | {"seconds": 0}
        if p.name == "run.json"
        else without_times(p.read_bytes())
        for name, p in found.items()
        if p.name not in OWN
    }


PYMOO = ["-q", "--algorithm=pymoo", "--no-refinement"]
SEARCHES = {
    "ga": [
        *SHORT,
        "--set",
        "search.ga.generations=20",
        "--set",
        "refinement.iterations=20",
    ],
    "nsga2": [
        "-q",
        "--set",
        "search.nsga2={population: 10, generations: 20}",
        "--no-refinement",
    ],
    "multistart": [
        "-q",
        "--algorithm=multistart",
        "--set=search.multistart={starts: 3, iterations: 5}",
    ],
    "moead": [*PYMOO, "--set", "search.pymoo={population: 10, generations: 20}"],
    "mopso-cd": [
        *PYMOO,
        "--set=search.pymoo={algorithm: mopso-cd, population: 10, generations: 20}",
    ],
    "ladder": [
        "-q",
        "--mech=mech.yaml",
        "--set=simulation.model=ladder",
        "--set=search.nsga2={population: 6, generations: 4}",
        "--set=refinement.iterations=5",
    ],
}
ENDS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
STOPPED = 130
"""exit status of a run that a signal has ended in order"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", SEARCHES)
def test_killed_runs_end_the_same(tmp_path: Path, kind: str, warm: str):
    """Every run is ended at moments drawn at random, twice, and resumed; KILLS in the
    environment asks for more. Each signal ends runs of three kinds.

    The whole one is a new Python, so that the hashes of its names are others.
    """
    rng = random.Random(kind)
    command = "fit-hyd" if kind == "ladder" else "fit-mech"
    # the report's commands name the run's folder
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    whole.mkdir()
    killed.mkdir()
    hits = 0
    process = start(whole, *SEARCHES[kind], out="run", command=command)
    wait_for(process, whole, "run.json")
    began = time.monotonic()
    finish(process)
    took = time.monotonic() - began
    first = 2 * [*SEARCHES].index(kind)
    wanted = int(os.environ.get("KILLS", "2"))
    # a run may be faster than its end
    for _ in range(20 * wanted):
        if hits == wanted:
            break
        end = ENDS[(first + hits) % len(ENDS)]
        # what a signal does while Python begins, test_files tells of the command itself
        process = start(killed, *SEARCHES[kind], out="run", command=command, warm=warm)
        if rng.random() < 0.5:
            time.sleep(took * rng.random())
        else:  # while a file is written
            wait_for(
                process,
                killed / "run",
                rng.choice((".checkpoint.npz.*.part", ".*.part")),
            )
        process.send_signal(end)
        _, errors = process.communicate(timeout=300)
        if process.returncode == 0:
            assert content(killed / "run") == content(whole / "run")
            shutil.rmtree(killed / "run")
            continue
        # without a handler before the command has one
        assert process.returncode in (STOPPED, -end), errors
        assert "Traceback" not in errors
        hits += 1
    assert hits == wanted
    finish(start(killed, *SEARCHES[kind], out="run", command=command, warm=warm))
    assert content(killed / "run") == content(whole / "run")


@pytest.mark.slow
@pytest.mark.parametrize("notice", ["SIGUSR1", "SIGHUP"])
def test_a_notice_ends_a_run_with_its_checkpoint_and_a_second_run_is_refused(
    tmp_path: Path, notice: str, warm: str
):
    options = [*SHORT, "--set", "search.ga.generations=4000"]
    process = start(tmp_path, *options, out="run", warm=warm)
    wait_for(process, tmp_path / "run", "checkpoint.npz")
    errors = finish(start(tmp_path, *options, out="run", warm=warm), 2)
    assert f"run: is in use by process {process.pid} on " in errors
    assert len(errors.splitlines()) == 1
    for _ in range(3):  # clusters repeat themselves
        process.send_signal(getattr(signal, notice))
        time.sleep(0.01)
    assert "--resume" in finish(process, 130)
    assert (
        json.loads((tmp_path / "run" / "run.json").read_text())["status"]
        == "interrupted"
    )
    lines = (tmp_path / "run" / "run.log").read_text().splitlines()
    assert "checkpoint: generation" in lines[-2]
    assert "interrupted" in lines[-1]
    assert not list((tmp_path / "run").rglob(".*.part"))


def test_the_runs_log_is_shown_where_it_is_asked_for(tmp_path: Path):
    options = ["-v", *SHORT[1:], "--set", "search.ga.generations=1", "--no-refinement"]
    errors = finish(start(tmp_path, *options, out="run")).splitlines()
    log = (tmp_path / "run" / "run.log").read_text().splitlines()
    assert [line for line in errors if " INFO " in line] == log
    assert log[-1].endswith(" done")
