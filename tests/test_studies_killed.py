"""A study that is killed goes on, ends with the same bits, and leaves no process behind."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_studies import written


def start(file: Path, out: Path, *options: str) -> "subprocess.Popen[str]":
    hydroid = [sys.executable, "-m", "hydroid", "study", str(file), "--out", str(out), *options]
    return subprocess.Popen(hydroid, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def content(out: Path) -> dict[str, object]:
    found: dict[str, object] = {}
    for file in sorted((out / "runs").iterdir()):
        found[file.name] = json.loads(file.read_text())
        found[file.name]["measures"].pop("seconds")
    table = (out / "tables" / "cells.csv").read_text()  # runs.csv has the seconds too
    return found | {"cells.csv": table}


def children(process: "subprocess.Popen[str]") -> list[int]:
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process.pid)], capture_output=True, text=True)
    return [int(pid) for pid in found.stdout.split()]


@pytest.mark.slow
def test_a_killed_study_ends_the_same(tmp_path: Path):
    file = written(tmp_path, seeds=6)
    whole = start(file, tmp_path / "whole", "-q", "--processes", "2")
    killed = start(file, tmp_path / "killed", "-q", "--processes", "2")
    while not list((tmp_path / "killed").glob("runs/*.json")) and killed.poll() is None:
        time.sleep(0.01)
    workers = children(killed)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert whole.wait(timeout=300) == 0, whole.communicate()
    left = len(list((tmp_path / "killed" / "runs").glob("*.json")))
    assert 0 < left < 12
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "killed" / "runs").glob("*.json")}
    again = start(file, tmp_path / "killed")
    _, said = again.communicate(timeout=300)
    assert again.returncode == 0, said
    assert f"{left} of 12 runs found, goes on" in said
    assert all(file.stat().st_mtime_ns == then for file, then in before.items())  # nothing is done twice
    assert content(tmp_path / "killed") == content(tmp_path / "whole")
    assert workers
    for pid in workers:
        assert not (Path("/proc") / str(pid)).exists()
