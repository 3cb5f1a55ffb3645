"""Workers that die, schedulers that are lost, fits that are stopped: slow, since
processes start and end."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import yaml
from log_files import head
from spread_problem import arguments, assert_same, random_candidates
from worker_targets import DEADLY, NINE, Deadly, Rows

from hydroid.errors import RunError
from hydroid.fitting.checkpoints import Memo
from hydroid.parallel.cluster import open_workers, write_credentials
from hydroid.parallel.workers import DaskWorkers
from hydroid.problem.problem import Problem

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow
IMPATIENT = {"distributed.deploy.lost-worker-timeout": "100ms"}
"""as if every worker took too long to start again: hydroid must not let Dask give it
up"""


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    """No test waits for ever: this ends it wherever it waits, and its clean-up still
    runs."""

    def late(number: int, frame: object) -> None:
        pytest.fail("took longer than five minutes")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(300)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def two() -> Iterator[DaskWorkers]:
    # a chunk that kills is tried once more and not three times: each death costs
    # seconds
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1, **IMPATIENT}),
        open_workers("local:2") as opened,
    ):
        assert opened is not None
        yield opened


def wait_for(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 200
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def deadly(candidate: int) -> np.ndarray:
    theta = NINE.copy()
    theta[candidate, 0] = DEADLY
    return theta


def test_only_the_candidate_that_kills_is_infeasible(two: DaskWorkers, tmp_path: Path):
    problem = Problem(*arguments())
    theta = random_candidates(problem, 7)[:6]
    healthy, others = problem.evaluate(theta), np.arange(6) != 3
    theta[3, 0] = DEADLY

    def spread(
        target: object, method: str, theta: np.ndarray, columns: int
    ) -> np.ndarray:
        return two(Deadly(target, tmp_path / "deaths"), method, theta, columns)

    memo = Memo(Problem(*arguments(), spread))
    result = memo.evaluate(theta)
    assert np.isinf(result[3]).all()
    assert memo.infeasible == 1
    np.testing.assert_array_equal(result[others], healthy[others])
    # two tries in its chunk, two alone
    assert len((tmp_path / "deaths").read_text()) == 4
    residuals = memo.problem.output_errors(theta[2:5])
    assert np.isnan(residuals[1]).all()
    np.testing.assert_array_equal(residuals[::2], problem.output_errors(theta[2:5:2]))


class Site:
    """A scheduler and workers started from the command line, with credentials made for
    the run."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.config, self.file = (
            folder,
            folder / "private",
            folder / "scheduler.json",
        )
        write_credentials(self.config)
        self.processes: list[subprocess.Popen[bytes]] = []
        self.start(
            "scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--scheduler-file",
            self.file,
        )
        wait_for(lambda: self.file.exists() and self.file.stat().st_size)
        self.address: str = json.loads(self.file.read_text())["address"]

    def start(self, *arguments: object) -> None:
        command = [sys.executable, "-m", "dask", *map(str, arguments), "--no-dashboard"]
        environment = os.environ | {
            "DASK_CONFIG": str(self.config),
            "PYTHONPATH": os.pathsep.join(sys.path),
        }
        with (self.folder / "log.txt").open("ab") as log:
            how = {"cwd": self.folder, "env": environment, "stdout": log, "stderr": log}
            self.processes.append(
                subprocess.Popen(command, start_new_session=True, **how)
            )

    def worker(self) -> None:
        file = ("--scheduler-file", self.file)
        self.start(
            "worker", *file, "--nthreads", "1", "--host", "127.0.0.1", "--no-nanny"
        )

    def kill(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.processes[number].pid, signal.SIGKILL)
        self.processes[number].wait()

    def end(self) -> None:
        for number in reversed(range(len(self.processes))):
            self.kill(number)

    @contextmanager
    def opened(self) -> Generator[DaskWorkers]:
        """The workers as of a process whose DASK_CONFIG names the credentials."""
        tls = yaml.safe_load((self.config / "distributed.yaml").read_text())[
            "distributed"
        ]["comm"]["tls"]
        roles = {
            f"{role}.{key}": text
            for role in ("scheduler", "client")
            for key, text in tls[role].items()
        }
        texts = (roles | {"ca-file": tls["ca-file"]}).items()
        credentials = {f"distributed.comm.tls.{key}": text for key, text in texts}
        with dask.config.set(credentials), open_workers(str(self.file)) as workers:
            assert workers is not None
            yield workers


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    started = Site(tmp_path)
    yield started
    started.end()


def test_one_two_and_four_workers_and_one_killed_change_no_bit(
    site: Site, tmp_path: Path
):
    plain = Problem(*arguments())
    theta = random_candidates(plain, 9)
    with site.opened() as workers:
        spread = Problem(*arguments(), workers)
        for count in (1, 2, 4):
            while len(site.processes) <= count:
                site.worker()
            wait_for(lambda count=count: len(workers.client.nthreads()) == count)
            assert_same(spread, plain, theta)
        # killed while it computes, and nobody replaces it
        dying = Deadly(Rows(), tmp_path / "deaths", times=1)
        np.testing.assert_array_equal(
            workers(dying, "squares", deadly(2), 2), deadly(2) ** 2
        )
        wait_for(lambda: workers.count == 3)
        assert_same(spread, plain, theta)


def test_a_lost_scheduler_is_one_error(site: Site):
    site.worker()
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        site.opened() as workers,
    ):
        rows = Rows()
        np.testing.assert_array_equal(workers(rows, "squares", NINE, 2), NINE**2)
        site.kill(0)
        for _ in range(2):
            with pytest.raises(RunError, match="the Dask scheduler is gone"):
                workers(rows, "squares", NINE, 2)
        wait_for(lambda: workers.client.status == "closed")
        with pytest.raises(RunError, match="the Dask scheduler is gone"):
            workers(rows, "squares", NINE, 2)


QUICK = [
    "--algorithm",
    "ga",
    "--set",
    "search.ga.population=6",
    "--set",
    "refinement.iterations=1",
]


@pytest.mark.parametrize("end", ["SIGTERM", "SIGINT to the group", "SIGKILL"])
def test_a_stopped_fit_leaves_no_process(tmp_path: Path, end: str):
    # in the background the tests ignore SIGINT, and so would the run
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from hydroid.__main__ import main; main()"
    hydroid = [
        sys.executable,
        "-c",
        code,
        "fit-mech",
        head(tmp_path / "short.csv", 300),
    ]
    run = subprocess.Popen(
        [
            *hydroid,
            *QUICK,
            "--set",
            "search.ga.generations=100000",
            "--out",
            "run",
            "--dask",
            "local:2",
        ],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        # the first one comes after some seconds
        wait_for((tmp_path / "run" / "checkpoint.npz").exists)
        children = psutil.Process(run.pid).children(recursive=True)
        assert sum("spawn_main" in " ".join(child.cmdline()) for child in children) == 2
        if end == "SIGINT to the group":
            os.killpg(run.pid, signal.SIGINT)
        else:
            run.send_signal(signal.Signals[end])
        _, errors = run.communicate(timeout=100)
        wait_for(lambda: not any(child.is_running() for child in children))
    finally:
        run.kill()  # with it end its workers, whatever went wrong here
    if end != "SIGKILL":
        assert run.returncode == 130, errors
        assert (
            json.loads((tmp_path / "run" / "run.json").read_text())["status"]
            == "interrupted"
        )
        assert "Traceback" not in errors
