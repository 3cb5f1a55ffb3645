"""Local worker processes: what they compute, and what happens when they die."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from execution_work import KillOnce, Poison, fail, process, refuse, square
from spread_problem import POISON, Poisoned, arguments, assert_same, some_sets

from hydroid.errors import ModelError, SettingsError
from hydroid.execution import TRIES, Executor, Work, open_executor
from hydroid.execution.local import LocalPool
from hydroid.problem.problem import Memo, Problem
from hydroid.problem.spread import SpreadProblem
from hydroid.settings.simulation import ClusterSettings

ROOT = Path(__file__).parents[2]
SQUARES = [n**2 for n in range(9)]


@pytest.fixture(scope="module")
def pool():
    with LocalPool(2) as pool:
        yield pool


def alive(pid: int) -> bool:
    """Whether a process runs (one that has ended and waits for its parent does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_results_come_in_the_chunks_order_from_several_processes(pool: LocalPool):
    work = Work(square)
    assert pool.map(work, range(9)) == SQUARES
    assert pool.map(work, []) == []
    pids = set(pool.map(Work(process), range(40)))
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_a_killed_workers_chunk_comes_back(pool: LocalPool, tmp_path: Path, caplog: pytest.LogCaptureFixture):
    before = set(pool.map(Work(process), range(40)))
    assert pool.map(Work(KillOnce(4, tmp_path / "killed")), range(9)) == SQUARES
    assert (tmp_path / "killed").exists()
    assert "SIGKILL" in caplog.text
    after = set(pool.map(Work(process), range(40)))
    assert len(after) == 2  # the pool is whole again
    assert len(after & before) == 1  # and the other worker is the same


def test_a_worker_that_was_killed_while_idle_is_replaced(pool: LocalPool):
    pids = set(pool.map(Work(process), range(40)))
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    assert pool.map(Work(square), range(9)) == SQUARES
    assert not pids & set(pool.map(Work(process), range(9)))


def test_only_the_poisonous_chunk_fails(pool: LocalPool, tmp_path: Path):
    deaths = tmp_path / "deaths"
    results = pool.map(Work(Poison(4, deaths)), range(9))
    assert results == [None if n == 4 else n**2 for n in range(9)]
    assert len(deaths.read_text()) == TRIES


def test_errors_come_through_and_the_pool_goes_on(pool: LocalPool):
    with pytest.raises(ModelError, match=r"arm.xml: has no chunk \d; take another"):
        pool.map(Work(refuse), range(9))
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        pool.map(Work(fail), range(9))
    assert pool.map(Work(square), range(9)) == SQUARES


def test_an_ended_pool_leaves_no_process():
    with LocalPool(2) as pool:
        pids = set(pool.map(Work(process), range(40)))
        assert all(alive(pid) for pid in pids)
    assert not any(alive(pid) for pid in pids)


def test_a_process_that_cannot_start_is_one_error_and_no_endless_loop(tmp_path: Path):
    # a script without the usual guard: each worker would run it again
    script = tmp_path / "script.py"
    script.write_text(
        "from hydroid.execution import Work\nfrom hydroid.execution.local import LocalPool\n"
        "with LocalPool(1) as pool:\n    pool.map(Work(abs), [1])\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert done.returncode != 0
    assert "RunError: a worker process did not start (exit status 1)" in done.stderr


def test_both_options_at_once_are_refused():
    with pytest.raises(SettingsError, match="choose one"):
        open_executor(2, "tcp://127.0.0.1:1", ClusterSettings())
    with open_executor(None, None, ClusterSettings()) as executor:
        assert executor is None


@pytest.fixture(scope="module")
def plain() -> Problem:
    return Problem(*arguments())


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_the_number_of_workers_changes_no_bit(plain: Problem, workers: int):
    theta = some_sets(plain, 9)
    with LocalPool(workers) as pool:
        spread = SpreadProblem(*arguments(), pool)
        assert np.isinf(spread.evaluate(theta).overall).tolist() == [False] * 8 + [True]
        assert_same(spread, plain, theta)


def test_threads_of_a_worker_and_few_sets_change_no_bit(plain: Problem, pool: LocalPool):
    theta = some_sets(plain, 9)
    spread = SpreadProblem(*arguments(**{"simulation.threads": 2}), pool)
    for rows in (slice(0, 9), slice(3, 4)):
        assert_same(spread, plain, theta[rows])
    assert len(spread.evaluate(theta[:0])) == 0


def test_other_norms_and_freed_parameters_are_the_same_bits(pool: LocalPool):
    changes = {"objective.norm": 2, "parameters.K.fixed": 0.2}
    plain, spread = Problem(*arguments(**changes)), SpreadProblem(*arguments(**changes), pool)
    theta = some_sets(plain, 3)
    assert_same(spread, plain, theta)
    assert spread.freed().parameters.free.all()
    assert_same(spread.freed(), plain.freed(), theta)


def test_hydraulics_are_the_same_bits_too(pool: LocalPool):
    from hydroid.jobs import load_settings

    settings = load_settings("article-hyd", {})
    _, _, logs = arguments()
    plain = Problem(settings, logs[:1])
    theta = plain.parameters.from_unit(np.random.default_rng(2).random((5, int(plain.parameters.free.sum()))))
    assert_same(SpreadProblem(settings, logs[:1], pool), plain, theta)


def test_a_member_that_kills_is_infeasible_and_harms_no_other(
    plain: Problem, pool: Executor, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("hydroid.execution.local.TRIES", 1)  # a new process takes seconds on a busy machine
    theta = some_sets(plain, 7)[:6]
    memo = Memo(SpreadProblem(*arguments(), Poisoned(pool)))
    healthy = plain.evaluate(theta)
    deadly = theta.copy()
    deadly[3, 0] = POISON
    found = memo.evaluate(deadly)
    assert np.isinf(found.overall[3])
    assert np.isinf(found.segments[3]).all()
    others = np.arange(6) != 3
    np.testing.assert_array_equal(found.segments[others], healthy.segments[others])
    assert memo.infeasible == 1
    residuals = memo.problem.residuals(deadly[2:5])
    assert np.isnan(residuals[1]).all()
    np.testing.assert_array_equal(residuals[::2], plain.residuals(theta[2:5:2]))


QUICK = ["--algorithm", "ga", "--set", "search.ga.population=6", "--set", "refinement.iterations=1"]


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-c", "from hydroid.cli.app import main; main()", *map(str, arguments)]


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three seconds of a virtual rig's log."""
    path = tmp_path_factory.mktemp("log") / "short.csv"
    lines = (ROOT / "examples" / "logs" / "rig_shoulder_1.csv").read_text().splitlines()
    path.write_text("\n".join(lines[:301]) + "\n")
    return path


def test_a_fit_with_workers_is_the_fit_without(short: Path, tmp_path: Path):
    for name, more in (("alone", ["--threads", 1]), ("spread", ["--workers", 2])):
        arguments = ["fit-mech", short, "--out", name, "--quiet", *QUICK, "--set", "search.ga.generations=2"]
        done = subprocess.run(
            command(*arguments, *more), cwd=tmp_path, capture_output=True, text=True, timeout=240
        )
        assert done.returncode == 0, done.stderr
    for file in ("estimate.yaml", "history.csv"):
        assert (tmp_path / "alone" / file).read_bytes() == (tmp_path / "spread" / file).read_bytes()


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
@pytest.mark.parametrize("how", ["SIGTERM", "SIGINT to the group", "SIGKILL"])
def test_a_stopped_fit_leaves_no_process(short: Path, tmp_path: Path, how: str):
    arguments = ["fit-mech", short, "--out", "run", "--workers", 2, *QUICK]
    run = subprocess.Popen(
        command(*arguments, "--set", "search.ga.generations=100000"),
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        checkpoint = tmp_path / "run" / "checkpoint.npz"
        wait_for(checkpoint.exists)  # the first is written after some seconds of search
        workers = children(run.pid)
        assert len(workers) == 2
        if how == "SIGINT to the group":
            os.killpg(run.pid, signal.SIGINT)
        else:
            run.send_signal(signal.Signals[how])
        _, errors = run.communicate(timeout=60)
        wait_for(lambda: not any(alive(pid) for pid in workers))
    finally:
        run.kill()  # with it end its workers, whatever went wrong here
    if how != "SIGKILL":
        assert run.returncode == 130, errors
        assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "interrupted"
        assert "Traceback" not in errors


def children(parent: int) -> list[int]:
    """Python processes that simulate for `parent` (multiprocessing's own tracker is another child)."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            of = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            if of == parent and "spawn_main" in (entry / "cmdline").read_text():
                found.append(int(entry.name))
        except OSError:  # has ended meanwhile
            continue
    return found


def wait_for(condition) -> None:
    import time

    deadline = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)
