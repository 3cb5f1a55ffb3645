"""Time to an answer: the shipped demo from CSV to report, and how soon a command answers at all.

    python benchmarks/answer.py [--repeats 5]

Wall-clock seconds of whole processes on this machine; run it with nothing else on the machine's cores. The
parts of each fit are what the run itself measured (`seconds` in its run.json).
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import options

ROOT = Path(__file__).parents[1]
LOGS = [str(ROOT / "examples" / "logs" / f"rig_shoulder_{k}.csv") for k in (1, 2)]


def seconds(command: str, status: int = 0) -> float:
    """Run one command to its end; return its wall-clock time [s]."""
    began = time.perf_counter()
    hydroid = [sys.executable, "-m", "hydroid", *command.split()]
    done = subprocess.run(hydroid, cwd=ROOT, capture_output=True, text=True)
    if done.returncode != status:
        raise SystemExit(f"hydroid {command} ended with {done.returncode}: {done.stderr}")
    return time.perf_counter() - began


def answers(folder: Path, repeats: int) -> None:
    """Print the median time of commands that should answer at once."""
    (folder / "wrong.yaml").write_text("stage: mech\nserach: {}\n")
    commands = {
        "--help": ("--help", 0),
        "check LOG": (f"check {LOGS[0]}", 0),
        "a missing file": (f"fit-mech {folder}/none.csv", 2),
        "a wrong setting": (f"fit-mech {LOGS[0]} --config {folder}/wrong.yaml", 2),
    }
    for name, (command, status) in commands.items():
        low, median, high = np.quantile([seconds(command, status) for _ in range(repeats)], [0, 0.5, 1])
        print(f"{name:18} {median:6.2f} s   ({low:.2f} to {high:.2f})")


def demo(folder: Path) -> None:
    """Run the demo of the Makefile; print each command's time and the parts of each fit."""
    runs = {name: folder / name for name in ("ga", "nsga2", "hyd")}
    fits = " ".join(f"--fit={run}" for run in runs.values())
    commands = {
        "stage 1, GA": (f"fit-mech {LOGS[0]} --algorithm ga", runs["ga"]),
        "stage 1, NSGA-II": (f"fit-mech {LOGS[0]} --algorithm nsga2", runs["nsga2"]),
        "stage 2": (f"fit-hyd {LOGS[0]} --mech {runs['nsga2']}", runs["hyd"]),
        "validation": (f"validate {' '.join(LOGS)} {fits}", folder / "validation"),
    }
    total = 0.0
    for name, (command, run) in commands.items():
        took = seconds(f"{command} --out {run} --quiet")
        total += took
        stored = run / "run.json"
        parts: dict[str, float] = json.loads(stored.read_text()).get("seconds", {}) if stored.exists() else {}
        parts |= {"start and the rest": took - sum(parts.values())} if parts else {}
        print(f"{name:18} {took:6.1f} s  ", ", ".join(f"{part} {s:.1f}" for part, s in parts.items()))
    print(f"{'whole demo':18} {total:6.1f} s")


if __name__ == "__main__":
    repeats = options(__doc__, repeats=5).repeats
    with tempfile.TemporaryDirectory() as place:
        answers(Path(place), repeats)
        demo(Path(place))
