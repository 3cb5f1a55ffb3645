"""A designed experiment against random ones of the same length and limits.

    python benchmarks/designed_experiment.py [--random 20] [--effort 220] [--fits 50] [--duration 30]
        [--without rest slew clearance] [--seed 1]

`--without` switches limits off; with `--fits 0` nothing is refitted.

Stage 1, joints 1 to 6 driven and measured with 0.1 deg of white noise, nine parameters (K, D, S shared by
the joints, six masses), the total of the masses known to 42.5 ± 0.5 kg. The truth is the article's; designer
and random experiments know only an estimate that is off by up to a quarter in every parameter. A random
experiment is one draw: a start pose uniform within the joints' ranges (a quarter: a named one), all six
joints with random levels in ±100 % and dwells of 1 to 5 s, levels turned round or reduced where the joint's
range or speed would be left, as the designer's own candidates are.

Precision is that of the truth, without any prior but the total mass. Predicted: Cramer-Rao bound. Simulated:
standard deviation over refits of noisy logs of the designed experiment, and of the random one whose weakest
parameter is predicted the median. One seed throughout; no experiment is chosen by what follows.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid import load_settings
from hydroid.advice.commands import RandomExperiments, violation
from hydroid.advice.design import design
from hydroid.advice.information import ExperimentSimulator
from hydroid.estimate import read_values
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.posterior.jacobian import estimate_box, prior_slopes, white_posterior
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.search import RefinementSettings

TRUTH = Path(__file__).parents[1] / "examples" / "article" / "truth.yaml"
MASSES = [f"M{i}" for i in range(1, 7)]
TOTAL, TOTAL_SD, NOISE_DEG = 42.5, 0.5, 0.1
SEED = 1
OFF = {"rest": {"rest_s": 0.0}, "slew": {"slew_pct_s": None}, "clearance": {"clearance_m": None}}
"""settings that switch a limit off"""


def make_settings(values: dict, arguments: argparse.Namespace):
    """Settings with bounds far enough from the truth that they cut no estimate off."""
    changes: dict[str, Any] = {
        "outputs": [1, 2, 3, 4, 5, 6],
        "simulation.other_joints": "locked",
        "objective.noise_deg": NOISE_DEG,
        "priors": {"total mass": {"of": MASSES, "value": TOTAL, "sd": TOTAL_SD}},
        "design": {
            "duration_s": arguments.duration,
            "poses": "any",
            "noise_deg": NOISE_DEG,
            "effort": arguments.effort,
        },
    }
    for limit in arguments.without:
        changes["design"] |= OFF[limit]
    changes |= {f"parameters.{name}.bounds": [v / 20, 20 * v] for name, v in values.items()}
    settings = load_settings("article-mech", changes)
    return settings, settings.arm


def random_experiments(settings, simulator: ExperimentSimulator, count: int, seed: int) -> list:
    """Single draws that drive all joints and keep the limits at the estimate."""
    experiments = RandomExperiments(settings, np.random.default_rng(seed + 1))
    found = []
    while len(found) < count:
        experiment = experiments.draw()
        if len(experiment.inputs) == len(settings.outputs):
            kept = simulator.within_limits(experiment)
            found += [] if kept is None else [kept[0]]
    return found


def refit(arm, settings, log: Log, truth: np.ndarray, count: int) -> np.ndarray:
    """Relative errors of refits to noisy logs, shape (count, P); the start pose is known from standstill."""
    rng = np.random.default_rng(SEED + 2)
    errors = []
    for _ in range(count):
        noise = rng.normal(0.0, np.radians(NOISE_DEG), log.angle.shape)
        noise[0] = 0.0
        total = settings.priors["total mass"].model_copy(update={"value": rng.normal(TOTAL, TOTAL_SD)})
        known = settings.model_copy(update={"priors": {"total mass": total}})
        problem = Problem(known, [replace(log, angle=log.angle + noise)])
        start = truth * np.exp(rng.uniform(-0.05, 0.05, len(truth)))
        how = RefinementSettings(gain_tolerance=1e-6)
        point = refine(problem, start, how).point
        errors.append(problem.parameters.from_unit(point) / truth - 1)
    return np.array(errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--random", type=int, default=20)
    parser.add_argument("--effort", type=int, default=220)
    parser.add_argument("--fits", type=int, default=50)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=SEED, help="of the designer and the random experiments")
    parser.add_argument("--without", nargs="+", choices=OFF, default=[])
    arguments = parser.parse_args()
    values = read_values(TRUTH)[0]
    settings, arm = make_settings(values, arguments)
    names = list(values)
    truth = np.array([values[n] for n in names])
    estimate = truth * np.exp(np.random.default_rng(SEED).uniform(np.log(0.8), np.log(1.25), len(truth)))
    began = time.perf_counter()
    found = design(settings, estimate, [], arguments.seed, lambda what, done, of: None)
    print(f"designed in {time.perf_counter() - began:.0f} s from {found.tried} experiments", flush=True)
    period, problem = settings.log.period_s, Problem(settings, [found.log])
    parameters, priors = problem.parameters, problem.priors
    boxes = [estimate_box(parameters, theta) for theta in (estimate, truth)]
    known, there = (white_posterior(box, prior_slopes(priors, box)) for box in boxes)
    blind, seeing = ExperimentSimulator(settings, known), ExperimentSimulator(settings, there)
    randoms = random_experiments(settings, blind, arguments.random, arguments.seed)

    def predicted(experiment) -> np.ndarray:
        angle = simulate_log(settings, experiment.log(settings), values, str(TRUTH)).angle
        told = seeing.information(experiment, angle)
        assert told is not None, "the experiment's simulation diverged"
        return there.add(told).deviations

    designed = predicted(found.best.experiment)
    drawn = np.array([predicted(e) for e in randoms])
    order = np.argsort(drawn.max(axis=1))
    middle = order[(len(order) - 1) // 2]  # the better of the two in the middle
    typical = np.median(drawn, axis=0)
    logs = [e.log(settings) for e in (randoms[middle], found.best.experiment)]
    logs = [simulate_log(settings, log, values, str(TRUTH)) for log in logs]
    for what, log in (("random", logs[0]), ("designed", logs[1])):
        left = violation(log.angle, period, arm, settings.design)
        said = "keeps the limits" if left is None else f"leaves the limits at {left.sample * period:.1f} s"
        print(f"the {what} one {said} when the true arm runs it", flush=True)
    spread = [
        refit(arm, settings, log, truth, arguments.fits).std(axis=0, ddof=1)
        if arguments.fits
        else np.full(len(truth), np.nan)
        for log in logs
    ]
    print(f"relative standard deviations [%], {arguments.duration:g} s, {NOISE_DEG} deg")
    print("| parameter | random, median of predicted | median random one, predicted | refitted |", end="")
    print(" designed, predicted | refitted | ratio predicted | ratio refitted |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for i, name in enumerate(names):
        row = 100 * np.array([typical[i], drawn[middle, i], spread[0][i], designed[i], spread[1][i]])
        ratios = f"{typical[i] / designed[i]:.1f} | {spread[0][i] / spread[1][i]:.1f}"
        print(f"| {name} | " + " | ".join(f"{v:.3g}" for v in row) + f" | {ratios} |")
    weakest = np.median(drawn.max(axis=1))
    print(
        f"weakest parameter: random {100 * weakest:.3g} % (median; best of {len(drawn)} "
        f"{100 * drawn.max(axis=1).min():.3g} %), designed {100 * designed.max():.3g} %: "
        f"{weakest / designed.max():.1f} times better predicted, "
        f"{spread[0].max() / spread[1].max():.1f} times refitted ({arguments.fits} logs each)"
    )


if __name__ == "__main__":
    main()
