"""Verdicts that need no test over seeds: on statements that figures are judged by (choices.md)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from claims import Outcome, Verdict
from scipy.signal import find_peaks
from studies import Figure, Runs

from hydroid.parameters import Array
from hydroid.posterior.jacobian import jacobian
from hydroid.posterior.sweep import surface

FOLLOWS = 0.05
"""rms error, as part of the record's range, up to which a response follows the data"""
PEAK = 0.1
"""part of the record's range by which a peak or trough must stand out"""

Judged = tuple[bool | Outcome, str]
"""whether a statement holds, and what that rests on"""


def statements(runs: Runs) -> Iterator[Verdict]:
    """Yield the verdict on the statements of each figure that has some."""
    for figure in runs.plan.study.figures:
        for says, groups in figure.orders.items():
            effects = np.degrees(jacobian(runs.problem, runs.theta).effects).tolist()
            by_name = dict(zip(runs.problem.parameters.names, effects, strict=True))
            yield Verdict(says, *ranking(by_name, groups), figure.item)
        if figure.says:
            holds, detail = JUDGES[figure.kind](runs, figure)
            if isinstance(holds, bool):
                holds = Outcome.CONFIRMED if holds else Outcome.OPEN
            yield Verdict(figure.says, holds, detail, figure.item)


def ranking(effects: Mapping[str, float], groups: Sequence[Sequence[str]]) -> tuple[Outcome, str]:
    """Whether each effect of a group [deg rms] is larger than each of the next one."""
    holds = all(min(effects[n] for n in a) > max(effects[n] for n in b) for a, b in pairwise(groups))
    found = sorted((name for group in groups for name in group), key=lambda name: -effects[name])
    sizes = ", ".join(f"{name} {effects[name]:.2g}" for name in found)
    outcome = Outcome.CONFIRMED if holds else Outcome.CONTRADICTED
    return outcome, f"rms change of the angle in deg for 1 % of each parameter: {sizes}"


def local_minima(error: Array) -> int:
    """Return how many points of a grid, shape (n, m), lie below all of their up to eight neighbours."""
    known = np.where(np.isfinite(error), error, np.inf)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(known, 1, constant_values=np.inf), (3, 3))
    others = np.delete(around.reshape(*error.shape, 9), 4, axis=2)
    return int(np.sum(known < others.min(axis=2)))


def turning_points(angle: Array) -> int:
    """Return how many peaks and troughs of a record, shape (T,), stand out by PEAK of its range."""
    least = PEAK * np.ptp(angle)
    return sum(len(find_peaks(sign * angle, prominence=least)[0]) for sign in (1, -1))


def _minima(runs: Runs, figure: Figure) -> Judged:
    first, second = figure.parameters
    error = surface(runs.problem, runs.theta, (first, second), runs.plan.points(figure), None).error
    count, shape = local_minima(error), " by ".join(map(str, error.shape))
    return count > 1, f"{count} local minim{'um' if count == 1 else 'a'} on a grid of {shape} points"


def _following(runs: Runs, figure: Figure) -> Judged:
    """Whether the median rms error of each drawn cell is a small part of the record's range."""
    medians: dict[str, float] = {}
    for cell in figure.cells:
        errors = [row.values["rms error"] for row, _ in runs.of(cell)]
        if not errors:
            return Outcome.UNTESTED, f"no run of {cell}"
        medians[cell] = float(np.median(errors))
    limit = FOLLOWS * float(np.ptp(runs.record[1]))
    errors = "; ".join(f"{cell} {error:.3g} deg" for cell, error in medians.items())
    allowed = f"{limit:.3g} deg, {100 * FOLLOWS:g} % of the record's range"
    return max(medians.values()) <= limit, f"median rms error: {errors}; to follow allows {allowed}"


def _segments(runs: Runs, figure: Figure) -> Judged:
    count, turns = len(runs.problem.bounds), turning_points(runs.record[1])
    size = f"{100 * PEAK:g} % of the range"
    return count == turns, f"segments: {count}; peaks and troughs of at least {size}: {turns}"


def _commands(runs: Runs, figure: Figure) -> Judged:
    command = runs.problem.logs[0].command[:, runs.problem.outputs[0]]
    levels = 1 + int(np.count_nonzero(np.diff(command)))
    inside = bool(np.abs(command).max() <= 100.0)
    return inside, f"{levels} levels from {command.min():.0f} to {command.max():.0f} %"


def _arm(runs: Runs, figure: Figure) -> Judged:
    joints = runs.problem.settings.arm.joints
    kinds = [joint.actuator.kind for joint in joints if joint.actuator is not None]
    count = " and ".join(f"{kinds.count(kind)} {kind}" for kind in ("linear", "rotary"))
    same = all(kinds.count(kind) == number for kind, number in figure.actuators.items())
    return same, f"{len(joints)} joints; {count} actuators"


JUDGES: dict[str, Callable[[Runs, Figure], Judged]] = {
    "segments": _segments,
    "commands": _commands,
    "arm": _arm,
    "surface": _minima,
    "responses": _following,
    "segment bests": _following,
}
"""by kind of figure"""
