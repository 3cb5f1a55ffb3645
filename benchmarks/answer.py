"""Time to an answer: the shipped demo from CSV to report, and how soon a command answers at all.

    python benchmarks/answer.py [--repeats 5]

Wall-clock seconds of whole processes on this machine; run it with nothing else on the machine's cores. The
parts of each fit are what the run itself measured (`seconds` in its run.json).
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOGS = [str(ROOT / "examples" / "logs" / f"rig_shoulder_{k}.csv") for k in (1, 2)]
HYDROID = [sys.executable, "-m", "hydroid"]


def seconds(*arguments: str, status: int = 0) -> float:
    """Run one command to its end; return its wall-clock time [s].

    Raises:
        RuntimeError: another exit status than `status`.
    """
    began = time.perf_counter()
    done = subprocess.run([*HYDROID, *arguments], cwd=ROOT, capture_output=True, text=True)
    took = time.perf_counter() - began
    if done.returncode != status:
        raise RuntimeError(f"hydroid {' '.join(arguments)} ended with {done.returncode}: {done.stderr}")
    return took


def demo(folder: Path) -> None:
    """Run the demo of the Makefile; print each command's time and the parts of each fit."""
    runs = {name: str(folder / name) for name in ("ga", "nsga2", "hyd")}
    fits = [f"--fit={run}" for run in runs.values()]
    commands = {
        "stage 1, GA": ("fit-mech", LOGS[0], "--algorithm", "ga", "--out", runs["ga"]),
        "stage 1, NSGA-II": ("fit-mech", LOGS[0], "--algorithm", "nsga2", "--out", runs["nsga2"]),
        "stage 2": ("fit-hyd", LOGS[0], "--mech", runs["nsga2"], "--out", runs["hyd"]),
        "validation": (
            "validate",
            *LOGS,
            *fits,
            "--out",
            str(folder / "v"),
        ),
    }
    total = 0.0
    for (name, command), run in zip(commands.items(), [*runs.values(), None], strict=True):
        took = seconds(*command, "--quiet")
        total += took
        parts: dict[str, float] = json.loads((Path(run) / "run.json").read_text())["seconds"] if run else {}
        parts |= {"start and the rest": took - sum(parts.values())} if parts else {}
        print(f"{name:18} {took:6.1f} s  ", ", ".join(f"{part} {s:.1f}" for part, s in parts.items()))
    print(f"{'whole demo':18} {total:6.1f} s")


def answers(folder: Path, repeats: int) -> None:
    """Print the median time of commands that should answer at once."""
    wrong = folder / "wrong.yaml"
    wrong.write_text("stage: mech\nserach: {}\n")
    commands: dict[str, tuple[tuple[str, ...], int]] = {
        "--help": (("--help",), 0),
        "check LOG": (("check", LOGS[0]), 0),
        "a missing file": (("fit-mech", str(folder / "none.csv")), 2),
        "a wrong setting": (("fit-mech", LOGS[0], "--config", str(wrong)), 2),
    }
    for name, (command, status) in commands.items():
        took = [seconds(*command, status=status) for _ in range(repeats)]
        print(f"{name:18} {statistics.median(took):6.2f} s   ({min(took):.2f} to {max(took):.2f})")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=5, help="of the commands that answer at once")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        answers(Path(folder), options.repeats)
        demo(Path(folder))


if __name__ == "__main__":
    main()
