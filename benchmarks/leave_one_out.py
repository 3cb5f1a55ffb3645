"""Leave-one-out on five logs of the virtual rig's shoulder: expected and actual error on the log left out.

    python benchmarks/leave_one_out.py [--stages hyd mech] [--seconds 15]

Two pieces of each shoulder log in examples/logs, which begin at rests, and one of the log in which six joints
move are the five logs; in all of them the other joints follow their measured motion. The
masses are held at the arm's nominal values, all else is as in the shipped config. The fit to all five logs is
refined without each log in turn and predicts it. "expected" is the rms error that the noise and the
uncertainty of the parameters explain. "pooled" and "by log" are the standard deviations of the parameters.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import hydroid
from hydroid.log import Log
from hydroid.posterior.by_log import by_log
from hydroid.posterior.covariance import uncertainty
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

LOGS = Path(__file__).parents[1] / "examples" / "logs"
CUTS = {"rig_shoulder_1": 2200, "rig_shoulder_2": 3300}
"""samples near the middle at which the logs rest: the second piece begins there"""
CONFIGS = {"hyd": "fit-hyd", "mech": "fit-mech"}


def piece(log: Log, name: str, first: int, seconds: float) -> Log:
    """Return some seconds of a log as a log of its own."""
    samples = slice(first, first + round(seconds / log.period))
    command, angle = log.command[samples], log.angle[samples]
    return replace(log, source=f"{name}.csv", time=log.time[: len(angle)], command=command, angle=angle)


def five_logs(settings: FitSettings, seconds: float) -> list[Log]:
    """Return the five logs of the shoulder."""
    logs: list[Log] = []
    for name, second in CUTS.items():
        (log,) = hydroid.read_logs(LOGS / f"{name}.csv", settings)
        logs += [piece(log, f"{name} from {k}", k, seconds) for k in (0, second)]
    (log,) = hydroid.read_logs(LOGS / "rig_all_joints_1.csv", settings)
    return [*logs, piece(log, "rig_all_joints_1", 0, seconds)]


def study(stage: str, seconds: float) -> None:
    """Fit all five logs, leave each out, and print the tables."""
    changes: dict[str, object] = {"simulation.other_joints": "measured", "search.nsga2.generations": 3}
    changes |= {f"log.joints.{joint}.command": None for joint in (1, 3, 4, 5, 6, 7)}
    nominal = hydroid.load_settings(CONFIGS[stage]).arm.masses
    changes |= {f"parameters.M{i + 1}.fixed": float(nominal[i]) for i in range(6)}
    settings, began = hydroid.load_settings(CONFIGS[stage], changes), time.perf_counter()
    logs = five_logs(settings, seconds)
    model = hydroid.fit(settings, logs).model
    problem = Problem(settings, logs)
    known = uncertainty(problem, model.theta)
    spread = by_log(problem, known)
    assert spread is not None
    print(f"\nstage {stage}, {len(logs)} logs, {time.perf_counter() - began:.0f} s for the fit to all\n")
    print("| left out | expected [deg] | actual [deg] | actual / expected | inside the band |")
    print("| --- | --- | --- | --- | --- |")
    for result in hydroid.validate(logs, fit=model, out=None, leave_one_out=True).result:
        band = result.bands[2]
        expected, actual = np.degrees([band.expected, band.error])
        print(
            f"| {Path(result.log.source).stem} | {expected:.3f} | {actual:.3f} | {actual / expected:.1f} "
            f"| {100 * band.inside:.0f} % |"
        )
    print("\n| parameter | pooled [%] | by log [%] | differs between the logs |")
    print("| --- | --- | --- | --- |")
    for i, name in enumerate(problem.parameters.names):
        if known.free[i]:
            deviations = 100 * known.relative[i], 100 * spread.relative[i]
            differs = "yes" if name in spread.differing else ""
            print(f"| {name} | {deviations[0]:.2f} | {deviations[1]:.2f} | {differs} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--stages", nargs="+", default=["hyd", "mech"], choices=list(CONFIGS))
    parser.add_argument("--seconds", type=float, default=15.0)
    arguments = parser.parse_args()
    for stage in arguments.stages:
        study(stage, arguments.seconds)


if __name__ == "__main__":
    main()
