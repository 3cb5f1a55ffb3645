"""Does `hydroid suggest` name what a model lacks, and is it silent where it lacks nothing?

    python benchmarks/suggest_study.py [--logs 20] [--only delay none] [--results runs/suggest_study.jsonl]

Each log appends one line to the results; a log that has one is not repeated, so the study can be stopped and
continued, and processes of different terms may share the file. The table is of all that the file holds: after
a change of the code, begin a new file.

Stage 2 of the shoulder: areas and openings of both sides, the damping and the third link's mass are free,
with the priors of configs/fit-hyd.yaml, and all else is held at the truth. Each log is simulated with one
term present (or none), with commands and a start pose of its own, a second of rest, and 0.1 deg of white
noise. The model without the term is fitted to it and tested. The refinement starts within 5 % of the truth:
this is a study of the test, not of the search. The sizes of the terms are ours. The flow limit is a part of
the largest flow in the log without it (FLOW_PART): a limit that no flow reaches changes nothing. A term is
named where the verdict is to free it, on one side or both. It is first where nothing ranks before it.
"""

import argparse
import json
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hydroid import load_settings
from hydroid.advice.missing import missing_terms
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.arm.model import load_model
from hydroid.fitting.refinement import refine
from hydroid.log import Log
from hydroid.posterior.covariance import uncertainty
from hydroid.prediction import simulate_log
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import Problem, make_simulation
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings

NOISE = np.deg2rad(0.1)
REST = 100
"""samples without a command at the start"""
FIRST_SEED = 100
"""of the logs of each case; those below 100 were used while the test was written"""
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
    simulation = make_simulation(load_model(truth.arm), log, [1], truth)
    stage = Bindings(truth)
    flow = simulation.trace(stage.candidates(stage.parameters.vector(TRUTH, "truth")[None])).flow[:, 0]
    return 6e4 * float(np.quantile(np.maximum(flow[:, 0], -flow[:, 1]), 0.99))


def one(case: str, k: int, seconds: float) -> dict[str, Any]:
    """Simulate a log, fit the model without the term, test it, and return what the table needs of it."""
    began = time.process_time()
    model = make_settings({})
    log = make_log(TERMS[case], seconds, 1000 * list(TERMS).index(case) + FIRST_SEED + k)
    problem = Problem(model, [log])
    start = problem.parameters.vector(TRUTH, "truth")
    start *= np.random.default_rng([k, 5]).uniform(0.95, 1.05, start.size)
    assert model.refinement is not None
    found = refine(problem, start, model.refinement)
    theta = problem.parameters.from_unit(found.point)
    result = missing_terms(problem, uncertainty(problem, theta))
    mine = [t for t in result.tests if own(t.term.settings.quantity) == case]
    return {
        "case": case,
        "log": k,
        "named": [test.term.settings.quantity for test in result.free],
        "rms_deg": float(np.degrees(result.rms)),
        "freed_rms_deg": min((float(np.degrees(t.rms)) for t in mine), default=np.nan),
        "chance": min((t.chance for t in mine), default=np.nan),
        "tests": len(result.tests),
        "cpu_s": time.process_time() - began,
    }


def row(case: str, results: list[dict[str, Any]]) -> str:
    """One row of the table."""
    named = [[own(q) for q in each["named"]] for each in results]
    others = Counter(q for each in results for q in each["named"] if own(q) != case)
    also = ", ".join(f"{q} {n}" for q, n in others.most_common()) or "–"
    yes = (
        sum(case in each for each in named),
        sum(each[:1] == [case] for each in named),
        sum(map(bool, named)),
    )
    counts = " | ".join(f"{n} of {len(results)}" for n in yes)
    before, after = (np.median([each[key] for each in results]) for key in ("rms_deg", "freed_rms_deg"))
    return f"| {case} | {counts} | {also} | {before:.3f} | {after:.3f} |"


def own(quantity: str) -> str:
    """A quantity without its side."""
    return quantity.removesuffix("_a").removesuffix("_b")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--logs", type=int, default=20, help="of each term, from the first one on")
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--only", nargs="*", default=list(TERMS), choices=list(TERMS))
    parser.add_argument("--results", type=Path, default=Path("runs/suggest_study.jsonl"))
    arguments = parser.parse_args()
    arguments.results.parent.mkdir(parents=True, exist_ok=True)
    done = {(each["case"], each["log"]) for each in read(arguments.results)}
    for k in range(arguments.logs):
        for case in arguments.only:
            if (case, k) not in done:
                line = json.dumps(one(case, k, arguments.seconds))
                with arguments.results.open("a") as file:
                    file.write(line + "\n")
                print(line, flush=True)
    results = read(arguments.results)
    print(f"\n{len(results)} logs, {sum(each['cpu_s'] for each in results):.0f} s of CPU\n")
    print("| present | named | first | anything named | also named | rms without it [deg] | with it |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for case in TERMS:
        if mine := [each for each in results if each["case"] == case]:
            print(row(case, mine))


def read(results: Path) -> list[dict[str, Any]]:
    """Return the lines of a results file, none if there is no file."""
    return [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []


if __name__ == "__main__":
    main()
