"""What the benchmarks share: options, tables, a clock, simulated logs of known truth,
refits."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

from made_logs import at_rest, simulate_log

from hydroid.errors import RunError
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
SPENT = "{:.0f} s, {:.0f} s of CPU"


def options(text: str | None, **defaults: Any) -> Any:
    """Parse the flags of a benchmark whose docstring is `text`; a list takes several,
    of names only these."""
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        first, nargs = (
            (default[0], "*") if isinstance(default, list) else (default, None)
        )
        names = default if nargs and isinstance(first, str) else None
        how: dict[str, Any] = {
            "type": type(first),
            "default": default,
            "nargs": nargs,
            "choices": names,
        }
        how = {"action": "store_true"} if default is False else how
        parser.add_argument(
            f"--{name.replace('_', '-')}", help=f"by default {default}", **how
        )
    return parser.parse_args()


def table(header: str, line: str = "", *columns: Iterable[Any]) -> None:
    """Print a table in Markdown: the header, then `line` with one value of every column
    in each row."""
    print(f"\n| {header} |\n|{' --- |' * (1 + header.count('|'))}", flush=True)
    for cells in zip(*columns, strict=True):
        row(line.format(*cells))


def row(*cells: Any) -> None:
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


class Clock:
    """Wall and CPU time of all threads since it was made [s]."""

    def __init__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    @property
    def seconds(self) -> tuple[float, float]:
        return time.perf_counter() - self._begun[0], time.process_time() - self._begun[
            1
        ]

    def __str__(self) -> str:
        return SPENT.format(*self.seconds)


def pseudo_random_log(
    pose: np.ndarray,
    joints: list[int],
    duration: float = 75.0,
    period: float = 0.01,
    seed: int = 0,
    allowed: Callable[[Log], bool] = lambda log: True,
) -> Log:
    """Make a log of random levels and dwells of joints (from 1), as in figure 17, every
    joint at rest.

    A level after which `allowed` is false of the log so far is turned round or reduced,
    as by an operator who keeps the arm off its stops.
    """
    rng = np.random.default_rng(seed)
    samples = round(duration / period)
    command = np.zeros((samples, len(pose)))
    for joint in joints:
        start = 0
        while start < samples:
            dwell = round(rng.uniform(1.0, 5.0) / period)
            level = rng.uniform(-100.0, 100.0)
            for factor in (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0):
                command[start : start + dwell, joint - 1] = round(factor * level, 1)
                if allowed(
                    at_rest(
                        pose,
                        command[: min(start + dwell, samples)],
                        period,
                        "pseudo-random",
                    )
                ):
                    break
            start += dwell
    return at_rest(pose, command, period, "pseudo-random")


def true_log(
    settings: FitSettings,
    truth: Mapping[str, float],
    seconds: float,
    seed: int = 3,
    pose: np.ndarray | None = None,
    limits: np.ndarray | None = None,
) -> Log:
    """Return the response to pseudo-random commands of the outputs, kept within limits
    [rad], shape (2, J).

    By default it starts at the study pose and keeps off the stops.
    """
    arm = settings.arm
    low, high = (arm.lower + 0.05, arm.upper - 0.05) if limits is None else limits

    def inside(log: Log) -> bool:
        try:
            angle = simulate_log(settings, log, truth).angle
        except RunError:
            return False
        return bool(np.all((angle > low) & (angle < high)))

    pose, joints = arm.pose("study") if pose is None else pose, list(settings.outputs)
    drive = pseudo_random_log(
        pose, joints, seconds, settings.log.period_s, seed, inside
    )
    return simulate_log(settings, drive, truth)
