"""Models of the real excavator compared within its fit_* logs: each predicts logs that its fit left out.

    python benchmarks/excavator_folds.py [VARIANT ...] [--joints 2 3 4 1]

Each joint is fitted alone with all that acts on it, pump and masses included. The other joints follow
their logged motion and take their part of the pump. Four times, three neighbouring logs of the twelve are
left out; neighbours, because the trajectories change little from log to log. From the fit to all logs, one
Gauss-Newton step leads to the estimate without the rows of these three, which are then simulated. So a row
costs a minute, and the six check_* logs stay unseen. Prints the mean absolute error over whole logs [deg] by
joint: on fitted logs, and on those left out.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.optimize import lsq_linear

import hydroid
from hydroid.fitting.refinement import refine
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings
from hydroid.uncertainty.noise import prior_weight

FOLDER = Path(__file__).parents[1] / "examples" / "excavator"
JOINTS = {2: "boom", 3: "arm", 4: "bucket", 1: "swing"}
FOLDS = 4
COARSE: dict[str, object] = {"simulation.steps_per_sample": 1, "hydraulics.substeps": 8}
"""as the shipped steps to 0.02 deg, in two thirds of the time"""
ENDING = RefinementSettings(iterations=10, gain_tolerance=0.003)
DIFFERENCE = 1e-3
"""of the derivatives, in the unit box of the parameters"""
STEPS = (1.0, 0.6, 0.3)
"""parts of the Gauss-Newton step, of which the one that fits the kept logs best counts"""


def own(prefix: str, quantity: str, **more: object) -> dict[str, object]:
    """Settings of one more parameter for each joint and side."""
    return {
        f"parameters.{prefix}_{side.upper()}": {"quantity": f"{quantity}_{side}", "each": True, **more}
        for side in "ab"
    }


def merged(several: list[dict[str, object]]) -> dict[str, object]:
    """One mapping of all settings."""
    return {key: value for one in several for key, value in one.items()}


NOTCHES = merged([own(f"notch_{k}", f"notch_{k}", within=3) for k in range(1, 5)])
OVERLAPS = own("over", "overlap", nominal=0.2, within=4)
NO_NOTCHES: dict[str, object] = {f"parameters.notch_{k}_{s}.fixed": 1 for k in range(1, 5) for s in "AB"}
NO_OVERLAP: dict[str, object] = {f"parameters.over_{s}.fixed": 0 for s in "AB"}
PLAIN = NO_NOTCHES | NO_OVERLAP
FLAT: dict[str, object] = merged(
    [
        {f"parameters.exponent_{side}.{key}": value for side in "AB"}
        for key, value in {"nominal": 1.3, "within": 1.6, "bounds": [1, 3], "start": 1.1}.items()
    ]
)
NO_FRICTION: dict[str, object] = {"parameters.F_swing.fixed": 0}
VARIANTS: dict[str, dict[str, object]] = {
    "shipped": {},
    "no notches, no overlap": PLAIN,
    "the same, exponents near 1.3": PLAIN | FLAT | NO_FRICTION,
    "notches everywhere": NOTCHES | NO_OVERLAP,
    "overlaps everywhere": NO_NOTCHES | OVERLAPS,
    "plungers return slower": PLAIN | own("back", "plunger_back", within=4),
    "areas": PLAIN | own("area", "area", within=1.5),
}


def lone(joint: int, changes: dict[str, object]) -> FitSettings:
    """Settings under which one joint is fitted alone, with what it shares with others."""
    settings = hydroid.load_settings(FOLDER / "fit.yaml", changes | COARSE)
    parameters = settings.parameters.copy()
    for name, start in zip(parameters, settings.parameter_set().start, strict=True):
        if parameters[name].joints not in (None, (joint,)):
            parameters[name] = parameters[name].model_copy(update={"fixed": float(start)})
    simulation = settings.simulation.model_copy(update={"other_joints": "measured"})
    return settings.model_copy(
        update={"parameters": parameters, "outputs": (joint,), "simulation": simulation}
    )


def compared(settings: FitSettings, joint: int) -> tuple[float, float, int]:
    """Mean error on fitted and on left-out logs [deg], and the number of free parameters."""
    logs = hydroid.read_logs(sorted(FOLDER.glob("fit_*.csv")), settings)
    problem = Problem(settings, [log.driving(joint) for log in logs])
    begin = problem.theta(np.array([problem.start]))[0]
    unit = refine(problem, begin, ENDING, lambda simulated, rms: None).point

    def errors(at: np.ndarray) -> np.ndarray:
        row = problem.residuals(problem.parameters.from_unit(at[None]))[0]
        return np.rad2deg([np.abs(row[c.rows] / c.weight).mean() for c in problem.channels])

    change = np.where(unit > 0.5, -DIFFERENCE, DIFFERENCE)
    theta = problem.parameters.from_unit(np.vstack([unit, unit + np.diag(change)]))
    residuals = problem.residuals(theta)
    weight = prior_weight(problem.channels, residuals[0], settings.objective)
    scores = weight * problem.priors.scores(theta)
    slope, prior_slope = (((r[1:] - r[0]) / change[:, None]).T for r in (residuals, scores))
    left_out = np.empty(len(logs))
    for out in np.array_split(np.arange(len(logs)), FOLDS):
        kept = np.concatenate([np.r_[c.rows] for c in problem.channels if c.log not in out])
        rows = np.concatenate([residuals[0, kept], scores[0]])
        bounds = -unit - 1e-12, 1 - unit + 1e-12
        step = lsq_linear(np.vstack([slope[kept], prior_slope]), -rows, bounds=bounds).x
        tried = [errors(unit + part * step) for part in STEPS]
        best = min(tried, key=lambda e: np.delete(e, out).mean())
        left_out[out] = best[out]
    return float(errors(unit).mean()), float(left_out.mean()), len(unit)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variants", nargs="*", default=list(VARIANTS), metavar="VARIANT")
    parser.add_argument("--joints", nargs="+", type=int, default=list(JOINTS))
    arguments = parser.parse_args()
    for name in arguments.variants:
        for joint in arguments.joints:
            began = time.process_time()
            fitted, left_out, free = compared(lone(joint, VARIANTS[name]), joint)
            row = f"{JOINTS[joint]:>8}{free:4d} free{fitted:8.2f}{left_out:8.2f} deg"
            print(f"{name:28}{row}{time.process_time() - began:7.0f} s", flush=True)


if __name__ == "__main__":
    main()
