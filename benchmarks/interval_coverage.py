"""Do the intervals hold? 95 % intervals of 200 simulated logs with known truth, white and coloured noise.

    python benchmarks/interval_coverage.py [--logs 200] [--seconds 20] [--noisy-start]

Shoulder and elbow are driven and measured, the other joints locked; K, D, S (shared by both), M2 and M6 are
free, M1, M3, M4 and M5 held as if weighed: from these angles all five are determined. The noise of 0.1 deg
is white, or a first-order autoregression with a correlation time of 0.15 s; each fit estimates it from its
own residual. The refinement starts at the truth times random factors within 5 %: this is a study of the
intervals, not of the search. The first sample is the start pose and has no noise, unless --noisy-start. The
Cramér-Rao bound is that of the true noise at the true parameters.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from pseudo_random import pseudo_random_log

from hydroid import load_settings
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.uncertainty.covariance import uncertainty
from hydroid.uncertainty.jacobian import jacobian
from hydroid.uncertainty.noise import Noise

LEVEL = np.deg2rad(0.1)
CORRELATION_TIME = 0.15  # [s]
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


def bound(problem: Problem, truth: np.ndarray, phi: float) -> np.ndarray:
    """The Cramér-Rao bound of each free parameter's standard deviation, for the true noise."""
    at, free = jacobian(problem, truth), problem.parameters.free
    information = 0.0
    for channel in problem.channels:
        noise = Noise(len(channel.measured), LEVEL, np.array([-phi] if phi else []), "settings")
        white = noise.whitened(at.slopes[free][:, channel.rows])
        information = information + white @ white.T
    return np.sqrt(np.diag(np.linalg.inv(information))) * at.scale[free]


def study(phi: float, logs: int, seconds: float, *, start: bool) -> None:
    """Fit every log, and print how often each parameter's interval holds the truth."""
    settings = load_settings("article-mech", CHANGES)

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(settings, log, TRUTH, "truth").angle
        return bool(np.all(angle > settings.arm.lower + 0.05) and np.all(angle < settings.arm.upper - 0.05))

    drive = pseudo_random_log(
        settings.arm.pose("study"), JOINTS, duration=seconds, seed=3, allowed=off_the_stops
    )
    clean = simulate_log(settings, drive, TRUTH, "truth")
    problem = Problem(settings, [clean])
    truth, free = problem.parameters.vector(TRUTH, "truth"), problem.parameters.free
    least = bound(problem, truth, phi)
    estimates, deviations, hits = [], [], []
    started = time.perf_counter()
    assert settings.refinement is not None
    for seed in range(logs):
        rng = np.random.default_rng([seed, int(1000 * phi)])
        one = Problem(settings, [with_noise(clean, phi, rng, start=start)])
        first = truth * np.where(free, rng.uniform(0.95, 1.05, len(truth)), 1.0)
        found = refine(one, first, settings.refinement, lambda n, rms: None)
        theta = one.parameters.from_unit(found.point[None])[0]
        told = uncertainty(one, theta)
        estimates.append(theta[free])
        deviations.append(told.standard_deviation[free])
        hits.append((told.interval[free, 0] <= truth[free]) & (truth[free] <= told.interval[free, 1]))
    spread = np.std(estimates, axis=0, ddof=1)
    kind = f"AR(1), correlation time {CORRELATION_TIME} s" if phi else "white"
    print(f"\n{kind} noise, {logs} logs of {seconds:g} s, {time.perf_counter() - started:.0f} s", end="")
    print(", the start pose with noise" if start else "")
    print("\n| parameter | covered | spread [%] | spread / bound | predicted / spread |")
    print("| --- | --- | --- | --- | --- |")
    names = [n for n, is_free in zip(problem.parameters.names, free, strict=True) if is_free]
    cover, said = np.mean(hits, axis=0), np.mean(deviations, axis=0)
    for i, name in enumerate(names):
        print(
            f"| {name} | {100 * cover[i]:.1f} % | {100 * spread[i] / truth[free][i]:.3f} "
            f"| {spread[i] / least[i]:.2f} | {said[i] / spread[i]:.2f} |"
        )
    print(
        f"| all | {100 * np.mean(hits):.1f} % | | {np.mean(spread / least):.2f} "
        f"| {np.mean(said / spread):.2f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--noisy-start", action="store_true")
    arguments = parser.parse_args()
    for phi in (0.0, float(np.exp(-0.01 / CORRELATION_TIME))):
        study(phi, arguments.logs, arguments.seconds, start=arguments.noisy_start)


if __name__ == "__main__":
    main()
