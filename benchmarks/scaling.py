"""Wall time of a population against workers, and what a chunk costs: the numbers of docs/cluster.md.

    python benchmarks/scaling.py [--rounds 5]

One record of 75 s on the arm with seven moving joints, both stages. Every round measures all variants in
turn, so that other load on the machine affects them alike; printed are medians. The two costs of a chunk are
processor time, which other load hardly changes.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial

import numpy as np

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.parallel.cluster import open_workers
from hydroid.parallel.workers import DaskWorkers
from hydroid.problem.problem import Problem, Spread
from hydroid.settings.simulation import ClusterSettings

POPULATIONS, WORKERS = (70, 20), (1, 2, 4)
STAGES = {"mechanical": "article-mech", "hydraulic": "article-hyd"}


def problem_of(config: str, spread: Spread | None, threads: int) -> Problem:
    changes = {"simulation.other_joints": "passive", "simulation.threads": threads}
    settings = load_settings(config, changes)
    log = pseudo_random_log(settings.arm.pose("study"), [2], duration=75.01)
    return Problem(settings, [log], spread)


def random_candidates(problem: Problem, n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return problem.parameters.from_unit(rng.random((n, int(problem.parameters.free.sum()))))


def medians(
    calls: Mapping[str, Callable[[], object]], rounds: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Seconds of each call, in turn; the first round warms up."""
    took: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(1 + rounds):
        for name, call in calls.items():
            started = clock()
            call()
            took[name].append(clock() - started)
    return {name: statistics.median(seconds[1:]) for name, seconds in took.items()}


class Nothing:
    """What costs nothing to compute."""

    def rows(self, theta: np.ndarray) -> np.ndarray:
        """Return what was given."""
        return theta


def overhead(workers: dict[str, DaskWorkers], rounds: int) -> None:
    """Print what a call costs, with one chunk per worker, where there is nothing to compute."""
    print("\n| workers | one call [ms] |\n| --- | --- |")
    nothing, theta = Nothing(), np.zeros((max(WORKERS), 1))
    calls = {name: partial(spread, nothing, "rows", theta, 1) for name, spread in workers.items()}
    for name, seconds in medians(calls, 4 * rounds).items():
        print(f"| {name} | {1e3 * seconds:.1f} |")


def chunk_cost(stage: str, rounds: int) -> None:
    """Print start and cost of a candidate of one chunk in one thread, by a line through two sizes."""
    problem = problem_of(STAGES[stage], None, 1)
    few, many = 1, 20
    calls = {str(n): partial(problem.evaluate, random_candidates(problem, n)) for n in (few, many)}
    took = medians(calls, rounds, time.process_time)
    candidate = (took[str(many)] - took[str(few)]) / (many - few)
    start = max(took[str(few)] - candidate * few, 0.0)
    print(f"{stage}: a chunk costs {1e3 * start:.0f} ms and {1e3 * candidate:.1f} ms a candidate")


def table(stage: str, workers: dict[str, DaskWorkers], rounds: int) -> None:
    """Print wall time and efficiency of whole populations."""
    cores = os.cpu_count() or 1
    problems = {"1 thread": problem_of(STAGES[stage], None, 1)}
    problems[f"{cores} threads"] = problem_of(STAGES[stage], None, cores)
    problems |= {name: problem_of(STAGES[stage], spread, 0) for name, spread in workers.items()}
    for n in POPULATIONS:
        theta = random_candidates(problems["1 thread"], n)
        took = medians({name: partial(p.evaluate, theta) for name, p in problems.items()}, rounds)
        print(f"\n| {stage}, population {n} | seconds | speed-up | efficiency |\n| --- | --- | --- | --- |")
        for name, seconds in took.items():
            gain = took["1 thread"] / seconds
            used = min(int(name.split()[0]), cores)
            print(f"| {name} | {seconds:.2f} | {gain:.2f} | {100 * gain / used:.0f} % |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} cores; medians of {arguments.rounds} rounds; load {os.getloadavg()[0]:.1f}")
    for stage in STAGES:
        chunk_cost(stage, arguments.rounds)
    with ExitStack() as stack:
        workers: dict[str, DaskWorkers] = {}
        for n in WORKERS:
            opened = stack.enter_context(open_workers(f"local:{n}", ClusterSettings()))
            assert opened is not None
            workers[f"{n} worker{'s' * (n > 1)}"] = opened
        overhead(workers, arguments.rounds)
        for stage in STAGES:
            table(stage, workers, arguments.rounds)


if __name__ == "__main__":
    main()
