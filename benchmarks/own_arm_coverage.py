"""Do the intervals of a first fit of one's own arm hold? The machine of examples/urdf, with other logs.

    python benchmarks/own_arm_coverage.py [--fits 20]

`hydroid init` makes the settings from the example's URDF and logs: three joints, 27 parameters that trade,
oil that cavitates. Each fit takes two new logs of the example's machine, with commands and noise of their own
(0.05 deg, white). The refinement starts at the truth times random factors within 5 %: this is a study of the
intervals, not of the search. "predicted / spread" is the mean standard deviation over the root of the mean
square error. The machine's delays are 0, where the bound is: they have no interval.
"""

import argparse
import importlib.util
import tempfile
import time
from pathlib import Path

import numpy as np

import hydroid
from hydroid.fitting.refinement import refine
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.posterior.covariance import uncertainty
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

EXAMPLE = Path(__file__).parents[1] / "examples" / "urdf"
SPEC = importlib.util.spec_from_file_location("make_example", EXAMPLE / "make_example.py")
assert SPEC is not None
assert SPEC.loader is not None
example = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(example)


def machine(folder: Path) -> IdentifiedModel:
    """Return the example's machine, in the settings of a project that has not seen its logs."""
    hydroid.init(folder, arm=EXAMPLE / "robot.urdf")
    at = hydroid.start_values(hydroid.load_settings(folder / "fit.yaml", {"log.period_s": example.PERIOD}))
    factors = {n: next((f for s, f in example.TRUTH.items() if n.startswith(s)), 1.0) for n in at.values}
    return identified(at.settings, {n: v * factors[n] for n, v in at.values.items()}, "the machine")


def seen(truth: IdentifiedModel, seed: int) -> Log:
    """Return a log of the machine, with its own commands and noise."""
    arm, period = truth.settings.arm, example.PERIOD
    command = example.commands(len(arm.joints), seed)
    angle = np.tile(0.5 * (arm.lower + arm.upper), (len(command), 1))
    drive = Log("log", period * np.arange(len(command)), command, angle, period)
    return hydroid.simulate(drive, fit=truth, out=None, noise_deg=example.NOISE_DEG, seed=seed).log


def main() -> None:
    """Fit, and print how often each parameter's interval holds the truth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--fits", type=int, default=20)
    fits = parser.parse_args().fits
    with tempfile.TemporaryDirectory() as place:
        truth = machine(Path(place) / "machine")
        logs: list[str | Path] = [EXAMPLE / f"log_{number}.csv" for number in (1, 2, 3)]
        hydroid.init(Path(place) / "mine", arm=EXAMPLE / "robot.urdf", log=logs)
        study(truth, hydroid.load_settings(Path(place) / "mine" / "fit.yaml"), fits)


def study(truth: IdentifiedModel, settings: FitSettings, fits: int) -> None:
    """Fit as many pairs of logs of the machine, and print the table."""
    names = settings.parameter_set().names
    true = np.array([truth.values[name] for name in names])
    errors, deviations, hits, began = [], [], [], time.process_time()
    for number in range(fits):
        logs = [seen(truth, seed) for seed in (1000 + 2 * number, 1001 + 2 * number)]
        problem = Problem(settings, logs)
        start = true * np.random.default_rng(number).uniform(0.95, 1.05, len(true))
        assert settings.refinement is not None
        found = refine(problem, start, settings.refinement)
        theta = problem.parameters.from_unit(found.point)
        known = uncertainty(problem, theta)
        errors.append(theta - true)
        deviations.append(known.standard_deviation)
        low, high = known.interval.T
        hits.append(np.where(np.isnan(low), np.nan, (low <= true) & (true <= high)))
    print(f"{fits} fits, {time.process_time() - began:.0f} s of CPU\n")
    print("| parameter | truth | predicted sd [%] | predicted / spread | covered |\n" + 5 * "| --- " + "|")
    spread, predicted = np.sqrt(np.mean(np.square(errors), axis=0)), np.mean(deviations, axis=0)
    inner = np.flatnonzero(true > 0)
    for i in inner:
        share = 100 * np.nanmean([one[i] for one in hits])
        percent, ratio = 100 * predicted[i] / true[i], predicted[i] / spread[i]
        print(f"| {names[i]} | {true[i]:.4g} | {percent:.2f} | {ratio:.2f} | {share:.0f} % |")
    ratio, share = np.median((predicted / spread)[inner]), 100 * np.nanmean(np.array(hits)[:, inner])
    print(f"| all | | | {ratio:.2f} | {share:.1f} % |")


if __name__ == "__main__":
    main()
