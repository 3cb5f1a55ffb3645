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

import json
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import near, options, refined, row, table

from hydroid import load_settings
from hydroid.advice.missing import missing_terms
from hydroid.advice.pseudo_random import pseudo_random_log
from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.posterior.covariance import uncertainty
from hydroid.prediction import simulate_log
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import Problem, make_simulation
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings

FIRST_SEED = 100
"""of the logs of each case; those below 100 were used while the test was written"""
TRUTH = {"A_A": 1000.0, "A_B": 750.0, "open_A": 0.4, "open_B": 0.4, "D": 150.0, "M3": 22.5}
QUANTITIES = {"A_A": "area_a", "A_B": "area_b", "open_A": "opening_a", "open_B": "opening_b"}
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
        name: ParameterSettings(
            quantity=what, joints=(2,), within=1.5 if name[0] == "A" else 2.0, nominal=TRUTH[name]
        )
        for name, what in QUANTITIES.items()
    }
    free["D"] = ParameterSettings(quantity="damping", joints=(2,), bounds=(1.0, 5000.0), start=100.0)
    free["M3"] = ParameterSettings(quantity="mass", link="link3", within=2.0)
    return settings.model_copy(update={"parameters": free})


def make_log(present: dict[str, float], seconds: float, seed: int) -> Log:
    """A log of its own: start pose, commands and noise."""
    rng, limited, rest = np.random.default_rng([seed, 17]), "flow_limit" in present, 100
    truth = make_settings({} if limited else present)
    pose = truth.arm.pose("study").copy()
    pose[1:3] = np.radians([rng.uniform(0, 40), rng.uniform(-100, -40)])

    def off_the_stops(log: Log) -> bool:
        angle = simulate_log(truth, log, TRUTH, "truth").angle[:, 1]
        return bool(angle.min() > np.deg2rad(-25) and angle.max() < np.deg2rad(85))

    log = pseudo_random_log(pose, [2], duration=seconds, seed=seed, allowed=off_the_stops)
    log.command[rest:] = log.command[:-rest].copy()
    log.command[:rest] = 0.0
    if limited:
        truth = make_settings({"flow_limit": FLOW_PART * largest_flow(truth, log)})
    angle = simulate_log(truth, log, TRUTH, "truth").angle.copy()
    angle[:, 1] += rng.normal(0.0, np.deg2rad(0.1), len(angle))
    return replace(log, angle=angle)


def largest_flow(truth: FitSettings, log: Log) -> float:
    """Flow from the pump that the true arm exceeds for 1 % of a log [L/min]."""
    simulation = make_simulation(load_model(truth.arm), log, [1], truth)
    stage = Bindings(truth)
    flow = simulation.trace(stage.candidates(stage.parameters.vector(TRUTH, "truth")[None])).flow[:, 0]
    return 6e4 * float(np.quantile(np.maximum(flow[:, 0], -flow[:, 1]), 0.99))


def one(case: str, k: int, seconds: float) -> dict[str, Any]:
    """Simulate a log, fit the model without the term, test it, and return what the table needs of it."""
    began = time.process_time()
    log = make_log(TERMS[case], seconds, 1000 * list(TERMS).index(case) + FIRST_SEED + k)
    problem = Problem(make_settings({}), [log])
    start = near(problem, problem.parameters.vector(TRUTH, "truth"), np.random.default_rng([k, 5]))
    result = missing_terms(problem, uncertainty(problem, refined(problem, start)[0]))
    mine = [t for t in result.tests if sideless(t.term.settings.quantity) == case]
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


def sideless(quantity: str) -> str:
    """A quantity without its side."""
    return quantity.removesuffix("_a").removesuffix("_b")


def summary(results: list[dict[str, Any]]) -> None:
    """Print the table, a row for each case."""
    print(f"\n{len(results)} logs, {sum(each['cpu_s'] for each in results):.0f} s of CPU")
    table("present | named | first | anything named | also named | rms without it [deg] | with it")
    for case in TERMS:
        if mine := [each for each in results if each["case"] == case]:
            named = [[sideless(q) for q in each["named"]] for each in mine]
            counts = [sum(yes) for yes in ([case in n for n in named], [n[:1] == [case] for n in named])]
            counts = " | ".join(f"{n} of {len(mine)}" for n in (*counts, sum(map(bool, named))))
            others = Counter(q for each in mine for q in each["named"] if sideless(q) != case)
            also = ", ".join(f"{q} {n}" for q, n in others.most_common()) or "–"
            rms = (f"{np.median([each[k] for each in mine]):.3f}" for k in ("rms_deg", "freed_rms_deg"))
            row(f"{case} | {counts} | {also} | {' | '.join(rms)}")


def study(logs: int, seconds: float, cases: Iterable[str], results: Path) -> None:
    """Add the logs that the results do not have yet, and print the table of all."""
    results.parent.mkdir(parents=True, exist_ok=True)
    results.touch()
    stored = [json.loads(line) for line in results.read_text().splitlines()]
    done = {(each["case"], each["log"]) for each in stored}
    for k in range(logs):
        for case in cases:
            if (case, k) not in done:
                line = json.dumps(one(case, k, seconds))
                with results.open("a") as file:
                    file.write(line + "\n")
                print(line, flush=True)
    summary([json.loads(line) for line in results.read_text().splitlines()])


if __name__ == "__main__":
    given = options(
        __doc__, logs=20, seconds=15.0, only=list(TERMS), results=Path("runs") / "suggest_study.jsonl"
    )
    study(given.logs, given.seconds, given.only, given.results)
