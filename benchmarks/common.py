"""What several benchmarks share: a table, the time a fit takes, and a log of the true arm off its stops."""

import time
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.settings.fit import FitSettings

OFF = 0.05
"""distance from the stops [rad]"""


def table(header: Sequence[str], rows: Iterable[Sequence[object]] = ()) -> None:
    """Print a table in Markdown; further rows may follow by `row`."""
    row(header)
    row(["---"] * len(header))
    for each in rows:
        row(each)


def row(cells: Sequence[object]) -> None:
    """Print one row of a table."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


class Clock:
    """Wall and CPU time of all threads since it was made [s]."""

    def __init__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    def __str__(self) -> str:
        wall, cpu = time.perf_counter() - self._begun[0], time.process_time() - self._begun[1]
        return f"{wall:.0f} s, {cpu:.0f} s of CPU"


def true_log(
    settings: FitSettings, truth: Mapping[str, float], joints: Sequence[int], seconds: float, seed: int = 3
) -> Log:
    """Return the response to pseudo-random commands of some joints that keeps off the stops."""
    low, high = settings.arm.lower + OFF, settings.arm.upper - OFF

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(settings, log, truth, "truth").angle
        return bool(np.all((angle > low) & (angle < high)))

    pose = settings.arm.pose("study")
    drive = pseudo_random_log(pose, list(joints), duration=seconds, seed=seed, allowed=off_the_stops)
    return simulate_log(settings, drive, truth, "truth")
