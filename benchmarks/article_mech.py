"""The article's section 6.1 (table 6): recover known mechanical parameters from noise-free simulated data.

    python benchmarks/article_mech.py [--seeds 10] [--algorithms ga nsga2]

The shoulder moves under pseudo-random commands in the study pose, the other joints are passive, all share D
and S. Printed for every seed: the summed relative error of the search's estimate, as it comes, over all nine
parameters (the number of the article) and over the eight other than M1, which has no effect; then refined.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from pseudo_random import pseudo_random_log

from hydroid import load_settings
from hydroid.estimate import read_values
from hydroid.fitting.fit import Fit, fit
from hydroid.parameters import relative_error
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

TRUTH = Path(__file__).parents[1] / "examples" / "article" / "truth.yaml"


class Silent:
    """Watches nothing."""

    def generation(self, row: np.ndarray) -> None:
        """Ignore a generation."""

    def refining(self, simulated: int, rms: float) -> None:
        """Ignore the refinement."""


def study(algorithm: str, seed: int) -> tuple[Problem, Fit, np.ndarray, float]:
    """Fit one seed; return the problem, the fit, the true parameters and the wall time [s]."""
    settings = load_settings("article-mech", {"search.algorithm": algorithm, "search.seed": seed})
    values = read_values(TRUTH)[0]
    log = simulate_log(settings, pseudo_random_log(settings.arm.pose("study"), [2]), values, str(TRUTH))
    problem = Problem(settings, [log])
    started = time.perf_counter()
    result = fit(problem, lambda state, memo: None, Silent())
    return problem, result, problem.parameters.vector(values, str(TRUTH)), time.perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--algorithms", nargs="+", default=["ga", "nsga2"])
    arguments = parser.parse_args()
    for algorithm in arguments.algorithms:
        print(f"\n{algorithm}: summed relative error by seed")
        print("| seed | search, nine | search, eight | refined, eight | no effect | simulations | seconds |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        rows: list[np.ndarray] = []
        worst, names = 0.0, np.array([], str)
        for seed in range(1, arguments.seeds + 1):
            problem, result, truth, seconds = study(algorithm, seed)
            names = np.array(problem.parameters.names)
            eight = names != "M1"
            searched = relative_error(result.searched.theta, truth)
            refined = relative_error(result.best.theta, truth)
            assert result.refinement is not None
            simulated = int(result.history[-1, 2]) + result.refinement.evaluations
            none = ", ".join(names[result.without_effect])
            sums = f"{searched.sum():.2f} | {searched[eight].sum():.2f} | {refined[eight].sum():.2g}"
            print(f"| {seed} | {sums} | {none} | {simulated} | {seconds:.0f} |", flush=True)
            rows.append(searched)
            worst = max(worst, float(refined[eight].sum()))
        print(f"worst after the refinement: {worst:.2g}; median relative errors of the search's estimate:")
        print("  " + ", ".join(f"{n} {e:.2f}" for n, e in zip(names, np.median(rows, axis=0), strict=True)))


if __name__ == "__main__":
    main()
