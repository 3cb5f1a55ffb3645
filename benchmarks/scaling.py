"""Wall time of a population against workers, and what a chunk costs: the numbers of docs/scaling.md.

    python benchmarks/scaling.py [--dask] [--rounds 5]

One record of 75 s on the arm with seven moving joints, both stages. Every round measures all ways in turn, so
that other load on the machine meets them alike; printed are medians. The two costs of a chunk are processor
time, which other load hardly changes. With --dask workers are also started on a Dask scheduler here.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from pseudo_random import pseudo_random_log

from hydroid.execution import Executor, Work, open_executor
from hydroid.execution.local import LocalPool
from hydroid.jobs import load_settings
from hydroid.problem.problem import Problem
from hydroid.problem.spread import SpreadProblem
from hydroid.settings.simulation import ClusterSettings

POPULATIONS, WORKERS = (70, 20), (1, 2, 4)
STAGES = {"mechanical": "article-mech", "hydraulic": "article-hyd"}


def problem_of(config: str, executor: Executor | None, threads: int) -> Problem:
    changes = {"simulation.other_joints": "passive", "simulation.threads": threads}
    settings = load_settings(config, changes)
    log = pseudo_random_log(settings.arm.pose("study"), [2], duration=75.01)
    return Problem(settings, [log]) if executor is None else SpreadProblem(settings, [log], executor)


def sets(problem: Problem, n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return problem.parameters.from_unit(rng.random((n, int(problem.parameters.free.sum()))))


def medians(
    calls: dict[str, Callable[[], object]], rounds: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Seconds of each call, in turn; the first round warms up."""
    took: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(1 + rounds):
        for name, call in calls.items():
            started = clock()
            call()
            took[name].append(clock() - started)
    return {name: statistics.median(seconds[1:]) for name, seconds in took.items()}


def overhead(executors: dict[str, Executor], rounds: int) -> None:
    """Print what a call and a chunk cost where the chunks do nothing."""
    print("\n| executor | one call [ms] | each further chunk [ms] |\n| --- | --- | --- |")
    work, many = Work(abs), 64
    for name, executor in executors.items():
        calls = {str(n): partial(executor.map, work, range(n)) for n in (1, many)}
        took = medians(calls, 4 * rounds)
        each = (took[str(many)] - took["1"]) / (many - 1)
        print(f"| {name} | {1e3 * took['1']:.2f} | {1e3 * each:.2f} |")


def chunk_cost(stage: str, rounds: int) -> None:
    """Print start and cost of a candidate of one chunk in one thread, by a line through two sizes."""
    problem = problem_of(STAGES[stage], None, 1)
    few, many = 1, 20
    calls = {str(n): partial(problem.evaluate, sets(problem, n)) for n in (few, many)}
    took = medians(calls, rounds, time.process_time)
    candidate = (took[str(many)] - took[str(few)]) / (many - few)
    start = max(took[str(few)] - candidate * few, 0.0)
    print(f"{stage}: a chunk costs {1e3 * start:.0f} ms and {1e3 * candidate:.1f} ms a candidate")


def table(stage: str, executors: dict[str, Executor], rounds: int) -> None:
    """Print wall time and efficiency of whole populations."""
    cores = os.cpu_count() or 1
    problems = {"1 thread": problem_of(STAGES[stage], None, 1)}
    problems[f"{cores} threads"] = problem_of(STAGES[stage], None, cores)
    problems |= {name: problem_of(STAGES[stage], executor, 0) for name, executor in executors.items()}
    for n in POPULATIONS:
        theta = sets(problems["1 thread"], n)
        took = medians({name: partial(p.evaluate, theta) for name, p in problems.items()}, rounds)
        print(f"\n| {stage}, population {n} | seconds | speed-up | efficiency |\n| --- | --- | --- | --- |")
        for name, seconds in took.items():
            gain = took["1 thread"] / seconds
            used = min(int(name.split()[0]), cores)
            print(f"| {name} | {seconds:.2f} | {gain:.2f} | {100 * gain / used:.0f} % |", flush=True)


@contextmanager
def dask_workers(count: int) -> Iterator[Executor]:
    """Start a scheduler and workers on this machine, as a user would, and end them."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:

        def start(*arguments: str) -> None:
            command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard"]
            quiet = subprocess.DEVNULL
            running = stack.enter_context(subprocess.Popen(command, cwd=folder, stdout=quiet, stderr=quiet))
            stack.callback(running.kill)

        file = Path(folder) / "scheduler.json"
        start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        while not file.exists():
            time.sleep(0.05)
        for _ in range(count):
            start("worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny")
        address = json.loads(file.read_text())["address"]
        executor = stack.enter_context(open_executor(None, address, ClusterSettings()))
        assert executor is not None
        while executor.workers < count:
            time.sleep(0.05)
        yield executor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dask", action="store_true")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} cores; medians of {arguments.rounds} rounds; load {os.getloadavg()[0]:.1f}")
    for stage in STAGES:
        chunk_cost(stage, arguments.rounds)
    with ExitStack() as stack:
        executors: dict[str, Executor] = {
            f"{n} worker{'s' * (n > 1)}": stack.enter_context(LocalPool(n)) for n in WORKERS
        }
        if arguments.dask:
            executors["2 Dask workers"] = stack.enter_context(dask_workers(2))
        overhead(executors, arguments.rounds)
        for stage in STAGES:
            table(stage, executors, arguments.rounds)


if __name__ == "__main__":
    main()
