"""Do the intervals of a first fit of one's own arm hold? The machine of examples/urdf, with other logs.

    python benchmarks/own_arm_coverage.py [--fits 20]

`hydroid init` makes the settings from the example's URDF and logs: three joints, 27 parameters that trade,
oil that cavitates. Each fit takes two new logs of the example's machine, with commands and noise of their own
(0.05 deg, white). The refinement starts at the truth times random factors within 5 %: this is a study of the
intervals, not of the search. "predicted / spread" is the mean standard deviation over the root of the mean
square error. The machine's delays are 0, where the bound is: they have no interval.
"""

import importlib
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from common import EXAMPLES, Clock, Coverage, near, options, refined, row, table

import hydroid
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.posterior.covariance import uncertainty
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

EXAMPLE = EXAMPLES / "urdf"
sys.path.insert(0, str(EXAMPLE))
example: Any = importlib.import_module("make_example")


def machine(folder: Path) -> IdentifiedModel:
    """Return the example's machine, in the settings of a project that has not seen its logs."""
    hydroid.init(folder, arm=EXAMPLE / "robot.urdf")
    at = hydroid.start_values(hydroid.load_settings(folder / "fit.yaml", {"log.period_s": example.PERIOD}))
    factors = {n: next((f for s, f in example.TRUTH.items() if n.startswith(s)), 1.0) for n in at.values}
    return identified(at.settings, {n: v * factors[n] for n, v in at.values.items()}, "the machine")


def new_log(truth: IdentifiedModel, seed: int) -> Log:
    """Return a log of the machine, with its own commands and noise."""
    arm, period = truth.settings.arm, example.PERIOD
    command = example.commands(len(arm.joints), seed)
    angle = np.tile(0.5 * (arm.lower + arm.upper), (len(command), 1))
    drive = Log("log", period * np.arange(len(command)), command, angle, period)
    return hydroid.simulate(drive, fit=truth, out=None, noise_deg=example.NOISE_DEG, seed=seed).log


def study(truth: IdentifiedModel, settings: FitSettings, fits: int) -> None:
    """Fit as many pairs of logs of the machine, and print the table."""
    names, clock = np.array(settings.parameter_set().names), Clock()
    true = np.array([truth.values[name] for name in names])
    inner = true > 0
    fitted: list[tuple[np.ndarray, ...]] = []
    for number in range(fits):
        problem = Problem(settings, [new_log(truth, 1000 + 2 * number + k) for k in (0, 1)])
        theta, _ = refined(problem, near(problem, true, np.random.default_rng(number)))
        known = uncertainty(problem, theta)
        fitted.append((theta[inner], known.standard_deviation[inner], known.interval[inner]))
    print(f"{fits} fits, {clock}")
    seen = Coverage(true[inner], fitted)
    hits = np.where(np.isnan(seen.intervals).any(axis=2), np.nan, seen.hits)
    error = np.sqrt(np.mean(np.square(seen.values - seen.truth), axis=0))
    predicted = np.mean(seen.sds, axis=0)
    table(
        "parameter | truth | predicted sd [%] | predicted / spread | covered",
        "{} | {:.4g} | {:.2f} | {:.2f} | {:.0f} %",
        *(names[inner], seen.truth, 100 * predicted / seen.truth, predicted / error),
        100 * np.nanmean(hits, axis=0),
    )
    row(f"all | | | {np.median(predicted / error):.2f} | {100 * np.nanmean(hits):.1f} %")


if __name__ == "__main__":
    given = options(__doc__, fits=20)
    with tempfile.TemporaryDirectory() as place:
        truth = machine(Path(place) / "machine")
        logs: list[str | Path] = [EXAMPLE / f"log_{number}.csv" for number in (1, 2, 3)]
        hydroid.init(Path(place) / "mine", arm=EXAMPLE / "robot.urdf", log=logs)
        study(truth, hydroid.load_settings(Path(place) / "mine" / "fit.yaml"), given.fits)
