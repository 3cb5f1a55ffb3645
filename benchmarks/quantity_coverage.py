"""Do intervals of quantities hold where no parameter is known? Stage 2 on simulated logs with known truth.

    python benchmarks/quantity_coverage.py [--logs 40] [--seconds 20]

The article's ten hydraulic parameters of the shoulder are all free: F1, F2, x1 and x2 act through two
numbers, and a common scale of I_max and I_min trades with them. So three directions are exactly
unidentifiable, and the parameters in them have no interval. Noise, start and first sample are those of
interval_coverage.py. A quantity is covered where its 95 % interval holds its value at the true parameters,
which the same test movements give.
"""

import numpy as np
from common import Clock, Coverage, named, near, noisy, options, refined, row, table, true_log

from hydroid import load_settings
from hydroid.posterior.bench import make_bench
from hydroid.posterior.covariance import uncertainty
from hydroid.posterior.quantities import joint_measure
from hydroid.problem.problem import Problem

TRUTH = {"A_A": 1000.0, "A_B": 750.0, "I_max": 0.9, "I_min": 0.3, "A": 1.4, "C": 1.2}
TRUTH |= {"F1": 8.0, "F2": 0.7, "x1": 0.8, "x2": 12.0}
CHANGES = {f"parameters.{name}.fixed": None for name in ("F1", "x1", "x2")}
CHANGES |= {"hydraulics.overlap_a": 0.4, "hydraulics.overlap_b": 0.3, "refinement.gain_tolerance": 1e-6}
"""the overlaps make a dead band; the article's model has none"""


def study(logs: int, seconds: float) -> None:
    """Fit every log, and print how often each quantity's interval holds the truth."""
    settings, clock = load_settings("article-hyd", CHANGES), Clock()
    clean = true_log(settings, TRUTH, [2], seconds)
    problem = Problem(settings, [clean])
    truth, free = problem.parameters.vector(TRUTH, "truth"), problem.parameters.free
    # planned at the truth once: every fit then states the same quantities
    measure = joint_measure(make_bench(settings, [clean], 2), problem.bindings.candidates(truth[None]))
    columns, actual = zip(*measure(problem.bindings.candidates(truth[None])), strict=True)
    labels = np.array([f"{c.label}{f' at {c.at:.0f}' if c.along else ''} [{c.unit}]" for c in columns])
    positive = np.array([column.positive for column in columns])

    def values(theta: np.ndarray) -> np.ndarray:
        return np.stack([value for _, value in measure(problem.bindings.candidates(theta))], axis=1)

    fits, unknown = [], []
    for seed in range(logs):
        rng = np.random.default_rng(seed)
        one = Problem(settings, [noisy(clean, rng)])
        theta, _ = refined(one, near(one, truth, rng))
        result = uncertainty(one, theta)
        known = result.posterior.propagate(values, positive)
        fits.append((known.value, known.sd, known.interval))
        unknown.append(~np.isfinite(result.relative[free]))
    print(f"{logs} logs of {seconds:g} s, {clock}")
    shares = zip(named(problem.parameters.names, free), np.mean(unknown, axis=0), strict=True)
    print("not identifiable in:", ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares))
    seen = Coverage(np.array([float(value[0]) for value in actual]), fits)
    spread, sd, finite = seen.spread, seen.sds, np.isfinite(seen.sds)
    stated = np.any(finite & (sd > 0), axis=0)

    def mean(of: np.ndarray) -> np.ndarray:
        """Over the fits that determine a quantity."""
        return np.sum(of, axis=0, where=finite)[stated] / np.sum(finite, axis=0)[stated]

    bias = (np.mean(seen.values, axis=0) - seen.truth) / np.where(spread > 0, spread, 1.0)
    table(
        "quantity | true | covered | spread [%] | predicted / spread | bias / spread | determined",
        "{} | {:.4g} | {:.1f} % | {:.2f} | {:.2f} | {:.2f} | {:.0f} %",
        *(labels[stated], seen.truth[stated], 100 * mean(seen.hits)),
        *(100 * (spread / abs(seen.truth))[stated], mean(sd) / spread[stated], bias[stated]),
        100 * np.mean(finite, axis=0)[stated],
    )
    row("all", "", f"{100 * np.mean(seen.hits[:, stated]):.1f} %", "", "", "", "")


if __name__ == "__main__":
    given = options(__doc__, logs=40, seconds=20.0)
    study(given.logs, given.seconds)
