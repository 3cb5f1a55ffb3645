"""Does `hydroid suggest` name what a model lacks, and is it silent where it lacks nothing?

    python benchmarks/suggest_study.py [--logs 20] [--seconds 15] [--only delay none]

Stage 2 of the shoulder: areas and openings of both sides, the damping and the third link's mass are free,
with the priors of configs/fit-hyd.yaml, and all else is held at the truth. Each log is simulated with one
term present (or none), with commands and a start pose of its own, a second of rest, and 0.1 deg of white
noise. The model without the term is fitted to it and tested. The refinement starts within 5 % of the truth:
this is a study of the test, not of the search. The sizes of the terms are ours. The flow limit is a part of
the largest flow in the log without it (FLOW_PART): a limit that no flow reaches changes nothing. A term is
named where the verdict is to free it, on one side or both. It is first where nothing ranks before it.
"""

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from hydroid import load_settings
from hydroid.arm.model import load_model
from hydroid.experiment.pseudo_random import pseudo_random_log
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem, make_simulation
from hydroid.problem.stage import Stage
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings
from hydroid.simulation import HydraulicSimulation
from hydroid.suggestion.missing import MissingTerms, missing_terms
from hydroid.uncertainty.covariance import uncertainty

NOISE = np.deg2rad(0.1)
REST = 100
"""samples without a command at the start"""
FIRST_SEED = 100
"""of the logs of each case; those below 100 were used while the test was written"""
EVERY = 5
"""logs of each case after which the table is printed"""
TRUTH = {"A_A": 1000.0, "A_B": 750.0, "open_A": 0.4, "open_B": 0.4, "D": 150.0, "M3": 22.5}
QUANTITIES = {"A_A": "area_a", "A_B": "area_b", "open_A": "opening_a", "open_B": "opening_b"}
WITHIN = {"area_a": 1.5, "area_b": 1.5, "opening_a": 2.0, "opening_b": 2.0}
TERMS = {
    "delay": {"delay": 0.03},
    "overlap": {"overlap": 0.05},
    "opening_exponent": {"opening_exponent": 1.1},
    "dry_friction": {"dry_friction": 1500.0},
    "flow_limit": {"flow_limit": np.inf},
    "leakage": {"leakage": 0.02},
    "none": {},
}
"""what is present in the truth: quantities of the hydraulics, in their units"""


FLOW_PART = 0.8
"""the flow limit, as a part of the flow that the log without it exceeds for 1 % of the time"""


def make_settings(present: dict[str, float]) -> FitSettings:
    """The model without the terms, or the truth with those present."""
    changes = {"joint_refinement": False, "refinement.gain_tolerance": 1e-6}
    settings = load_settings("fit-hyd", changes | {f"hydraulics.{n}": v for n, v in present.items()})
    free = {
        name: ParameterSettings(quantity=quantity, joints=(2,), within=WITHIN[quantity], nominal=TRUTH[name])
        for name, quantity in QUANTITIES.items()
    }
    free["D"] = ParameterSettings(quantity="damping", joints=(2,), bounds=(1.0, 5000.0), start=100.0)
    free["M3"] = ParameterSettings(quantity="mass", link="link3", within=2.0)
    return settings.model_copy(update={"parameters": free})


def make_log(present: dict[str, float], seconds: float, seed: int) -> Log:
    """A log of its own: start pose, commands and noise."""
    rng = np.random.default_rng([seed, 17])
    limited = "flow_limit" in present
    truth = make_settings({} if limited else present)
    pose = truth.arm.pose("study").copy()
    pose[1:3] = np.radians([rng.uniform(0, 40), rng.uniform(-100, -40)])

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(truth, log, TRUTH, "truth").angle[:, 1]
        return bool(angle.min() > np.deg2rad(-25) and angle.max() < np.deg2rad(85))

    log = pseudo_random_log(pose, [2], duration=seconds, seed=seed, allowed=off_the_stops)
    log.command[REST:] = log.command[:-REST].copy()
    log.command[:REST] = 0.0
    if limited:
        truth = make_settings({"flow_limit": FLOW_PART * largest_flow(truth, log)})
    clean = simulate_log(truth, log, TRUTH, "truth")
    noise = np.zeros_like(clean.angle)
    noise[:, 1] = rng.normal(0.0, NOISE, len(noise))
    return replace(clean, angle=clean.angle + noise)


def largest_flow(truth: FitSettings, log: Log) -> float:
    """Flow from the pump that the true arm exceeds for 1 % of a log [L/min]."""
    simulation = make_simulation(load_model(truth.arm.model, truth.arm), log, [1], truth)
    assert isinstance(simulation, HydraulicSimulation)
    stage = Stage(truth)
    flow = simulation.trace(stage.candidates(stage.parameters.vector(TRUTH, "truth")[None])).flow[:, 0]
    return 6e4 * float(np.quantile(np.maximum(flow[:, 0], -flow[:, 1]), 0.99))


@dataclass
class Tally:
    """Counts over the logs of one case."""

    logs: int = 0
    named: int = 0
    first: int = 0
    anything: int = 0
    others: Counter[str] = field(default_factory=Counter[str])
    rms: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])

    def add(self, case: str, result: MissingTerms) -> None:
        """Count the result of one log."""
        quantities = [test.term.settings.quantity for test in result.free]
        mine = [q.removesuffix("_a").removesuffix("_b") == case for q in quantities]
        least = [t.rms for t in result.tests if t.term.settings.quantity == case] or [np.nan]
        self.logs += 1
        self.named += any(mine)
        self.first += bool(mine and mine[0])
        self.anything += bool(quantities)
        self.others.update(q for q, own in zip(quantities, mine, strict=True) if not own)
        self.rms.append((float(np.degrees(result.rms)), float(np.degrees(least[0]))))

    def row(self, case: str) -> str:
        """One row of the table."""
        before, after = np.median(self.rms, axis=0)
        also = ", ".join(f"{q} {n}" for q, n in self.others.most_common()) or "–"
        counts = (f"{n} of {self.logs}" for n in (self.named, self.first, self.anything))
        return f"| {case} | {' | '.join(counts)} | {also} | {before:.3f} | {after:.3f} |"


def one(case: str, k: int, seconds: float) -> MissingTerms:
    """Simulate a log, fit the model without the term, and test it."""
    model = make_settings({})
    log = make_log(TERMS[case], seconds, 1000 * list(TERMS).index(case) + FIRST_SEED + k)
    problem = Problem(model, [log])
    start = problem.parameters.vector(TRUTH, "truth")
    start *= np.random.default_rng([k, 5]).uniform(0.95, 1.05, start.size)
    assert model.refinement is not None
    found = refine(problem, start, model.refinement, lambda n, rms: None)
    theta = problem.parameters.from_unit(found.point[None])[0]
    return missing_terms(problem, uncertainty(problem, theta))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--only", nargs="*", default=list(TERMS))
    arguments = parser.parse_args()
    tallies = {case: Tally() for case in arguments.only}
    began = time.process_time()
    for k in range(arguments.logs):
        for case, tally in tallies.items():
            tally.add(case, one(case, k, arguments.seconds))
        if (k + 1) % EVERY == 0 or k + 1 == arguments.logs:
            print(f"\n{k + 1} logs of each, {time.process_time() - began:.0f} s of CPU\n")
            print(
                "| present | named | first | anything named | also named | rms without it [deg] | with it |"
            )
            print("| --- | --- | --- | --- | --- | --- | --- |")
            print("\n".join(tally.row(case) for case, tally in tallies.items()), flush=True)


if __name__ == "__main__":
    main()
