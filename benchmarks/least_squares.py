"""Three least-squares methods on the same problems: simulations to the optimum, and whether they say so.

    python benchmarks/least_squares.py [--only "stage 1" ...]

`scipy.optimize.least_squares` (trf) and `mujoco.minimize.least_squares` get the same residuals on the unit
box, with forward differences, scaling by the Jacobian and their own endings; hydroid's has its default
settings. Each starts where a short search ends, or at a random candidate of the article's study. Printed:
simulations in all (at most 2,000), simulations until the cost was within 0.1 % of the lowest that any of the
three found, final rms error, and how it ended.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize
from mujoco import minimize

from hydroid import load_settings, read_logs
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.estimate import read_values
from hydroid.fitting.fit import fit
from hydroid.fitting.refinement import refine
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.search.least_squares import least_squares
from hydroid.settings.search import RefinementSettings

ROOT = Path(__file__).parents[1]
LOG = ROOT / "examples" / "logs" / "rig_shoulder_1.csv"
TRUTH = ROOT / "examples" / "article" / "truth.yaml"
LIMIT = 2000
NEAR = 1e-3


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
        """Simulate points, shape (n, p); their residuals, shape (n, R)."""
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
    return str(least_squares(start, count, RefinementSettings())).partition("; ")[2]


def scipy_trf(count: Counter, start: np.ndarray) -> str:
    rows: dict[bytes, np.ndarray] = {}

    def residual(x: np.ndarray) -> np.ndarray:
        if x.tobytes() not in rows:
            rows[x.tobytes()] = count(x[None])[0]
        return rows[x.tobytes()]

    def jacobian(x: np.ndarray) -> np.ndarray:
        h = np.where(x > 0.5, -(2.0**-26), 2.0**-26)
        return ((count(x + np.diag(h)) - residual(x)) / h[:, None]).T

    inside = np.clip(start, 1e-10, 1 - 1e-10)
    options: dict[str, Any] = {"jac": jacobian, "x_scale": "jac", "ftol": 1e-8, "xtol": 1e-14, "gtol": None}
    result = scipy.optimize.least_squares(residual, inside, bounds=(0, 1), **options)
    return str(result.message)


def mujoco_minimize(count: Counter, start: np.ndarray) -> str:
    bounds = (np.zeros_like(start), np.ones_like(start))
    _, trace = minimize.least_squares(
        start, lambda x: count(x.T).T, bounds, x_scale="jac", xtol=1e-14, gtol=0.0, verbose=0
    )
    return "iteration limit" if len(trace) > 100 else "steps or gradient below its tolerance"


METHODS: dict[str, Callable[[Counter, np.ndarray], str]] = {
    "hydroid": hydroid,
    "scipy trf": scipy_trf,
    "mujoco.minimize": mujoco_minimize,
}


def searched(config: str, changes: Mapping[str, object]) -> tuple[Problem, np.ndarray]:
    """A problem on the rig's log, and the estimate of a short search."""
    settings = load_settings(config, {**changes, "refinement": None})
    problem = Problem(settings, read_logs([LOG], settings))
    return problem, fit(problem).best.theta


def problems() -> dict[str, Callable[[], tuple[Problem, np.ndarray]]]:
    """Problems by name, each made with its start, shape (P,)."""
    ga = {"search.algorithm": "ga", "search.ga.generations": 8}

    def stage_2() -> tuple[Problem, np.ndarray]:
        mech, theta = searched("fit-mech", ga)
        point = refine(mech, theta, RefinementSettings()).point
        values = mech.parameters.mapping(mech.parameters.from_unit(point))
        masses = {f"parameters.{n}.fixed": v for n, v in values.items() if n[0] == "M"}
        return searched("fit-hyd", ga | masses)

    def joint() -> tuple[Problem, np.ndarray]:
        problem, theta = stage_2()
        point = refine(problem, theta, RefinementSettings()).point
        return problem.varied(problem.settings.freed()), problem.parameters.from_unit(point)

    def article() -> tuple[Problem, np.ndarray]:
        settings = load_settings("article-mech")
        values, _ = read_values(TRUTH)
        log = simulate_log(settings, pseudo_random_log(settings.arm.pose("study"), [2]), values, str(TRUTH))
        problem = Problem(settings, [log])
        return problem, problem.parameters.from_unit(np.random.default_rng(0).random((1, 9)))[0]

    return {
        "stage 1": lambda: searched("fit-mech", ga),
        "stage 2": stage_2,
        "joint refinement": joint,
        "article": article,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", choices=list(problems()))
    chosen = parser.parse_args().only or list(problems())
    print("| problem | parameters | method | simulations | until 0.1 % | rms [deg] | ending |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in chosen:
        problem, theta = problems()[name]()
        start = problem.parameters.to_unit(theta[None])[0]
        ends: dict[str, tuple[Counter, str]] = {}
        for method, solve in METHODS.items():
            count = Counter(problem)
            try:
                ending = solve(count, start.copy())
            except LimitReached:
                ending = "simulation limit"
            except Exception as error:  # what its user would see
                ending = f"{type(error).__name__}: {error}"
            ends[method] = count, ending
        lowest = min(count.course[-1][1] for count, _ in ends.values())
        for method, (count, ending) in ends.items():
            near = next((n for n, cost in count.course if cost <= (1 + NEAR) * lowest), None)
            assert count.best is not None
            rms = problem.rms(problem.residuals(problem.parameters.from_unit(count.best[None])))[0]
            print(
                f"| {name} | {start.size} | {method} | {count.simulated} | {near or 'not reached'} | "
                f"{np.rad2deg(rms):.4g} | {ending} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
