"""Leave-one-out on five logs of the virtual rig's shoulder: expected and actual error on the log left out.

    python benchmarks/leave_one_out.py [--stages hyd mech] [--seconds 15]

Two pieces of each shoulder log in examples/logs, which begin at rests, and one of the log in which six joints
move are the five logs; in all of them the other joints follow their measured motion. The
masses are held at the arm's nominal values, all else is as in the shipped config. The fit to all five logs is
refined without each log in turn and predicts it. "expected" is the rms error that the noise and the
uncertainty of the parameters explain. "pooled" and "by log" are the standard deviations of the parameters.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from common import EXAMPLES, Clock, named, options, row, table

import hydroid
from hydroid.log import Log
from hydroid.posterior.by_log import by_log
from hydroid.posterior.covariance import uncertainty
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

LOGS = EXAMPLES / "logs"
PIECES = [("rig_shoulder_1", 0), ("rig_shoulder_1", 2200), ("rig_shoulder_2", 0), ("rig_shoulder_2", 3300)]
PIECES += [("rig_all_joints_1", 0)]
"""logs, and the samples at which they rest where a piece begins"""


def piece(settings: FitSettings, name: str, first: int, seconds: float) -> Log:
    """Return some seconds of a log as a log of its own."""
    (log,) = hydroid.read_logs([LOGS / f"{name}.csv"], settings)
    part = slice(first, first + round(seconds / log.period))
    command, angle = log.command[part], log.angle[part]
    source = f"{name} from {first}.csv"
    return replace(log, source=source, time=log.time[: len(angle)], command=command, angle=angle)


def study(stage: str, seconds: float) -> None:
    """Fit all five logs, leave each out, and print the tables."""
    changes: dict[str, object] = {"simulation.other_joints": "measured", "search.nsga2.generations": 3}
    changes |= {f"log.joints.{joint}.command": None for joint in (1, 3, 4, 5, 6, 7)}
    nominal = hydroid.load_settings(f"fit-{stage}").arm.masses
    changes |= {f"parameters.M{i + 1}.fixed": float(nominal[i]) for i in range(6)}
    settings, clock = hydroid.load_settings(f"fit-{stage}", changes), Clock()
    logs = [piece(settings, name, first, seconds) for name, first in PIECES]
    model = hydroid.fit(settings, logs).model
    problem = Problem(settings, logs)
    known = uncertainty(problem, model.theta)
    spread = by_log(problem, known)
    assert spread is not None
    print(f"\nstage {stage}, {len(logs)} logs, {clock} for the fit to all")
    table("left out | expected [deg] | actual [deg] | actual / expected | inside the band")
    for result in hydroid.validate(logs, fit=model, out=None, leave_one_out=True).result:
        band = result.bands[2]
        errors = f"{np.degrees(band.expected):.3f} | {np.degrees(band.error):.3f}"
        ratio = f"{band.error / band.expected:.1f}"
        row(f"{Path(result.log.source).stem} | {errors} | {ratio} | {100 * band.inside:.0f} %")
    names, sds = named(problem.parameters.names, known.free), (known.relative, spread.relative)
    table(
        "parameter | pooled [%] | by log [%] | differs between the logs",
        "{} | {:.2f} | {:.2f} | {}",
        *(names, *(100 * sd[known.free] for sd in sds)),
        ["yes" if name in spread.differing else "" for name in names],
    )


if __name__ == "__main__":
    given = options(__doc__, stages=["hyd", "mech"], seconds=15.0)
    for stage in given.stages:
        study(stage, given.seconds)
