"""A designed experiment against random ones of the same length and limits.

    python benchmarks/designed_experiment.py [--random 20] [--effort 220] [--fits 50] [--duration 30]
        [--without "rest slew clearance"] [--seed 1]

`--without` switches limits off; with `--fits 0` nothing is refitted. docs/measured.md says what is simulated;
the truth is the article's. The random experiments are the first that drive all six joints of those that the
designer begins with.

Precision is that at the truth, with the total mass as the only prior. Predicted: Cramer-Rao bound. Refitted:
spread over noisy logs of the designed experiment, and of the random one with the median weakest parameter.
"""

from typing import Any

import numpy as np
from common import ARTICLE_TRUTH, Clock, options, refined, table
from made_logs import noisy, simulate_log

from hydroid import load_settings
from hydroid.advice.design import ExperimentSimulator, design
from hydroid.log import Log
from hydroid.posterior.linear import estimate_box, prior_slopes, white_posterior
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

TOTAL, TOTAL_SD, NOISE_DEG, SEED = 42.5, 0.5, 0.1, 1
OFF = {"rest": {"rest_s": 0.0}, "slew": {"slew_pct_s": None}, "clearance": {"clearance_m": None}}
"""settings that switch a limit off"""
TRUTH = np.array([*ARTICLE_TRUTH.values()])


def make_settings(given: Any) -> FitSettings:
    """Settings with bounds far enough from the truth that they cut no estimate off."""
    how = {"duration_s": given.duration, "poses": "any", "noise_deg": NOISE_DEG, "effort": given.effort}
    masses = [f"M{i}" for i in range(1, 7)]
    changes: dict[str, Any] = {
        "outputs": [1, 2, 3, 4, 5, 6],
        "simulation.other_joints": "locked",
        "objective.noise_deg": NOISE_DEG,
        "priors": {"total mass": {"of": masses, "value": TOTAL, "sd": TOTAL_SD}},
        "design": how | {k: v for limit in given.without.split() for k, v in OFF[limit].items()},
    }
    changes |= {f"parameters.{name}.bounds": [v / 20, 20 * v] for name, v in ARTICLE_TRUTH.items()}
    return load_settings("article-mech", changes)


def refitted(settings: FitSettings, log: Log, count: int) -> np.ndarray:
    """Relative spread of refits to noisy logs, shape (P,); the start pose is known from standstill."""
    rng, estimates = np.random.default_rng(SEED + 2), []
    for _ in range(count):
        measured = noisy(log, NOISE_DEG, rng)
        total = settings.priors["total mass"].model_copy(update={"value": rng.normal(TOTAL, TOTAL_SD)})
        problem = Problem(settings.model_copy(update={"priors": {"total mass": total}}), [measured])
        start = TRUTH * np.exp(rng.uniform(-0.05, 0.05, len(TRUTH)))
        estimates.append(refined(problem, start, RefinementSettings(gain_tolerance=1e-6))[0] / TRUTH)
    return np.std(estimates, axis=0, ddof=1) if count else np.full(len(TRUTH), np.nan)


def weakest(sds: Any) -> np.ndarray:
    """Return deviations, shape (..., P), with the largest of them as one more."""
    return np.append(sds, np.max(sds, axis=-1, keepdims=True), axis=-1)


def study(given: Any) -> None:
    settings, clock = make_settings(given), Clock()
    estimate = TRUTH * np.exp(np.random.default_rng(SEED).uniform(np.log(0.8), np.log(1.25), len(TRUTH)))
    best = design(settings, estimate, [], given.seed, lambda what, done, of: None)
    print(f"designed in {clock} from {settings.design.effort} experiments", flush=True)
    problem = Problem(settings, [best.log])
    box = estimate_box(problem.parameters, TRUTH)
    there = white_posterior(box, prior_slopes(problem.priors, box))
    at_truth = ExperimentSimulator(settings, there)
    randoms = [one.experiment for one in best.random if len(one.experiment.inputs) == len(settings.outputs)]
    randoms = randoms[: given.random]

    def response(experiment) -> Log:
        return simulate_log(settings, experiment.log(settings), ARTICLE_TRUTH)

    def predicted(experiment) -> np.ndarray:
        information = at_truth.information(experiment, response(experiment).angle)
        assert information is not None, "the experiment's simulation diverged"
        return there.add(information).deviations

    designed, drawn = best.best.experiment, weakest([predicted(e) for e in randoms])
    middle = np.argsort(drawn[:, -1])[(len(drawn) - 1) // 2]  # the better of the two in the middle
    pair = randoms[middle], designed
    at_random, as_designed = (weakest(refitted(settings, response(e), given.fits)) for e in pair)
    typical, best_sd = np.median(drawn, axis=0), weakest(predicted(designed))
    columns = (100 * sd for sd in (typical, drawn[middle], at_random, best_sd, as_designed))
    print(f"standard deviations [%], {given.duration:g} s, {NOISE_DEG} deg of noise")
    print(f"weakest parameter of the best random one: {100 * drawn[:, -1].min():.3g}")
    table(
        "parameter | random, median of predicted | median random one, predicted | refitted "
        "| designed, predicted | refitted | ratio predicted | ratio refitted",
        "{} | {:.3g} | {:.3g} | {:.3g} | {:.3g} | {:.3g} | {:.1f} | {:.1f}",
        *([*ARTICLE_TRUTH, "weakest"], *columns, typical / best_sd, at_random / as_designed),
    )


if __name__ == "__main__":
    chosen = {"random": 20, "effort": 220, "fits": 50, "duration": 30.0, "seed": SEED}
    study(options(__doc__, **chosen, without=""))
