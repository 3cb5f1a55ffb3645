"""Three least-squares methods on the same problems: simulations to the optimum, and whether they say so.

    python benchmarks/least_squares.py [--only "stage 1" ...]

`scipy.optimize.least_squares` (trf) and `mujoco.minimize.least_squares` get the same residuals on the unit
box, with forward differences, scaling by the Jacobian and their own endings; hydroid's has its default
settings. Each starts where a short search ends, or at a random candidate of the article's study. Printed:
simulations in all (at most 2,000), simulations until the cost was within 0.1 % of the lowest that any of the
three found, final rms error, and how it ended.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize
from common import options, refined, row, table
from mujoco import minimize

from hydroid import load_settings, read_logs
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.estimate import read_values
from hydroid.fitting.fit import fit
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

ROOT = Path(__file__).parents[1]
LOG = ROOT / "examples" / "logs" / "rig_shoulder_1.csv"
TRUTH = ROOT / "examples" / "article" / "truth.yaml"
LIMIT, NEAR = 2000, 1e-3
DEFAULTS = RefinementSettings()
GA = {"search.algorithm": "ga", "search.ga.generations": 8}

Start = tuple[Problem, np.ndarray]
"""a problem, and where a method starts, shape (P,)"""


class LimitReached(Exception):
    """The simulations are used up."""


@dataclass
class Counter:
    """Residuals of points of the unit box, (n, p) -> (n, R), with the course of the lowest cost."""

    problem: Problem
    simulated: int = 0
    course: list[tuple[int, float]] = field(default_factory=list[tuple[int, float]])
    best: np.ndarray | None = None

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        """Simulate points."""
        if self.simulated >= LIMIT:
            raise LimitReached
        rows = self.problem.residuals(self.problem.parameters.from_unit(np.clip(unit, 0, 1)))
        self.simulated += len(unit)
        costs = np.where(np.isfinite(rows).all(axis=1), np.sum(np.nan_to_num(rows) ** 2, axis=1), np.inf)
        if not self.course or costs.min() < self.course[-1][1]:
            self.course.append((self.simulated, float(costs.min())))
            self.best = unit[np.argmin(costs)]
        return rows


def hydroid(count: Counter, start: np.ndarray) -> str:
    return str(least_squares(start, count, DEFAULTS)).partition("; ")[2]


def scipy_trf(count: Counter, start: np.ndarray) -> str:
    rows: dict[bytes, np.ndarray] = {}

    def residual(x: np.ndarray) -> np.ndarray:
        if x.tobytes() not in rows:
            rows[x.tobytes()] = count(x[None])[0]
        return rows[x.tobytes()]

    def jacobian(x: np.ndarray) -> np.ndarray:
        h = np.where(x > 0.5, -(2.0**-26), 2.0**-26)
        return ((count(x + np.diag(h)) - residual(x)) / h[:, None]).T

    how: dict[str, Any] = {"jac": jacobian, "x_scale": "jac", "ftol": 1e-8, "xtol": 1e-14, "gtol": None}
    start = np.clip(start, 1e-10, 1 - 1e-10)
    return str(scipy.optimize.least_squares(residual, start, bounds=(0, 1), **how).message)


def mujoco_minimize(count: Counter, start: np.ndarray) -> str:
    bounds = (np.zeros_like(start), np.ones_like(start))
    how: dict[str, Any] = {"x_scale": "jac", "xtol": 1e-14, "gtol": 0.0, "verbose": 0}
    _, trace = minimize.least_squares(start, lambda x: count(x.T).T, bounds, **how)
    return "iteration limit" if len(trace) > 100 else "steps or gradient below its tolerance"


METHODS = {"hydroid": hydroid, "scipy trf": scipy_trf, "mujoco.minimize": mujoco_minimize}


def searched(config: str, changes: Mapping[str, object]) -> Start:
    """A problem on the rig's log, and the estimate of a short search."""
    settings = load_settings(config, {**changes, "refinement": None})
    problem = Problem(settings, read_logs([LOG], settings))
    return problem, fit(problem).best.theta


def stage_1() -> Start:
    return searched("fit-mech", GA)


def stage_2() -> Start:
    problem, start = stage_1()
    values = problem.parameters.mapping(refined(problem, start, DEFAULTS)[0])
    return searched("fit-hyd", GA | {f"parameters.{n}.fixed": v for n, v in values.items() if n[0] == "M"})


def article() -> Start:
    settings = load_settings("article-mech")
    drive = pseudo_random_log(settings.arm.pose("study"), [2])
    problem = Problem(settings, [simulate_log(settings, drive, read_values(TRUTH)[0], str(TRUTH))])
    return problem, problem.parameters.from_unit(np.random.default_rng(0).random((1, 9)))[0]


PROBLEMS = {"stage 1": stage_1, "stage 2": stage_2, "article": article}


def compare(name: str) -> None:
    """Solve one problem with all methods, and print a row of each."""
    problem, theta = PROBLEMS[name]()
    start, ends = problem.parameters.to_unit(theta[None])[0], dict[str, tuple[Counter, str]]()
    for method, solve in METHODS.items():
        count = Counter(problem)
        try:
            ending = solve(count, start.copy())
        except Exception as error:  # what its user would see
            ending = f"{type(error).__name__}: {error}"
        ends[method] = count, ending
    lowest = min(count.course[-1][1] for count, _ in ends.values())
    for method, (count, ending) in ends.items():
        near = next((n for n, cost in count.course if cost <= (1 + NEAR) * lowest), "not reached")
        assert count.best is not None
        rms = np.rad2deg(problem.rms(problem.residuals(problem.parameters.from_unit(count.best[None])))[0])
        row(f"{name} | {start.size} | {method} | {count.simulated} | {near} | {rms:.4g} | {ending}")


if __name__ == "__main__":
    table("problem | parameters | method | simulations | until 0.1 % | rms [deg] | ending")
    for name in options(__doc__, only=list(PROBLEMS)).only:
        compare(name)
