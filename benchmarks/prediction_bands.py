"""Prediction bands: the share of an unseen log's samples inside, with the model exact and with a wrong one.

    python benchmarks/prediction_bands.py [--logs 20]

Stage 1 of the shoulder: K, D and S are fitted to a log of steps with white noise of 0.1 deg, the start pose
included, and predict another log. That log is simulated at the fitted log's truth, or with a stiffer spring.
"""

import argparse
from dataclasses import replace

import numpy as np

from hydroid import load_settings
from hydroid.fitting.refinement import refine
from hydroid.fitting.summary import account
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.band import prediction_bands
from hydroid.posterior.covariance import uncertainty
from hydroid.prediction import predict, simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

TRUTH = {"K": 1.0, "D": 60.0, "S": 100.0, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
CHANGES = {
    "free_start": True,
    "simulation.other_joints": "locked",
    **{f"parameters.{name}.bounds": [0.2 * TRUTH[name], 5 * TRUTH[name]] for name in ("K", "D", "S")},
    **{f"parameters.{name}.fixed": value for name, value in TRUTH.items() if name.startswith("M")},
}
STIFFER = {"exact": 1.0, "S 5 % wrong": 1.05, "S 20 % wrong": 1.2, "S 50 % wrong": 1.5}


def noisy(settings: FitSettings, values: dict[str, float], rng: np.random.Generator) -> Log:
    """Random steps of the shoulder with white noise of 0.1 deg, at the start too."""
    pose = settings.arm.pose("study")
    command = np.zeros((500, len(pose)))
    command[:, 1] = np.repeat(rng.uniform(-60.0, 60.0, 5), 100)
    time = np.arange(len(command), dtype=np.float64) * 0.01
    drive = Log("steps.csv", time, command, np.tile(pose, (len(time), 1)), 0.01)
    log = simulate_log(settings, drive, values, "truth")
    return replace(log, angle=log.angle + rng.normal(0.0, np.deg2rad(0.1), log.angle.shape))


def fitted(settings: FitSettings, log: Log) -> IdentifiedModel:
    """Refine from the truth, and keep what a fit keeps."""
    problem = Problem(settings, [log])
    assert settings.refinement is not None
    found = refine(
        problem, problem.parameters.vector(TRUTH, "truth"), settings.refinement, lambda n, rms: None
    )
    theta = problem.parameters.from_unit(found.point)
    known = uncertainty(problem, theta)
    return IdentifiedModel(settings, theta, "fit", account(problem, known))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=20)
    count, settings = parser.parse_args().logs, load_settings("article-mech", CHANGES)
    print("| model | inside the band, median (range) | the verdict blames the model |")
    print("| --- | --- | --- |")
    for name, factor in STIFFER.items():
        inside, blamed = [], 0
        for seed in range(count):
            rng = np.random.default_rng(seed)
            model = fitted(settings, noisy(settings, TRUTH, rng))
            log = noisy(settings, TRUTH | {"S": factor * TRUTH["S"]}, rng)
            band = prediction_bands(model, log, predict(model, log, settings.outputs))[2]
            inside.append(100 * band.inside)
            blamed += band.model_limits
        low, middle, high = np.quantile(inside, [0.0, 0.5, 1.0])
        print(f"| {name} | {middle:.0f} % ({low:.0f} to {high:.0f}) | {blamed} of {count} |", flush=True)


if __name__ == "__main__":
    main()
