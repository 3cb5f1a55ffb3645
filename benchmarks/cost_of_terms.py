"""What the hydraulics cost today, beside an older commit: the price of terms that are switched off.

    python benchmarks/cost_of_terms.py COMMIT [ROUNDS]

Both simulate the same candidates of the article's stage 2, in one thread each, in turn: shoulder alone, and
all seven joints. Prints the ratio of their CPU seconds, today's over the commit's: median and quartiles over
the rounds. The older tree is checked out beside this one and removed again.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from subprocess import PIPE

import numpy as np
from common import ROOT

CASES = {"the shoulder's hydraulics": [2], "all seven joints'": list(range(1, 8))}
WORKER = """
import sys, time
import numpy as np
from hydroid import load_settings
from hydroid.log import Log
from hydroid.problem.problem import Problem

settings = load_settings("article-hyd", {"simulation.other_joints": "passive", "simulation.threads": 1})
problems = []
for joints in eval(sys.argv[1]):
    rng, pose = np.random.default_rng(0), settings.arm.pose("study")
    command = np.zeros((1501, len(pose)))
    command[:1500, [j - 1 for j in joints]] = np.repeat(rng.uniform(-60, 60, (30, len(joints))), 50, axis=0)
    time_s, angle = np.arange(1501) * 0.01, np.tile(pose, (1501, 1))
    problems.append(Problem(settings, [Log("duties", time_s, command, angle, 0.01)]))
theta = problems[0].parameters.from_unit(np.random.default_rng(1).random((35, 7)))
for line in sys.stdin:
    began = time.process_time()
    problems[int(line)].objectives(theta)
    print(time.process_time() - began, flush=True)
"""
"""times one case for each line of its input; it runs on both commits, so it uses what both have"""


def worker(tree: Path) -> "subprocess.Popen[str]":
    """Return a process that times cases with the code of one tree."""
    command = [sys.executable, "-c", WORKER, str(list(CASES.values()))]
    return subprocess.Popen(
        command, cwd=tree, env={"PYTHONPATH": str(tree)}, stdin=PIPE, stdout=PIPE, text=True
    )


def seconds(one: "subprocess.Popen[str]", case: int) -> float:
    """CPU seconds of one case."""
    assert one.stdin is not None
    assert one.stdout is not None
    print(case, file=one.stdin, flush=True)
    return float(one.stdout.readline())


def main(commit: str, rounds: int = 21) -> None:
    with tempfile.TemporaryDirectory() as folder:
        older, git = Path(folder) / "older", ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(older), commit], check=True)
        try:
            with worker(ROOT) as new, worker(older) as old:
                for case, name in enumerate(CASES):  # the first round compiles and warms up
                    took = [(seconds(new, case), seconds(old, case)) for _ in range(1 + rounds)][1:]
                    low, median, high = np.quantile(np.divide(*np.transpose(took)), [0.25, 0.5, 0.75])
                    print(f"{name:28}{median:7.3f}  ({low:.3f} to {high:.3f})", flush=True)
        finally:
            subprocess.run([*git, "remove", "--force", str(older)], check=True)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
