"""Models of the real excavator compared within its fit_* logs: each predicts logs that its fit left out.

    python benchmarks/excavator_folds.py [VARIANT ...] [--to FILE]

The twelve logs are left out in three groups of four neighbours: the trajectories change little from log to
log, so a log's neighbours would tell what it holds. Each row is a whole fit of the other eight from the
start that the config states, each joint alone and then all together, and its mean absolute error over whole
logs [deg]. A fit takes one to two minutes. Rows are kept in FILE, and those that are there are not made
again. The six check_* logs are not read.

A variant's score is the mean over the joints of its left-out error, as a part of the error that a table of
speeds has on the check_* logs (`excavator.BEFORE`). The model of the lowest score is the one to ship.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from excavator import BEFORE, FOLDER, JOINTS, errors, fitted

import hydroid

GROUPS = 3
QUICK: dict[str, object] = {
    "simulation.steps_per_sample": 1,
    "hydraulics.substeps": 8,
    "simulation.threads": 1,
    "refinement.gain_tolerance": 0.003,
}
"""as the shipped steps to 0.02 deg, in two thirds of the time"""
SIDES = ("A", "B")


def changed(key: str, value: object, *names: str) -> dict[str, object]:
    """Settings that change one key of several parameters."""
    return {f"parameters.{name}.{key}": value for name in names}


def sides(*names: str) -> tuple[str, ...]:
    """Names of the parameters of both sides."""
    return tuple(f"{name}_{side}" for name in names for side in SIDES)


NUMBERS = range(1, 5)
NOTCHES = sides(*(f"notch_{k}" for k in NUMBERS))
EXPONENTS = sides("exponent")
NO_NOTCHES = changed("fixed", 1, *NOTCHES)
NO_OVERLAP = changed("fixed", 0, *sides("over"))
NARROW_CURVES = changed("within", 3, *NOTCHES) | changed("within", 2.2, *EXPONENTS)
NARROW_REST = (
    changed("sd", 6, *sides("dead"))
    | changed("sd", 0.1, *sides("delay"))
    | changed("within", 4, *sides("lag", "over", "open"))
)
NARROW = NARROW_CURVES | NARROW_REST
ALIKE = NARROW | changed("within", 1.3, *NOTCHES, *EXPONENTS)
"""valves of one make: their curves differ by a third"""
TIGHT = (
    ALIKE
    | changed("sd", 3, *sides("dead"))
    | changed("sd", 0.05, *sides("delay"))
    | changed("within", 2, *sides("lag", "over"))
)
"""the same of all that a valve and its pilot stage have, but for the openings"""
FLAT = (
    changed("nominal", 1.3, *EXPONENTS)
    | changed("within", 1.6, *EXPONENTS)
    | changed("bounds", [1, 3], *EXPONENTS)
    | changed("start", 1.1, *EXPONENTS)
)
ONE_CURVE = changed("each", False, *NOTCHES) | {
    f"priors.curve_{k}": {"of": {f"notch_{k}_A": 1, f"notch_{k}_B": -1}, "value": 0} for k in NUMBERS
}
"""one curve for all spools of the arm, which only their sizes and exponents tell apart"""
VARIANTS: dict[str, dict[str, object]] = {
    "shipped": {},
    "narrow": NARROW,
    "narrow, wide curves": NARROW_REST,
    "narrow, wide rest": NARROW_CURVES,
    "narrow, notches everywhere": NARROW | changed("each", True, *NOTCHES),
    "narrow, overlaps everywhere": NARROW | changed("each", True, *sides("over")),
    "tight curves": ALIKE,
    "tight": TIGHT,
    "narrow, one curve": NARROW | ONE_CURVE,
    "tight, no notches": NO_NOTCHES | TIGHT,
    "47 parameters": NARROW | NO_NOTCHES | NO_OVERLAP | FLAT | changed("fixed", 0, "F_swing"),
}


def row(variant: str, group: int) -> dict[str, Any]:
    """Fit without one group of logs; errors on fitted and on left-out logs [deg], by joint."""
    settings = hydroid.load_settings(FOLDER / "fit.yaml", VARIANTS[variant] | QUICK)
    logs = hydroid.read_logs(sorted(FOLDER.glob("fit_*.csv")), settings)
    out = np.array_split(np.arange(len(logs)), GROUPS)[group]
    kept = [log for i, log in enumerate(logs) if i not in out]
    began = time.process_time()
    model, _, _ = fitted(settings, kept)
    return {
        "variant": variant,
        "group": group,
        "free": int(settings.parameter_set().free.sum()),
        "fitted": errors(model, kept),
        "left out": errors(model, [logs[i] for i in out]),
        "cpu": time.process_time() - began,
        "values": model.values,
    }


def table(rows: list[dict[str, Any]]) -> None:
    """Print one line per variant: the mean over the groups, and the score."""
    reference = np.array(next(iter(BEFORE.values())))
    print(
        f"{'fitted, left out [deg]':24}{'free':>5}" + "".join(f"{n:>14}" for n in JOINTS.values()) + "  score"
    )
    for variant in dict.fromkeys(r["variant"] for r in rows):
        own = [r for r in rows if r["variant"] == variant]
        inside, outside = (np.mean([r[key] for r in own], axis=0) for key in ("fitted", "left out"))
        pairs = "".join(f"{i:8.2f}{o:6.2f}" for i, o in zip(inside, outside, strict=True))
        groups = "" if len(own) == GROUPS else f"  ({len(own)} of {GROUPS} groups)"
        score = np.mean(outside / reference)
        print(f"{variant:24}{own[0]['free']:>5}{pairs}{score:7.3f}{groups}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variants", nargs="*", default=list(VARIANTS), choices=[*VARIANTS, []])
    parser.add_argument("--to", type=Path, default=Path("runs/excavator-folds.jsonl"))
    arguments = parser.parse_args()
    arguments.to.parent.mkdir(parents=True, exist_ok=True)
    arguments.to.touch()
    rows = [json.loads(line) for line in arguments.to.read_text().splitlines()]
    done = {(r["variant"], r["group"]) for r in rows}
    for variant in arguments.variants:
        for group in range(GROUPS):
            if (variant, group) not in done:
                rows.append(row(variant, group))
                with arguments.to.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
                table(rows[-1:])
    table(rows)


if __name__ == "__main__":
    main()
