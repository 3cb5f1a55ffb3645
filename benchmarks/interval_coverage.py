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

import argparse
import time
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_toeplitz

from hydroid import load_settings
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.posterior.covariance import quantile, uncertainty, uncertainty_from
from hydroid.posterior.jacobian import Jacobian, jacobian
from hydroid.posterior.noise import Noise
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

LEVEL = np.deg2rad(0.1)
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


def with_noise(log: Log, phi: float, rng: np.random.Generator, *, start: bool) -> Log:
    """Add stationary noise of LEVEL to every angle, white (phi 0) or AR(1)."""
    noise = rng.normal(0.0, LEVEL, log.angle.shape)
    for i in range(1, len(noise)):
        noise[i] = phi * noise[i - 1] + np.sqrt(1 - phi**2) * noise[i]
    if not start:
        noise[0] = 0.0
    return replace(log, angle=log.angle + noise)


def bound(problem: Problem, at: Jacobian, noise: tuple[Noise, ...]) -> np.ndarray:
    """The Cramér-Rao bound of each free parameter's standard deviation, for the true noise."""
    free, information = problem.parameters.free, 0.0
    for channel, process in zip(problem.channels, noise, strict=True):
        slopes = at.slopes[free][:, channel.rows]
        information = information + slopes @ solve_toeplitz(process.autocovariance, slopes.T)
    return np.sqrt(np.diag(np.linalg.inv(information))) * at.scale[free]


def clean_log(settings: FitSettings, seconds: float) -> Log:
    """Return the response of the true arm to pseudo-random commands that keep it off its stops."""

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(settings, log, TRUTH, "truth").angle
        return bool(np.all(angle > settings.arm.lower + 0.05) and np.all(angle < settings.arm.upper - 0.05))

    pose = settings.arm.pose("study")
    drive = pseudo_random_log(pose, JOINTS, duration=seconds, seed=3, allowed=off_the_stops)
    return simulate_log(settings, drive, TRUTH, "truth")


def study(correlation_time: float, logs: int, seconds: float, *, start: bool, open_start: bool) -> None:
    """Fit every log, and print how often each parameter's interval holds the truth."""
    settings = load_settings("article-mech", CHANGES | {"free_start": open_start})
    clean = clean_log(settings, seconds)
    phi = float(np.exp(-clean.period / correlation_time)) if correlation_time else 0.0
    problem = Problem(settings.model_copy(update={"free_start": False}), [clean])
    truth, free = problem.parameters.vector(TRUTH, "truth"), problem.parameters.free
    at, true = jacobian(problem, truth), Noise(len(clean.time), LEVEL, np.array([-phi] if phi else []))
    true = (replace(true, source="settings"),) * len(problem.channels)
    least = bound(problem, at, true)
    known = 2 * quantile(0.0) * uncertainty_from(problem, truth, at, true).standard_deviation[free]
    estimates, deviations, widths, hits = [], [], [], []
    started = time.perf_counter()
    assert settings.refinement is not None
    for seed in range(logs):
        rng = np.random.default_rng([seed, int(1000 * phi)])
        one = Problem(settings, [with_noise(clean, phi, rng, start=start)])
        first = truth * np.where(free, rng.uniform(0.95, 1.05, len(truth)), 1.0)
        found = refine(one, first, settings.refinement)
        theta = one.parameters.from_unit(found.point)
        result = uncertainty(one, theta)
        estimates.append(theta[free])
        deviations.append(result.standard_deviation[free])
        widths.append(np.diff(result.interval[free], axis=1)[:, 0])
        hits.append((result.interval[free, 0] <= truth[free]) & (truth[free] <= result.interval[free, 1]))
    spread = np.std(estimates, axis=0, ddof=1)
    kind = f"correlation time {correlation_time:g} s" if phi else "white noise"
    print(f"\n{kind}, {logs} logs of {seconds:g} s, {time.perf_counter() - started:.0f} s", end="")
    print(", the start pose with noise" if start else "")
    print("\n| parameter | covered | width | spread [%] | spread / bound | predicted / spread |")
    print("| --- | --- | --- | --- | --- | --- |")
    names = [n for n, is_free in zip(problem.parameters.names, free, strict=True) if is_free]
    cover, predicted, width = (np.mean(x, axis=0) for x in (hits, deviations, widths))
    for i, name in enumerate(names):
        print(
            f"| {name} | {100 * cover[i]:.1f} % | {width[i] / known[i]:.2f} "
            f"| {100 * spread[i] / truth[free][i]:.3f} | {spread[i] / least[i]:.2f} "
            f"| {predicted[i] / spread[i]:.2f} |"
        )
    print(
        f"| all | {100 * np.mean(hits):.1f} % | {np.mean(width / known):.2f} | "
        f"| {np.mean(spread / least):.2f} | {np.mean(predicted / spread):.2f} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seconds", type=float, nargs="+", default=[20.0, 75.0])
    parser.add_argument("--correlation-times", type=float, nargs="+", default=[0.0, 0.15, 1.0, 4.0])
    parser.add_argument("--noisy-start", action="store_true")
    parser.add_argument("--free-start", action="store_true")
    arguments = parser.parse_args()
    for seconds in arguments.seconds:
        for correlation_time in arguments.correlation_times:
            study(
                correlation_time,
                arguments.logs,
                seconds,
                start=arguments.noisy_start,
                open_start=arguments.free_start,
            )


if __name__ == "__main__":
    main()
