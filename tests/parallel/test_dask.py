"""Dask workers started from the command line, some of them killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from execution_work import KillOnce, Poison, fail, process, refuse, square
from spread_problem import arguments, assert_same, some_sets

from hydroid.errors import ModelError, RunError, SettingsError
from hydroid.execution import Work, open_executor
from hydroid.problem.problem import Problem
from hydroid.problem.spread import SpreadProblem
from hydroid.settings.simulation import ClusterSettings

pytest.importorskip("distributed")
from hydroid.execution.cluster import DaskCluster

TESTS = Path(__file__).parents[1]
# a chunk that kills is tried once more, not three times: each death costs seconds on a busy machine
ENVIRONMENT = os.environ | {
    "PYTHONPATH": str(TESTS),
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
}


class Site:
    """A scheduler and workers in a folder, each a process group of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        file = folder / "scheduler.json"
        self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", file)
        wait_for(lambda: file.exists() and file.stat().st_size)
        self.file = file

    @property
    def address(self) -> str:
        import json

        return json.loads(self.file.read_text())["address"]

    def start(self, *arguments: object) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *map(str, arguments), "--no-dashboard"]
        with (self.folder / "log.txt").open("ab") as log:
            started = subprocess.Popen(
                command, cwd=self.folder, env=ENVIRONMENT, stdout=log, stderr=log, start_new_session=True
            )
        self.processes.append(started)
        return started

    def worker(self, *options: str) -> subprocess.Popen[bytes]:
        return self.start("worker", self.address, "--nthreads", "1", "--host", "127.0.0.1", *options)

    def end(self) -> None:
        for running in reversed(self.processes):
            kill(running)


def kill(running: "subprocess.Popen[bytes]") -> None:
    """Kill a process with its group; a worker's nanny would start another one."""
    if running.poll() is None:
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    """No test waits for ever: this ends it wherever it waits, and its clean-up still runs."""

    def late(number: int, frame: object) -> None:
        pytest.fail("took longer than three minutes")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(180)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def wait_for(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@contextmanager
def site(folder: Path) -> Iterator[Site]:
    started = Site(folder)
    try:
        yield started
    finally:
        started.end()


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskCluster]:
    """Two workers whose nannies replace them when they are killed."""
    with site(tmp_path_factory.mktemp("dask")) as here:
        here.worker("--nworkers", "2")
        with DaskCluster(here.address, ClusterSettings()) as cluster:
            wait_for(lambda: cluster.workers == 2)
            yield cluster


def test_results_come_in_the_chunks_order_from_several_processes(two: DaskCluster):
    assert two.map(Work(square), range(9)) == [n**2 for n in range(9)]
    assert two.map(Work(square), []) == []
    assert os.getpid() not in two.map(Work(process), range(9))


def test_a_killed_workers_chunk_comes_back(two: DaskCluster, tmp_path: Path):
    assert two.map(Work(KillOnce(4, tmp_path / "killed")), range(9)) == [n**2 for n in range(9)]
    assert (tmp_path / "killed").exists()


def test_only_the_poisonous_chunk_fails(two: DaskCluster, tmp_path: Path):
    results = two.map(Work(Poison(4, tmp_path / "deaths")), range(9))
    assert results == [None if n == 4 else n**2 for n in range(9)]
    assert len((tmp_path / "deaths").read_text()) == 4  # two tries among others, two alone


def test_errors_come_through(two: DaskCluster):
    with pytest.raises(ModelError, match=r"arm.xml: has no chunk \d; take another"):
        two.map(Work(refuse), range(9))
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        two.map(Work(fail), range(9))


def test_workers_of_another_version_are_refused(two: DaskCluster, monkeypatch: pytest.MonkeyPatch):
    from hydroid.execution import cluster

    monkeypatch.setattr(cluster, "version", lambda name: "0.0")
    with pytest.raises(RunError, match=r"a Dask worker has hydroid .*, here is 0.0"):
        two.map(Work(abs), [1])


def test_one_two_and_four_workers_and_one_killed_in_a_chunk_change_no_bit(tmp_path: Path):
    plain = Problem(*arguments())
    theta = some_sets(plain, 9)
    with site(tmp_path) as here, DaskCluster(here.address, ClusterSettings()) as cluster:
        spread = SpreadProblem(*arguments(), cluster)
        workers = []
        for count in (1, 2, 4):
            while len(workers) < count:
                workers.append(here.worker("--no-nanny"))
            wait_for(lambda count=count: cluster.workers == count)
            assert_same(spread, plain, theta)
        # killed while it computes, and nobody replaces it
        before = cluster.workers
        assert cluster.map(Work(KillOnce(2, tmp_path / "killed")), range(8)) == [n**2 for n in range(8)]
        wait_for(lambda: cluster.workers == before - 1)
        assert_same(spread, plain, theta)


def test_a_lost_scheduler_is_one_error(tmp_path: Path):
    with site(tmp_path) as here:
        here.worker("--no-nanny")
        with DaskCluster(here.address, ClusterSettings()) as cluster:
            assert cluster.map(Work(square), [3]) == [9]
            cluster._client._timeout = 1.0  # is not waited for as long as in earnest
            kill(here.processes[0])
            for _ in range(2):  # when it has just gone, and when the client has given it up
                with pytest.raises(RunError, match="scheduler is gone"):
                    cluster.map(Work(square), [3])
            wait_for(lambda: cluster._client.status == "closed")
            for lost in (lambda: cluster.workers, lambda: cluster.map(Work(abs), [3])):
                with pytest.raises(RunError, match="scheduler is gone"):
                    lost()


def test_no_scheduler_and_no_slurm_are_one_error_each(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("hydroid.execution.cluster.CONNECT", 1.0)
    for address in ("tcp://127.0.0.1:1", "carrier-pigeon://somewhere"):
        with pytest.raises(RunError, match=f"--dask {address}: no Dask scheduler answers"):
            open_executor(None, address, ClusterSettings())
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SettingsError, match="no sbatch"):
        open_executor(None, "slurm", ClusterSettings())


def test_a_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(sys.modules, "hydroid.execution.cluster", raising=False)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SettingsError, match=r"pip install 'hydroid\[cluster\]'"):
        open_executor(None, "tcp://127.0.0.1:1", ClusterSettings())


SBATCH = """#!/bin/sh
# stands in for Slurm's: runs the job at once, in a session of its own
cp "$1" "{folder}/job.sh"
setsid sh -c 'echo $$ >> "{folder}/jobs"; exec bash "{folder}/job.sh"' >> "{folder}/job.log" 2>&1 &
echo "Submitted batch job $!"
"""


def test_slurm_jobs_become_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, text in (("sbatch", SBATCH.format(folder=tmp_path)), ("scancel", "#!/bin/sh\n")):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    monkeypatch.chdir(tmp_path)
    settings = ClusterSettings(jobs=1, cores=2, memory="1GiB", walltime="00:10:00", queue="debug")
    try:
        with DaskCluster("slurm", settings) as cluster:
            assert cluster.map(Work(square), range(4)) == [0, 1, 4, 9]
            wait_for(lambda: cluster.workers == 2)
    finally:
        for pid in (tmp_path / "jobs").read_text().split():
            with suppress(ProcessLookupError):
                os.killpg(int(pid), signal.SIGKILL)
    script = (tmp_path / "job.sh").read_text()
    for line in ("-p debug", "-t 00:10:00", "--mem=1G", "--cpus-per-task=2"):
        assert f"#SBATCH {line}" in script
    assert np.any(["--nthreads 1" in line for line in script.splitlines()])
