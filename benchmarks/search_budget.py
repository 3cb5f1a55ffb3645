"""How long a search has to be: generations against the share of seeds whose refinement reaches the optimum.

    python benchmarks/search_budget.py [--seeds 5] [--ga 0 5] [--nsga2 0 5 15] [--problems article ...]

Stage 1 on four logs: two of a virtual rig's shoulder, joint 2 of its log of all joints, and a simulated one
of the article's study; stage 2 on the first two, with stage 1's estimate. A search is continued from one
number of generations to the next, and refined after each. A seed has reached the optimum where its rms error
is within 0.5 % of the lowest of the table on that problem, or below 1e-4 deg. Beside the share stand the
median simulations of the search and of all refinements, and the largest rms error.
"""

import argparse
import sys
from functools import cache
from pathlib import Path

import numpy as np
from least_squares import TRUTH

from hydroid import load_settings, read_logs
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.estimate import read_values
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.fit import Fit, fit
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

LOGS = Path(__file__).parents[1] / "examples" / "logs"
PROBLEMS = (
    "rig_shoulder_1",
    "rig_shoulder_2",
    "rig_all_joints_1",
    "article",
    "rig_shoulder_1 stage 2",
    "rig_shoulder_2 stage 2",
)
EXACT = np.deg2rad(1e-4)


@cache
def stage_1(log: str) -> dict[str, float]:
    """Masses of stage 1's estimate on a log."""
    problem = make(log, {"search.nsga2.generations": 0})
    result = fit(problem)
    values = problem.parameters.mapping(result.best.theta)
    return {name: value for name, value in values.items() if name.startswith("M")}


def make(name: str, changes: dict[str, object]) -> Problem:
    """One of PROBLEMS, with settings changed."""
    log, _, stage_2 = name.partition(" ")
    if log == "article":
        settings = load_settings("article-mech", changes | {"refinement": {}})
        commands = pseudo_random_log(settings.arm.pose("study"), [2])
        logs: list[Log] = [simulate_log(settings, commands, read_values(TRUTH)[0], str(TRUTH))]
        return Problem(settings, logs)
    if log == "rig_all_joints_1":  # the other joints' motion is prescribed
        others = {j: {"command": None} for j in (1, 3, 4, 5, 6, 7)}
        changes = changes | {"log.joints": others, "simulation.other_joints": "measured"}
    if stage_2:
        changes = changes | {f"parameters.{n}.fixed": v for n, v in stage_1(log).items()}
    settings = load_settings("fit-hyd" if stage_2 else "fit-mech", changes)
    return Problem(settings, read_logs([LOGS / f"{log}.csv"], settings))


def fits(name: str, algorithm: str, several: list[int], seed: int) -> dict[int, Fit]:
    """Fits of one seed by their number of generations; each continues the search of the one before."""
    result: dict[int, Fit] = {}
    checkpoints: Checkpoints = {}
    for generations in several:
        search = {"algorithm": algorithm, "seed": seed, f"{algorithm}.generations": generations}
        problem = make(name, {f"search.{key}": value for key, value in search.items()})
        one = result[generations] = fit(problem, checkpoints=checkpoints)
        checkpoints = {"search": checkpoints["search"]}
        told = f"{name} {algorithm} {generations} seed {seed}: {np.rad2deg(one.best.rms):.6g} deg"
        print(told, "" if one.converged else "not converged", file=sys.stderr, flush=True)
    return result


def table(name: str, generations: dict[str, list[int]], seeds: int) -> None:
    """Print the rows of one problem."""
    by_seed = {a: [fits(name, a, n, seed) for seed in range(1, seeds + 1)] for a, n in generations.items()}
    every = [f.best.rms for several in by_seed.values() for one in several for f in one.values()]
    limit = max(1.005 * min(every), EXACT)
    for algorithm, several in by_seed.items():
        for number in generations[algorithm]:
            row = [one[number] for one in several]
            search = np.median([f.history[-1, 2] for f in row])
            refinement = np.median([sum(r.evaluations for r in f.refinements.values()) for f in row])
            rms = np.array([f.best.rms for f in row])
            print(
                f"| {name} | {algorithm} | {number} | {search:.0f} | {refinement:.0f} | "
                f"{np.sum(rms <= limit)} of {seeds} | {sum(f.converged for f in row)} | "
                f"{np.rad2deg(rms.max()):.4g} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--ga", type=int, nargs="*", default=[0, 5])
    parser.add_argument("--nsga2", type=int, nargs="*", default=[0, 5, 15])
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=list(PROBLEMS))
    chosen = parser.parse_args()
    print("| problem | search | generations | simulated | refining | reached | converged | worst [deg] |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in chosen.problems:
        table(name, {"ga": chosen.ga, "nsga2": chosen.nsga2}, chosen.seeds)


if __name__ == "__main__":
    main()
