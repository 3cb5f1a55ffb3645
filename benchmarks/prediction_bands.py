"""Prediction bands: the share of an unseen log's samples inside, with the model exact and with a wrong one.

    python benchmarks/prediction_bands.py [--logs 20]

Stage 1 of the shoulder: K, D and S are fitted to a log of steps with white noise of 0.1 deg, the start pose
included, and predict another log. That log is simulated at the fitted log's truth, or with a stiffer spring.
"""

import numpy as np
from common import noisy, options, refined, row, table
from interval_coverage import TRUTH

from hydroid import load_settings
from hydroid.fitting.summary import account
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.posterior.band import prediction_bands
from hydroid.posterior.covariance import uncertainty
from hydroid.prediction import predict, simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

CHANGES = {
    "free_start": True,
    "simulation.other_joints": "locked",
    **{f"parameters.{name}.bounds": [0.2 * TRUTH[name], 5 * TRUTH[name]] for name in ("K", "D", "S")},
    **{f"parameters.{name}.fixed": value for name, value in TRUTH.items() if name.startswith("M")},
}
STIFFER = {"exact": 1.0, "S 5 % wrong": 1.05, "S 20 % wrong": 1.2, "S 50 % wrong": 1.5}


def steps(settings: FitSettings, values: dict[str, float], rng: np.random.Generator) -> Log:
    """Random steps of the shoulder with white noise of 0.1 deg, at the start too."""
    pose, time = settings.arm.pose("study"), np.arange(500, dtype=np.float64) * 0.01
    command = np.zeros((500, len(pose)))
    command[:, 1] = np.repeat(rng.uniform(-60.0, 60.0, 5), 100)
    drive = Log("steps.csv", time, command, np.tile(pose, (500, 1)), 0.01)
    return noisy(simulate_log(settings, drive, values, "truth"), rng, start=True)


def fitted(settings: FitSettings, log: Log) -> IdentifiedModel:
    """Refine from the truth, and keep what a fit keeps."""
    problem = Problem(settings, [log])
    theta, _ = refined(problem, problem.parameters.vector(TRUTH, "truth"))
    return IdentifiedModel(settings, theta, "fit", account(problem, uncertainty(problem, theta)))


def study(count: int) -> None:
    """Predict as many logs with each model, and print the table."""
    settings = load_settings("article-mech", CHANGES)
    table("model | inside the band, median (range) | the verdict blames the model")
    for name, factor in STIFFER.items():
        bands = []
        for seed in range(count):
            rng = np.random.default_rng(seed)
            model = fitted(settings, steps(settings, TRUTH, rng))
            log = steps(settings, TRUTH | {"S": factor * TRUTH["S"]}, rng)
            bands.append(prediction_bands(model, log, predict(model, log, settings.outputs))[2])
        low, middle, high = np.quantile([100 * band.inside for band in bands], [0.0, 0.5, 1.0])
        blamed = sum(band.model_limits for band in bands)
        row(f"{name} | {middle:.0f} % ({low:.0f} to {high:.0f}) | {blamed} of {count}")


if __name__ == "__main__":
    study(options(__doc__, logs=20).logs)
