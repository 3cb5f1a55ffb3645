"""A designed experiment against random ones of the same length and limits.

`--without "rest slew clearance"` switches limits off; with `--fits 0` nothing is
refitted. docs/measured.md says what is simulated. The random experiments are the first
that drive all six joints of those that the designer begins with. Predicted: Cramer-Rao
bound at the truth. Refitted: spread over noisy logs of the designed experiment, and of
the random one with the median weakest parameter.
"""

from typing import Any

import numpy as np
from common import Clock, options, table
from made_logs import TRUTH, noisy, simulate_log
from recovery import refined

from hydroid import load_settings
from hydroid.advice.design import design
from hydroid.log import Log
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

TOTAL, TOTAL_SD, NOISE_DEG, SEED = 42.5, 0.5, 0.1, 1
OFF = {
    "rest": {"rest_s": 0.0},
    "slew": {"slew_pct_s": None},
    "clearance": {"clearance_m": None},
}
THETA = np.array([*TRUTH.values()])


def make_settings(given: Any) -> FitSettings:
    """Settings with bounds far enough from the truth that they cut no estimate off."""
    how = {
        "duration_s": given.duration,
        "poses": "any",
        "noise_deg": NOISE_DEG,
        "effort": given.effort,
    }
    masses = [f"M{i}" for i in range(1, 7)]
    changes: dict[str, Any] = {
        "outputs": [1, 2, 3, 4, 5, 6],
        "simulation.other_joints": "locked",
        "objective.noise_deg": NOISE_DEG,
        "priors": {"total mass": {"of": masses, "value": TOTAL, "sd": TOTAL_SD}},
        "design": how
        | {k: v for limit in given.without.split() for k, v in OFF[limit].items()},
    }
    changes |= {
        f"parameters.{name}.bounds": [v / 20, 20 * v] for name, v in TRUTH.items()
    }
    return load_settings("article-mech", changes)


def refitted(settings: FitSettings, log: Log, count: int) -> np.ndarray:
    """Relative spread of refits to noisy logs, shape (P,); the start pose is known from
    standstill."""
    rng, estimates = np.random.default_rng(SEED + 2), []
    for _ in range(count):
        measured = noisy(log, NOISE_DEG, rng)
        total = settings.priors["total mass"].model_copy(
            update={"value": rng.normal(TOTAL, TOTAL_SD)}
        )
        problem = Problem(
            settings.model_copy(update={"priors": {"total mass": total}}), [measured]
        )
        start = THETA * np.exp(rng.uniform(-0.05, 0.05, len(THETA)))
        estimates.append(
            refined(problem, start, RefinementSettings(gain_tolerance=1e-6)) / THETA
        )
    return np.std(estimates, axis=0, ddof=1) if count else np.full(len(THETA), np.nan)


def weakest(sds: Any) -> np.ndarray:
    """Return deviations, shape (..., P), with the largest of them as one more."""
    return np.append(sds, np.max(sds, axis=-1, keepdims=True), axis=-1)


if __name__ == "__main__":
    chosen = {"random": 20, "effort": 220, "fits": 50, "duration": 30.0, "seed": SEED}
    given = options(__doc__, **chosen, without="")
    settings, clock = make_settings(given), Clock()
    estimate = THETA * np.exp(
        np.random.default_rng(SEED).uniform(np.log(0.8), np.log(1.25), len(THETA))
    )
    best = design(settings, estimate, [], given.seed, no_progress)
    print(f"designed in {clock} from {settings.design.effort} experiments", flush=True)
    randoms = [
        one.experiment
        for one in best.random
        if len(one.experiment.inputs) == len(settings.outputs)
    ]
    randoms = randoms[: given.random]

    def response(experiment) -> Log:
        return simulate_log(settings, experiment.log(settings), TRUTH)

    def predicted(experiment) -> np.ndarray:
        return uncertainty(
            Problem(settings, [response(experiment)]), THETA
        ).posterior.deviations

    designed, drawn = best.best.experiment, weakest([predicted(e) for e in randoms])
    # the better of the two in the middle
    middle = np.argsort(drawn[:, -1])[(len(drawn) - 1) // 2]
    two = (
        refitted(settings, response(e), given.fits) for e in (randoms[middle], designed)
    )
    at_random, as_designed = map(weakest, two)
    typical, best_sd = np.median(drawn, axis=0), weakest(predicted(designed))
    columns = (
        100 * sd for sd in (typical, drawn[middle], at_random, best_sd, as_designed)
    )
    title = f"standard deviations [%], {given.duration:g} s, {NOISE_DEG} deg of noise"
    print(
        f"{title}; weakest parameter of the best random one: {100 * drawn[:, -1].min():.3g}"
    )
    table(
        "parameter | random, median of predicted | median random one, predicted | refitted "
        "| designed, predicted | refitted | ratio predicted | ratio refitted",
        "{} | {:.3g} | {:.3g} | {:.3g} | {:.3g} | {:.3g} | {:.1f} | {:.1f}",
        *([*TRUTH, "weakest"], *columns, typical / best_sd, at_random / as_designed),
    )
