"""Models of the real excavator compared within its fit_* logs: each predicts logs that its fit left out.

    python benchmarks/excavator_folds.py [VARIANT ...] [--joints 2 3 4 1] [--folds 4]

Each joint is fitted alone with all that acts on it, pump and masses included. The other joints follow
their logged motion and take their part of the pump. A row costs minutes, not hours, and the six check_* logs
stay unseen. Prints the mean absolute error over whole logs [deg] by joint: on fitted logs, and on others.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import hydroid
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

FOLDER = Path(__file__).parents[1] / "examples" / "excavator"
JOINTS = {2: "boom", 3: "arm", 4: "bucket", 1: "swing"}

COARSE: dict[str, object] = {"simulation.steps_per_sample": 1, "hydraulics.substeps": 8}
"""as the shipped steps to 0.02 deg, in two thirds of the time"""
ENDING = RefinementSettings(iterations=10, gain_tolerance=0.003)


def own(prefix: str, quantity: str, **more: object) -> dict[str, object]:
    """Settings of one more parameter for each joint and side."""
    return {
        f"parameters.{prefix}_{side.upper()}": {"quantity": f"{quantity}_{side}", "each": True, **more}
        for side in "ab"
    }


def notches(within: float) -> dict[str, object]:
    """Settings of four notches for each joint and side."""
    several = (own(f"notch_{k}", f"notch_{k}", within=within) for k in range(1, 5))
    return {key: value for one in several for key, value in one.items()}


BACK, AREA = own("back", "plunger_back", within=4), own("area", "area", within=1.5)
VARIANTS: dict[str, dict[str, object]] = {
    "shipped": {},
    "back": BACK,
    "area": AREA,
    "notches": notches(3),
    "stiff notches": notches(1.5),
    "back, area": BACK | AREA,
    "back, notches": BACK | notches(3),
    "back, stiff notches": BACK | notches(1.5),
    "back, area, stiff notches": BACK | AREA | notches(1.5),
    "friction": {"parameters.F": {"quantity": "dry_friction", "each": True, "nominal": 500, "within": 10}},
}


def lone(joint: int, changes: dict[str, object]) -> FitSettings:
    """Settings under which one joint is fitted alone."""
    alone = {"outputs": [joint], "simulation.other_joints": "measured"} | COARSE
    if joint != 1:
        alone["parameters.D_swing.fixed"] = 20000
    return hydroid.load_settings(FOLDER / "fit.yaml", changes | alone)


def error(settings: FitSettings, logs: Sequence[Log], theta: np.ndarray) -> float:
    """Mean absolute error over whole logs [deg]."""
    problem = Problem(settings, logs)
    residual = problem.residuals(theta[None])[0]
    errors = [residual[c.rows] / c.weight for c in problem.channels]
    return float(np.rad2deg(np.mean(np.abs(np.concatenate(errors)))))


def folded(settings: FitSettings, logs: Sequence[Log], folds: int) -> tuple[float, float, int]:
    """Mean error on fitted and on left-out logs [deg], and the number of free parameters."""
    fitted, left_out, free = [], [], 0
    for fold in range(folds):
        train = [log for i, log in enumerate(logs) if i % folds != fold]
        problem = Problem(settings, train)
        free = int(problem.parameters.free.sum())
        start = problem.theta(np.array([problem.start]))[0]
        point = refine(problem, start, ENDING, lambda simulated, rms: None).point
        theta = problem.parameters.from_unit(point[None])[0]
        fitted.append(error(settings, train, theta))
        left_out.append(error(settings, logs[fold::folds], theta))
    return float(np.mean(fitted)), float(np.mean(left_out)), free


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variants", nargs="*", default=list(VARIANTS), metavar="VARIANT")
    parser.add_argument("--joints", nargs="+", type=int, default=list(JOINTS))
    parser.add_argument("--folds", type=int, default=4)
    arguments = parser.parse_args()
    logs = None
    for name in arguments.variants:
        for joint in arguments.joints:
            settings, began = lone(joint, VARIANTS[name]), time.process_time()
            logs = logs or hydroid.read_logs(sorted(FOLDER.glob("fit_*.csv")), settings)
            found = folded(settings, [log.driving(joint) for log in logs], arguments.folds)
            spent = time.process_time() - began
            row = f"{JOINTS[joint]:>8}{found[2]:4d} free{found[0]:8.2f}{found[1]:8.2f} deg"
            print(f"{name:28}{row}{spent:7.0f} s", flush=True)


if __name__ == "__main__":
    main()
