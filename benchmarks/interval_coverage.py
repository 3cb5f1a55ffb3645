"""Do the intervals hold? 95 % intervals of 200 simulated logs with known truth, white and slow noise.

    python benchmarks/interval_coverage.py [--logs 200] [--seconds 20 75] [--correlation-times 0 0.15 1 4]
                                           [--noisy-start] [--free-start]

Shoulder and elbow are driven and measured, the other joints locked; K, D, S (shared by both), M2 and M6 are
free, M1, M3, M4 and M5 held as if weighed: from these angles all five are determined. The noise of 0.1 deg
is white, or a first-order autoregression of a correlation time; each fit estimates it from its own residual.
The refinement starts at the truth times random factors within 5 %: this is a study of the intervals, not of
the search. The first sample is the start pose and has no noise, unless --noisy-start; with --free-start the
fits leave it open. "width" is the mean width of the intervals, divided by that of 95 % intervals for the true
noise. "bound" is the Cramér-Rao bound of the true noise at the true parameters. Both are of a known start.
"""

from dataclasses import replace

import numpy as np
from common import Clock, Coverage, named, near, noisy, options, refined, table, true_log
from scipy.linalg import solve_toeplitz

from hydroid import load_settings
from hydroid.posterior.covariance import quantile, uncertainty, uncertainty_from
from hydroid.posterior.jacobian import Jacobian, jacobian
from hydroid.posterior.noise import Noise
from hydroid.problem.problem import Problem

JOINTS = [2, 3]
TRUTH = {"K": 1.0, "D": 60.0, "S": 100.0, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
"""masses as in the article; K, D, S are ours: with the article's the arm is too slow to feel its masses"""
CHANGES = {
    "outputs": JOINTS,
    "simulation.other_joints": "locked",
    **{f"parameters.{name}.bounds": [0.2 * TRUTH[name], 5 * TRUTH[name]] for name in ("K", "D", "S")},
    **{f"parameters.{name}.fixed": TRUTH[name] for name in ("M1", "M3", "M4", "M5")},
    "refinement.gain_tolerance": 1e-6,
}


def bound(problem: Problem, at: Jacobian, noise: tuple[Noise, ...]) -> np.ndarray:
    """The Cramér-Rao bound of each free parameter's standard deviation, for the true noise."""
    free, information = problem.parameters.free, 0.0
    for channel, process in zip(problem.channels, noise, strict=True):
        slopes = at.slopes[free][:, channel.rows]
        information = information + slopes @ solve_toeplitz(process.autocovariance, slopes.T)
    return np.sqrt(np.diag(np.linalg.inv(information))) * at.scale[free]


def study(correlation_time: float, logs: int, seconds: float, *, start: bool, open_start: bool) -> None:
    """Fit every log, and print how often each parameter's interval holds the truth."""
    settings, clock = load_settings("article-mech", CHANGES | {"free_start": open_start}), Clock()
    clean = true_log(settings, TRUTH, JOINTS, seconds)
    phi = float(np.exp(-clean.period / correlation_time)) if correlation_time else 0.0
    problem = Problem(settings.model_copy(update={"free_start": False}), [clean])
    truth, free = problem.parameters.vector(TRUTH, "truth"), problem.parameters.free
    at, true = jacobian(problem, truth), Noise(len(clean.time), np.deg2rad(0.1), np.array([-phi] * bool(phi)))
    noise = (replace(true, source="settings"),) * len(problem.channels)
    least = bound(problem, at, noise)
    width = 2 * quantile(0.0) * uncertainty_from(problem, truth, at, noise).standard_deviation[free]
    fits: list[tuple[np.ndarray, ...]] = []
    for seed in range(logs):
        rng = np.random.default_rng([seed, int(1000 * phi)])
        one = Problem(settings, [noisy(clean, rng, phi=phi, start=start)])
        theta, _ = refined(one, near(one, truth, rng))
        result = uncertainty(one, theta)
        fits.append((theta[free], result.standard_deviation[free], result.interval[free]))
    seen = Coverage(truth[free], fits)
    kind = f"correlation time {correlation_time:g} s" if phi else "white noise"
    print(f"\n{kind}, {logs} logs of {seconds:g} s, {clock}{', the start pose with noise' * start}")
    columns = np.array(
        [
            100 * np.mean(seen.hits, axis=0),
            np.mean(np.diff(seen.intervals, axis=2)[:, :, 0], axis=0) / width,
            100 * seen.spread / truth[free],
            seen.spread / least,
            np.mean(seen.sds, axis=0) / seen.spread,
        ]
    )
    table(
        "parameter | covered | width | spread [%] | spread / bound | predicted / spread",
        "{} | {:.1f} % | {:.2f} | {:.3f} | {:.2f} | {:.2f}",
        *(
            [*named(problem.parameters.names, free), "mean"],
            *np.column_stack([columns, columns.mean(axis=1)]),
        ),
    )


if __name__ == "__main__":
    times = [0.0, 0.15, 1.0, 4.0]
    flags = {"noisy_start": False, "free_start": False}
    given = options(__doc__, logs=200, seconds=[20.0, 75.0], correlation_times=times, **flags)
    for seconds in given.seconds:
        for time in given.correlation_times:
            study(time, given.logs, seconds, start=given.noisy_start, open_start=given.free_start)
