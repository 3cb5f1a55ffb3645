"""The article's tables and figures over many seeds: `make article`, and `make article
ARGS=--quick`.

Only what docs/reproduction/ lacks is run, up to the seeds that the studies state: first
the claims that the fewest runs would decide, if the effect is that of the article. No
run begins after N minutes. In the end figures and docs/reproduction.md are made. The
short form writes to runs/article-quick alone.
"""

import os
import time
from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path

import numpy as np
from claims import Outcome, verdicts
from common import ROOT, options
from figures import draw
from page import page
from pandas import DataFrame
from studies import BLIND, CENTRE, RECORDS, Plan, Runs, load_studies, read_runs

from hydroid.errors import HydroidError
from hydroid.files import write_atomic
from hydroid.studies import Result, perform, processes

Key = tuple[str, str, int]
"""study, cell, seed"""
ATTEMPT = 6
"""number of seeds after which a claim's spread can be guessed"""


def work(
    plans: Mapping[str, Plan],
    runs: dict[str, Runs],
    results: Path,
    at_once: int,
    seconds: float,
) -> None:
    """Perform what is missing, the most telling first, until that many seconds have
    passed."""
    begun, pending = time.monotonic(), dict[Future[Result], Key]()
    with processes(at_once) as executor:
        while True:
            if time.monotonic() - begun < seconds:
                todo = [
                    key for key in by_worth(plans, runs) if key not in pending.values()
                ]
                for name, cell, seed in todo[: at_once - len(pending)]:
                    pending[executor.submit(perform, plans[name].task(cell, seed))] = (
                        name,
                        cell,
                        seed,
                    )
            if not pending:
                return
            for done in wait(pending, return_when=FIRST_COMPLETED).done:
                name, cell, seed = pending.pop(done)
                try:
                    result = done.result()
                except HydroidError as error:
                    result = {"failed": str(error)}
                runs[name].append(plans[name].row(cell, seed, result))
                write(results, name, runs[name])
                print(
                    f"{time.monotonic() - begun:.0f} s: {name}, {cell}, seed {seed}",
                    flush=True,
                )


def write(results: Path, name: str, runs: Runs) -> None:
    first = ["cell", "seed", "failed", "history", "segment bests"]
    columns = [*first, *sorted({column for run in runs for column in run} - {*first})]
    ordered = sorted(runs, key=lambda run: (run["cell"], run["seed"]))
    write_atomic(
        results / f"{name}_runs.csv",
        DataFrame(ordered, columns=columns).to_csv(index=False),
    )


def by_worth(plans: Mapping[str, Plan], runs: Mapping[str, Runs]) -> list[Key]:
    """Return what is missing: for the article's undecided claims, the cheapest first;
    for ours; all else."""
    have = {
        (name, run["cell"], run["seed"]) for name, made in runs.items() for run in made
    }
    claims: list[tuple[bool, float, list[Key]]] = []
    for name, plan in plans.items():
        for verdict in verdicts(plan.study.claims, runs[name], plan.study.tables):
            cells = [
                c
                for c in dict.fromkeys((verdict.claim.lower, verdict.claim.than))
                if c in plan.cells
            ]
            if cells and verdict.outcome is Outcome.UNDECIDED:
                most = min(len(plan.seeds(cell)) for cell in cells)
                upto = ATTEMPT if verdict.seeds < ATTEMPT else verdict.enough
                keys = [
                    (name, cell, seed)
                    for seed in range(1, 1 + min(upto, most))
                    for cell in cells
                ]
                cost = len(set(keys) - have) if upto <= most else np.inf
                claims.append((verdict.claim.ours, cost, keys))
    wanted = [
        key for *_, keys in sorted(claims, key=lambda each: each[:2]) for key in keys
    ]
    rest = [
        (n, c, s)
        for n, plan in plans.items()
        for c in plan.cells
        for s in plan.seeds(c)
    ]
    return [key for key in dict.fromkeys([*wanted, *rest]) if key not in have]


def with_what_needs_no_search(plan: Plan, runs: Runs) -> Runs:
    """Return the runs with blind draws, the box's centre, records at the truth, and
    measures they lack."""
    rows, known = list(runs), {(run["cell"], run["seed"]) for run in runs}
    parameters, seeds = plan.problem(1).parameters, plan.seeds(BLIND)
    unit = np.random.default_rng(0).random((len(seeds), int(parameters.free.sum())))
    points = [(BLIND, seed, point) for seed, point in zip(seeds, unit, strict=True)]
    points += [(CENTRE, 1, np.full(unit.shape[1], 0.5))] if points else []
    for cell, seed, point in points:
        theta = parameters.mapping(parameters.from_unit(point[None])[0])
        if (cell, seed) not in known:
            rows.append(
                {"cell": cell, "seed": seed}
                | {f"value {n}": float(v) for n, v in theta.items()}
            )
    value = f"value {parameters.names[0]}"
    rows = [
        plan.judged(row) if value in row and "error over motion" not in row else row
        for row in rows
    ]
    first = plan.study.same_record + 1  # every one has a truth of its own
    for seed in range(first, first + min(plan.study.records, len(seeds))):
        if (RECORDS, seed) not in known:
            segments = plan.problem(seed).bounds
            rows.append(
                {"cell": RECORDS, "seed": seed}
                | plan.directions(seed).sensitivities(segments)
            )
    return rows


if __name__ == "__main__":
    limits = {"minutes": float("inf"), "processes": os.cpu_count() or 1}
    given = options(__doc__, studies=[*load_studies()], quick=False, **limits)
    results = ROOT / (
        "runs/article-quick/results" if given.quick else "docs/reproduction"
    )
    results.mkdir(parents=True, exist_ok=True)
    studies, runs = load_studies(), dict[str, Runs]()
    plans = {
        name: Plan(name, studies[name], quick=given.quick) for name in given.studies
    }
    for name, plan in plans.items():
        runs[name] = with_what_needs_no_search(
            plan, read_runs(results / f"{name}_runs.csv")
        )
    work(plans, runs, results, given.processes, 60 * given.minutes)
    for name, plan in plans.items():
        if runs[name]:
            write(results, name, runs[name])
        for figure in plan.study.figures:
            draw(plan, runs[name], figure, results / figure.file)
    target = results.with_suffix(".md")
    target.write_text(page(results, quick=given.quick), encoding="utf-8")
    print(target)
