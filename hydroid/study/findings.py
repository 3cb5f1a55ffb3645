"""Verdicts that need no test over seeds: on the statements that figures are judged by (docs/studies.md)."""

from collections.abc import Callable, Generator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.signal import find_peaks

from hydroid.parameters import Array
from hydroid.posterior.jacobian import jacobian
from hydroid.posterior.sweep import Surface, surface
from hydroid.problem.problem import Problem
from hydroid.settings.study import StudySettings
from hydroid.settings.study_shown import StudyFigure
from hydroid.study.claims import Outcome, Verdict
from hydroid.study.measures import Row

FOLLOWS = 0.05
"""rms error, as part of the record's range, up to which a response follows the data"""
PEAK = 0.1
"""part of the record's range by which a peak or trough must stand out"""
FULL_COMMAND = 100.0
"""largest command [%]"""

Judged = tuple[Outcome, str]
"""whether a statement holds, and what that rests on"""


def findings(
    study: StudySettings, problem: Problem, rows: Sequence[Row], points: Callable[[StudyFigure], int]
) -> Generator[Verdict]:
    """Return the verdict on the statement of each figure that has one.

    Args:
        study: with the figures.
        problem: of its first cell.
        rows: of all runs.
        points: of each parameter of a figure's surface.
    """
    for figure in study.figures:
        for says, groups in figure.orders.items():
            effects = _effects(problem, problem.parameters.vector(study.data.truth, "data.truth"))
            outcome, detail = ranking(effects, groups)
            yield Verdict(says, outcome, detail, figure.item)
        if not figure.says:
            continue
        if figure.kind == "surface":
            theta = problem.parameters.vector(study.data.truth, "data.truth")
            judged = minima(landscape(problem, theta, figure.parameters, points(figure)))
        elif figure.kind in ("responses", "segment bests"):
            judged = following(problem, rows, figure.cells)
        else:
            judged = _JUDGES[figure.kind](problem, figure)
        outcome, detail = judged
        yield Verdict(figure.says, outcome, detail, figure.item)


def _effects(problem: Problem, theta: Array) -> dict[str, float]:
    """Return by how much 1 % of each parameter changes the angle [deg rms]."""
    effects = np.degrees(jacobian(problem, theta).effects).tolist()
    return dict(zip(problem.parameters.names, effects, strict=True))


def ranking(effects: Mapping[str, float], groups: Sequence[Sequence[str]]) -> Judged:
    """Whether each effect of a group is larger than each of the next one."""
    holds = all(min(effects[n] for n in a) > max(effects[n] for n in b) for a, b in pairwise(groups))
    found = sorted((name for group in groups for name in group), key=lambda name: -effects[name])
    sizes = ", ".join(f"{name} {effects[name]:.2g}" for name in found)
    outcome = Outcome.CONFIRMED if holds else Outcome.CONTRADICTED
    return outcome, f"rms change of the angle in deg for 1 % of each parameter: {sizes}"


def minima(found: Surface) -> Judged:
    """Whether a surface has several minima."""
    count, shape = local_minima(found.error), " by ".join(map(str, found.error.shape))
    return _found(count > 1), f"{count} local minim{'um' if count == 1 else 'a'} on a grid of {shape} points"


def local_minima(error: Array) -> int:
    """Return how many points of a grid, shape (n, m), lie below all of their up to eight neighbours."""
    known = np.where(np.isfinite(error), error, np.inf)
    padded = np.pad(known, 1, constant_values=np.inf)
    n, m = error.shape
    around = [padded[i : i + n, j : j + m] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    return int(np.sum(known < np.min(around, axis=0)))


def following(problem: Problem, rows: Sequence[Row], cells: Sequence[str]) -> Judged:
    """Whether the responses of some cells follow the record: each by the median of its runs."""
    found: dict[str, float] = {}
    for cell in cells or dict.fromkeys(row.cell for row in rows):
        errors = [row.values["rms error"] for row in rows if row.cell == cell and not row.failed]
        if not errors:
            return Outcome.UNTESTED, f"no run of {cell}"
        found[cell] = float(np.median(errors))
    span = float(np.ptp(_record(problem)))
    errors = "; ".join(f"{cell} {error:.3g} deg" for cell, error in found.items())
    limit = f"{FOLLOWS * span:.3g} deg, {100 * FOLLOWS:g} % of the record's range"
    return _found(
        max(found.values()) <= FOLLOWS * span
    ), f"median rms error: {errors}; to follow allows {limit}"


def turning_points(angle: Array) -> int:
    """Return how many peaks and troughs of a record, shape (T,), stand out by PEAK of its range."""
    least = PEAK * np.ptp(angle)
    return sum(len(find_peaks(sign * angle, prominence=least)[0]) for sign in (1, -1))


def _segments(problem: Problem, _: StudyFigure) -> Judged:
    count, turns = len(problem.bounds), turning_points(_record(problem))
    size = f"{100 * PEAK:g} % of the range"
    return _found(count == turns), f"segments: {count}; peaks and troughs of at least {size}: {turns}"


def _commands(problem: Problem, _: StudyFigure) -> Judged:
    command = problem.logs[0].command[:, problem.outputs[0]]
    levels = 1 + int(np.count_nonzero(np.diff(command)))
    inside = bool(np.abs(command).max() <= FULL_COMMAND)
    return _found(inside), f"{levels} levels from {command.min():.0f} to {command.max():.0f} %"


def _arm(problem: Problem, figure: StudyFigure) -> Judged:
    kinds = [joint.actuator.kind for joint in problem.settings.arm.joints if joint.actuator is not None]
    have = {kind: kinds.count(kind) for kind in ("linear", "rotary")}
    count = " and ".join(f"{number} {kind}" for kind, number in have.items())
    same = all(have[kind] == number for kind, number in figure.actuators.items())
    return _found(same), f"{len(problem.settings.arm.joints)} joints; {count} actuators"


def _flow_chart(problem: Problem, _: StudyFigure) -> Judged:
    elite = problem.settings.search.ga.elitism
    survive = "best candidate of each generation survives" if elite == 1 else f"best {elite} of each survive"
    added = f"; added: the {survive}" if elite else ""
    return Outcome.CONFIRMED, f"each step has its test in tests/search{added}"


_JUDGES: dict[str, Callable[[Problem, StudyFigure], Judged]] = {
    "segments": _segments,
    "commands": _commands,
    "arm": _arm,
    "flow chart": _flow_chart,
}
"""figures whose statement is judged by the problem alone"""


def _found(holds: bool) -> Outcome:
    return Outcome.CONFIRMED if holds else Outcome.OPEN


def _record(problem: Problem) -> Array:
    """Return the first compared angle of the first log [deg], shape (T,)."""
    return np.degrees(problem.logs[0].angle[:, problem.outputs[0]])


def landscape(problem: Problem, theta: Array, names: tuple[str, ...], points: int) -> Surface:
    """Return the error over two parameters within their bounds, all others at theta, shape (P,)."""
    return _landscape(problem, tuple(theta.tolist()), names, points)


@lru_cache(maxsize=4)  # it is drawn and put into words
def _landscape(problem: Problem, theta: tuple[float, ...], names: tuple[str, ...], points: int) -> Surface:
    first, second = names
    return surface(problem, np.array(theta), (first, second), points, None)
