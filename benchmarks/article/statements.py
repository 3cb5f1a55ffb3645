"""Verdicts that need no test over seeds: on statements that figures are judged by (choices.md)."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from claims import Outcome, Verdict
from scipy.signal import find_peaks
from studies import Figure, Runs

from hydroid.parameters import Array
from hydroid.posterior.linear import linearised

FOLLOWS = 0.05
"""rms error, as part of the record's range, up to which a response follows the data"""
PEAK = 0.1
"""part of the record's range by which a peak or trough must stand out"""


def statements(runs: Runs) -> Iterator[Verdict]:
    """Yield the verdict on the statements of each figure that has some."""
    for figure in runs.plan.study.figures:
        for says, groups in figure.orders.items():
            effects = np.degrees(linearised(runs.problem, runs.theta).sensitivity).tolist()
            by_name = dict(zip(runs.problem.parameters.names, effects, strict=True))
            yield Verdict(says, figure.item, *ranking(by_name, groups))
        if figure.says:
            holds, detail = judged(runs, figure)
            yield Verdict(figure.says, figure.item, Outcome.CONFIRMED if holds else Outcome.OPEN, detail)


def ranking(effects: Mapping[str, float], groups: Sequence[Sequence[str]]) -> tuple[Outcome, str]:
    """Whether each effect of a group [deg rms] is larger than each of the next one."""
    holds = all(min(effects[n] for n in a) > max(effects[n] for n in b) for a, b in pairwise(groups))
    names = sorted((name for group in groups for name in group), key=lambda name: -effects[name])
    sizes = ", ".join(f"{name} {effects[name]:.2g}" for name in names)
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


def judged(runs: Runs, figure: Figure) -> tuple[bool, str]:
    """Return whether the statement of a figure holds, and what that rests on."""
    angle = runs.record[1]
    match figure.kind:
        case "segments":
            count, turns = len(runs.problem.bounds), turning_points(angle)
            size = f"{100 * PEAK:g} % of the range"
            return count == turns, f"segments: {count}; peaks and troughs of at least {size}: {turns}"
        case "commands":
            command = runs.problem.logs[0].command[:, runs.problem.outputs[0]]
            levels = 1 + int(np.count_nonzero(np.diff(command)))
            text = f"{levels} levels from {command.min():.0f} to {command.max():.0f} %"
            return bool(np.abs(command).max() <= 100.0), text
        case "arm":
            joints = runs.problem.settings.arm.joints
            kinds = [joint.actuator.kind for joint in joints if joint.actuator is not None]
            count = " and ".join(f"{kinds.count(kind)} {kind}" for kind in ("linear", "rotary"))
            same = all(kinds.count(kind) == number for kind, number in figure.actuators.items())
            return same, f"{len(joints)} joints; {count} actuators"
        case "surface":
            error = runs.surface(figure)[2]
            count, shape = local_minima(error), " by ".join(map(str, error.shape))
            return count > 1, f"{count} local minim{'um' if count == 1 else 'a'} on a grid of {shape} points"
        case _:  # whether the responses follow the data
            rows = {cell: [row.values["rms error"] for row, _ in runs.of(cell)] for cell in figure.cells}
            medians = {cell: float(np.median(errors)) for cell, errors in rows.items()}
            limit = FOLLOWS * float(np.ptp(angle))
            errors = "; ".join(f"{cell} {error:.3g} deg" for cell, error in medians.items())
            allowed = f"{limit:.3g} deg, {100 * FOLLOWS:g} % of the record's range"
            text = f"median rms error: {errors}; to follow allows {allowed}"
            return max(medians.values()) <= limit, text
