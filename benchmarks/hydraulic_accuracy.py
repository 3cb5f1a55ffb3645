"""How exact and how stable the hydraulics are over the whole search space (takes minutes).

1. One joint against Radau (rtol 1e-8) of the full coupled equations: feasible parameter sets drawn from 0.25
   to 2.5 times the article's values, 30 s of pseudo-random pulses, several sub-steps and MuJoCo steps.
2. The seven-joint arm, all joints driven at once, every actuator with its own random set: 1,000 candidates.

    python benchmarks/hydraulic_accuracy.py [SETS] [MEMBERS]    ("0 1000": stability alone)
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

from hydraulic_arm import DrivenArm, nominal, scatter
from hydraulic_reference import draw, parameters, pulses, reference, simulate

from hydroid.settings.arm import load_arm
from hydroid.settings.hydraulics import HydraulicSettings

STEPS = [(1, 1), (1, 2), (1, 3), (1, 4), (1, 5), (1, 10), (2, 4), (4, 4)]


def accuracy(sets: int) -> None:
    rng = np.random.default_rng(1)
    command = pulses(rng, 3000)
    candidates = parameters(HydraulicSettings(), **draw(rng, sets))
    began = time.perf_counter()
    exact, pressure = zip(*(reference(candidates[i : i + 1], command) for i in range(sets)), strict=True)  # pyright: ignore[reportArgumentType]
    took = time.perf_counter() - began
    angle, bar = np.degrees(exact), 1e-5 * np.array(pressure)
    print(
        f"{sets} sets, 30 s, joint from {angle.min():.0f} to {angle.max():.0f} deg; Radau took {took:.0f} s"
    )
    print("MuJoCo steps | sub-steps | median rms | worst rms | median max | worst max [deg] | p rms [bar]")
    for steps, substeps in STEPS:
        seen: list = []
        out = simulate(candidates, command, HydraulicSettings(substeps=substeps), steps, seen)
        error = np.degrees(out) - angle
        rms, worst = np.sqrt((error**2).mean(axis=1)), abs(error).max(axis=1)
        p = 1e-5 * np.stack([o.pressure[:, 0] for o, _ in seen], axis=1)
        p_rms = np.median(np.sqrt(((p - bar[:, 1:]) ** 2).mean(axis=(1, 2))))
        row = np.median(rms), rms.max(), np.median(worst), worst.max(), p_rms
        print(f"{steps:12d} | {substeps:9d} | " + " | ".join(f"{value:10.4f}" for value in row))


def stability(candidates: int) -> None:
    arm, settings, rng = load_arm("hydrolek"), HydraulicSettings(), np.random.default_rng(2)
    joints = list(range(7))
    command = np.stack([pulses(rng, 3000) for _ in joints], axis=1)
    command[-200:] = 0.0
    diverged, fastest, last = 0, np.zeros(7), np.zeros(7)
    for first in range(0, candidates, 100):
        count = min(100, candidates - first)
        driven = DrivenArm(arm, scatter(nominal(arm, settings, count), rng), command, settings, threads=2)
        speed = abs(np.diff(driven.run(), axis=1)) / 0.01
        diverged += int((~np.isfinite(speed).all(axis=(1, 2))).sum())
        fastest = np.maximum(fastest, np.nanmax(speed, axis=(0, 1)))
        last = np.maximum(last, np.nanmax(speed[:, -50:], axis=(0, 1)))
    print(f"{candidates} random parameter sets, seven joints driven at once, 30 s: {diverged} diverged")
    print(f"fastest [rad/s] {fastest.round(2)}, after 1.5 s of rest {last.round(3)}")


if __name__ == "__main__":
    sets, candidates = (int(number) for number in (sys.argv[1:] + ["24", "1000"][len(sys.argv) - 1 :]))
    if sets:
        accuracy(sets)
    if candidates:
        stability(candidates)
