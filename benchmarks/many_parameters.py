"""27 parameters (K, D, S of each joint, six masses) from one noisy log of all joints, from far-off starts.

    python benchmarks/many_parameters.py [--starts 10] [--duration 60]

The log: 60 s simulated at the article's true parameters, every joint driven by pseudo-random commands that
keep it off its stops, 0.1 deg of white noise on every angle but the first sample, which is known. The total
mass is known to 0.5 kg. Each start is a factor of 0.1 to 10 off each true value, uniform in the logarithm;
these are the bounds too. A row is a complete fit of one start: search, refinement, intervals.
"""

from typing import Any

import numpy as np
from common import Clock, options, row, table, true_log

import hydroid
from hydroid.fitting.fit import Fit, fit
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

JOINTS = range(1, 8)
MASSES = {"M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
SHARED = {"K": ("gain", 0.2), "D": ("damping", 231.8), "S": ("stiffness", 53.4)}
TRUTH = {f"{name}{j}": value for name, (_, value) in SHARED.items() for j in JOINTS} | MASSES
FACTOR, NOISE = 10.0, np.deg2rad(0.1)
REACHED = 0.01
"""of the lowest cost: what is no further above it has reached the optimum"""


def make_settings(seed: int) -> FitSettings:
    """Settings of one start."""
    parameters: dict[str, Any] = {}
    for name, value in TRUTH.items():
        what: dict[str, Any] = {"quantity": "mass", "link": f"link{name[1:]}"}
        if name not in MASSES:
            what = {"quantity": SHARED[name[0]][0], "joints": [int(name[1:])]}
        parameters[name] = what | {"bounds": [value / FACTOR, value * FACTOR]}
    changes = {
        "outputs": list(JOINTS),
        "parameters": parameters,
        "priors": {"total mass": {"of": list(MASSES), "value": sum(MASSES.values()), "sd": 0.5}},
        "objective": {"norm": 2, "segments": {"equal": 1}},
        "search": {"algorithm": "multistart", "seed": seed, "multistart": {"starts": 1}},
    }
    return hydroid.load_settings("article-mech", changes)


def cost_of(problem: Problem, theta: np.ndarray) -> tuple[float, float]:
    """Return the cost with the true noise, and the rms error [deg]."""
    rows, scores = problem.residuals(theta[None]), problem.priors.scores(theta[None])[0]
    cost = float(np.sum((rows / NOISE) ** 2) + np.sum(scores**2))
    return cost, float(np.rad2deg(problem.rms(rows)[0]))


def study(starts: int, duration: float) -> None:
    """Fit from every start, and print the table."""
    log = true_log(make_settings(1), TRUTH, JOINTS, duration, seed=0)
    log.angle[1:] += np.random.default_rng(1).normal(0.0, NOISE, log.angle[1:].shape)
    problem = Problem(make_settings(1), [log])
    truth = problem.parameters.vector(TRUTH, "truth")
    print(f"rms error at the true parameters: {cost_of(problem, truth)[1]:.5g} deg")
    table("start | rms [deg] | simulations | time")
    fits: list[tuple[float, Fit]] = []
    for seed in range(1, starts + 1):
        clock, result = Clock(), fit(Problem(make_settings(seed), [log]))
        assert result.refinement is not None
        cost, rms = cost_of(problem, result.best.theta)
        row(f"{seed} | {rms:.5g} | {int(result.history[-1, 2]) + result.refinement.evaluations} | {clock}")
        fits.append((cost, result))
    lowest, best = min(fits, key=lambda each: each[0])
    reached = sum(cost <= (1 + REACHED) * lowest for cost, _ in fits)
    print(f"{reached} of {starts} reached the optimum (cost within {REACHED:.0%} of the lowest)")
    low, high = best.uncertainty.interval.T
    inside, stated = (low <= truth) & (truth <= high), np.isfinite(low + high)
    print(f"{int(inside[stated].sum())} of {int(stated.sum())} 95 % intervals hold the truth")


if __name__ == "__main__":
    given = options(__doc__, starts=10, duration=60.0)
    study(given.starts, given.duration)
