"""How long a search has to be: generations against the share of seeds whose refinement reaches the optimum.

    python benchmarks/search_budget.py [--seeds 10] [--generations 5 10 20 40] [--algorithms ga nsga2]

Stage 1 on four logs: two of a virtual rig's shoulder, joint 2 of its log of all joints, and the article's
simulated one. A seed has reached the optimum where its cost, half the sum of squared errors, is within 1 % of
the lowest that any search of the table reached on that log, or its rms error is below 1e-4 deg.
"""

import argparse
from pathlib import Path

import numpy as np
from least_squares import TRUTH, Silent
from pseudo_random import pseudo_random_log

from hydroid.estimate import read_values
from hydroid.fitting.fit import fit
from hydroid.jobs import load_settings, read_logs
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.simulating import simulate_log

LOGS = Path(__file__).parents[1] / "examples" / "logs"
NAMES = ("rig_shoulder_1", "rig_shoulder_2", "rig_all_joints_1", "article")
EXACT = np.deg2rad(1e-4)


def make(name: str, changes: dict[str, object]) -> Problem:
    """Stage 1 on one of NAMES."""
    if name == "article":
        settings = load_settings("article-mech", changes)
        commands = pseudo_random_log(settings.arm.pose("study"), [2])
        logs: list[Log] = [simulate_log(settings, commands, read_values(TRUTH), str(TRUTH))]
    else:
        if name == "rig_all_joints_1":  # the other joints' motion is prescribed
            others = {j: {"command": None} for j in (1, 3, 4, 5, 6, 7)}
            changes = changes | {"log.joints": others, "simulation.other_joints": "measured"}
        settings = load_settings("fit-mech", changes)
        logs = read_logs([LOGS / f"{name}.csv"], settings, lambda finding: None)
    return Problem(settings, logs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--generations", type=int, nargs="+", default=[5, 10, 20, 40])
    parser.add_argument("--algorithms", nargs="+", default=["ga", "nsga2"])
    parser.add_argument("--logs", nargs="+", choices=NAMES, default=list(NAMES))
    chosen = parser.parse_args()
    print("| log | search | generations | simulations, median: search | refinement | reached |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in chosen.logs:
        rms: dict[tuple[str, int], list[float]] = {}
        spent: dict[tuple[str, int], list[tuple[int, int]]] = {}
        for algorithm in chosen.algorithms:
            for generations in chosen.generations:
                for seed in range(1, chosen.seeds + 1):
                    changes = {
                        "search.algorithm": algorithm,
                        "search.seed": seed,
                        f"search.{algorithm}.generations": generations,
                    }
                    result = fit(make(name, changes), lambda state, memo: None, Silent())
                    assert result.refinement is not None
                    key = algorithm, generations
                    rms.setdefault(key, []).append(result.best.rms)
                    counts = int(result.history[-1, 2]), result.refinement.evaluations
                    spent.setdefault(key, []).append(counts)
        lowest = min(min(values) for values in rms.values())
        for (algorithm, generations), values in rms.items():
            reached = sum(value <= max(1.005 * lowest, EXACT) for value in values)  # 1 % of its square
            search, refinement = np.median(spent[algorithm, generations], axis=0)
            print(
                f"| {name} | {algorithm} | {generations} | {search:.0f} | {refinement:.0f} | "
                f"{reached} of {chosen.seeds} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
