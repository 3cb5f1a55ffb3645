"""The article's section 6.2 (table 7): recover known hydraulic parameters from noise-free simulated data.

    python benchmarks/article_hyd.py [--seeds 10] [--algorithm nsga2] [--unpinned]

The shoulder moves under pseudo-random commands in the study pose; mechanical parameters are held at their
true values, and F1, x1, x2 too unless --unpinned, where these wander along the three exact null directions
while the response is reproduced all the same.
"""

import argparse
import time

import numpy as np
from article_mech import Silent
from pseudo_random import pseudo_random_log

from hydroid import load_settings
from hydroid.fitting.fit import fit
from hydroid.log import Log
from hydroid.parameters import relative_error
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

TRUTH = {  # table 7
    "A_A": 1000.0,
    "A_B": 750.0,
    "I_max": 0.9,
    "I_min": 0.3,
    "A": 1.4,
    "C": 1.2,
    "F1": 8.0,
    "F2": 0.7,
    "x1": 0.8,
    "x2": 12.0,
}
SEVEN = ["A_A", "A_B", "I_max", "I_min", "A", "C", "F2"]
PINS = ("F1", "x1", "x2")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--algorithm", default="nsga2")
    parser.add_argument("--unpinned", action="store_true")
    arguments = parser.parse_args()
    counted = SEVEN + list(PINS) if arguments.unpinned else SEVEN
    print(f"{arguments.algorithm}: summed relative error of {len(counted)} parameters, rms of the response")
    print("| seed | search | refined | rms [deg] | simulations | seconds |")
    print("| --- | --- | --- | --- | --- | --- |")
    for seed in range(1, arguments.seeds + 1):
        changes = {"search.algorithm": arguments.algorithm, "search.seed": seed}
        if arguments.unpinned:
            changes |= {f"parameters.{name}.fixed": None for name in PINS}
        settings = load_settings("article-hyd", changes)

        def off_the_stops(log: Log) -> bool:
            angle = np.rad2deg(simulate_log(settings, log, TRUTH, "truth").angle[:, 1])  # noqa: B023
            return angle.min() > -20 and angle.max() < 80

        log = pseudo_random_log(settings.arm.pose("study"), [2], allowed=off_the_stops)
        problem = Problem(settings, [simulate_log(settings, log, TRUTH, "truth")])
        started = time.perf_counter()
        found = fit(problem, lambda state, memo: None, Silent())
        seconds = time.perf_counter() - started
        truth = problem.parameters.vector(TRUTH, "truth")
        columns = [problem.parameters.names.index(name) for name in counted]
        searched, refined = (
            relative_error(e.theta, truth)[columns].sum() for e in (found.searched, found.best)
        )
        assert found.refinement is not None
        simulated = int(found.history[-1, 2]) + found.refinement.evaluations
        rms = np.rad2deg(found.best.rms)
        print(
            f"| {seed} | {searched:.2f} | {refined:.2g} | {rms:.2g} | {simulated} | {seconds:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
