"""Do intervals of quantities hold where no parameter is known? Stage 2 on simulated logs with known truth.

    python benchmarks/quantity_coverage.py [--logs 40] [--seconds 20]

The article's ten hydraulic parameters of the shoulder are all free: F1, F2, x1 and x2 act through two
numbers, and a common scale of I_max and I_min trades with them. So three directions are exactly
unidentifiable, and the parameters in them have no interval. The noise of 0.1 deg is white; each fit estimates
it from its residual. The refinement starts at the truth times random factors within 5 %: this is a study of
the intervals, not of the search. A quantity is covered where its 95 % interval holds its value at the true
parameters, which the same test movements give. The first sample is the start pose and has no noise, as in
interval_coverage.py.
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.posterior.bench import make_bench
from hydroid.posterior.covariance import uncertainty
from hydroid.posterior.quantities import joint_measure
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem

LEVEL = np.deg2rad(0.1)
TRUTH = {"A_A": 1000.0, "A_B": 750.0, "I_max": 0.9, "I_min": 0.3, "A": 1.4, "C": 1.2}
TRUTH |= {"F1": 8.0, "F2": 0.7, "x1": 0.8, "x2": 12.0}
FREED = {f"parameters.{name}.fixed": None for name in ("F1", "x1", "x2")}
BAND = {"hydraulics.overlap_a": 0.4, "hydraulics.overlap_b": 0.3}
"""so that there is a dead band; the article's model has none"""
CONVERGED = {"refinement.gain_tolerance": 1e-6}


def true_log(settings, seconds: float) -> Log:
    """A pseudo-random log of the shoulder that keeps off the stops."""

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(settings, log, TRUTH, "truth").angle
        return bool(np.all(angle > settings.arm.lower + 0.05) and np.all(angle < settings.arm.upper - 0.05))

    drive = pseudo_random_log(
        settings.arm.pose("study"), [2], duration=seconds, seed=3, allowed=off_the_stops
    )
    return simulate_log(settings, drive, TRUTH, "truth")


def main() -> None:
    """Fit every log, and print how often each quantity's interval holds the truth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    settings = load_settings("article-hyd", FREED | BAND | CONVERGED)
    clean, began = true_log(settings, options.seconds), time.perf_counter()
    problem = Problem(settings, [clean])
    truth, free = problem.parameters.vector(TRUTH, "truth"), problem.parameters.free
    # planned at the truth once: every fit then states the same quantities
    measure = joint_measure(make_bench(settings, [clean], 2), problem.bindings.candidates(truth[None]))
    columns, actual = zip(*measure(problem.bindings.candidates(truth[None])), strict=True)
    labels = [f"{c.label}{f' at {c.at:.0f}' if c.along else ''} [{c.unit}]" for c in columns]
    true = np.array([float(value[0]) for value in actual])
    positive = np.array([column.positive for column in columns])

    def values(theta: np.ndarray) -> np.ndarray:
        return np.stack([value for _, value in measure(problem.bindings.candidates(theta))], axis=1)

    intervals, estimates, sds, unknown = [], [], [], []
    assert settings.refinement is not None
    for seed in range(options.logs):
        rng = np.random.default_rng(seed)
        noise = rng.normal(0.0, LEVEL, clean.angle.shape)
        noise[0] = 0.0
        log = replace(clean, angle=clean.angle + noise)
        one = Problem(settings, [log])
        first = truth * np.where(free, rng.uniform(0.95, 1.05, len(truth)), 1.0)
        found = refine(one, first, settings.refinement)
        theta = one.parameters.from_unit(found.point)
        told = uncertainty(one, theta)
        known = told.posterior.propagate(values, positive)
        intervals.append(known.interval)
        estimates.append(known.value)
        sds.append(known.sd)
        unknown.append(~np.isfinite(told.relative[free]))
    ends, sd, spread = np.array(intervals), np.array(sds), np.std(estimates, axis=0, ddof=1)
    inside = (ends[:, :, 0] <= true) & (true <= ends[:, :, 1])
    print(f"{options.logs} logs of {options.seconds:g} s, {time.perf_counter() - began:.0f} s")
    names = [n for n, each in zip(problem.parameters.names, free, strict=True) if each]
    shares = zip(names, np.mean(unknown, axis=0), strict=True)
    print("not identifiable in:", ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares))
    bias = (np.mean(estimates, axis=0) - true) / np.where(spread > 0, spread, 1.0)
    print("\n| quantity | true | covered | spread [%] | predicted / spread | bias / spread | determined |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    stated: list[int] = []
    for i, label in enumerate(labels):
        finite = np.isfinite(sd[:, i])
        if not np.any(sd[finite, i] > 0):
            continue
        covered, ratio = np.mean(inside[finite, i]), np.mean(sd[finite, i]) / spread[i]
        relative = 100 * spread[i] / abs(true[i])
        print(
            f"| {label} | {true[i]:.4g} | {100 * covered:.1f} % | {relative:.2f} | {ratio:.2f} "
            f"| {bias[i]:.2f} | {100 * np.mean(finite):.0f} % |"
        )
        stated.append(i)
    print(f"| all | | {100 * np.mean(inside[:, stated]):.1f} % | | | | |")


if __name__ == "__main__":
    main()
