"""Logs and arms as the world has them: right, said in one line, refused, or wrong
without a word.

    python benchmarks/machine_logs.py
    python benchmarks/machine_logs.py --follow 20

The logs are written for the purpose (tests/helpers/field_logs.py). Without --follow
they are read by what `hydroid init` writes. With it, the commands that `init` prints
are followed: check, a fit of that budget of CPU time, and validation on a second log;
and then for twelve arms (tests/helpers/worlds.py), whose fits have three times as much. A log is
right if it is read rightly, if the fit errs on the second log by at most a third of
what standing still does (shown in brackets) [deg, mm], and if its speeds from 60 % of
the strongest command are those that made the log, within 10 % of the largest, in the
same direction.
Many logs hold the same once they are read: what holds the same is fitted once. With
another version of hydroid on PYTHONPATH the table is that of this version.
"""

import argparse
import logging
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

import field_logs
import worlds
from field_logs import FIELD_LOGS
from printed import Known
from worlds import WORLDS

import hydroid
from hydroid.settings.arm import load_arm


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--follow",
        type=int,
        metavar="SECONDS",
        help="CPU time of a fit of two joints",
    )
    parser.add_argument(
        "--only", default="", help="a part of the names of logs and arms"
    )
    given = parser.parse_args()
    logging.getLogger("hydroid").setLevel(logging.CRITICAL)
    counts = Counter[str]()
    known: Known = {}
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        hydroid.init(home / "template")
        arm = load_arm(home / "template" / "arm.yaml")
        print("| log or arm | outcome | line |", "| --- | --- | --- |", sep="\n")

        def show(what: str, verdict: str, line: str, folder: Path) -> None:
            counts[verdict] += 1
            print(
                f"| {what} | {verdict} | {line.replace(f'{folder}/', '')[:150]} |",
                flush=True,
            )

        for number, log in enumerate(FIELD_LOGS):
            if given.only not in log.name:
                continue
            folder = home / str(number)
            folder.mkdir()
            if given.follow:
                budget = f"{given.follow}s"
                found = field_logs.followed(log, folder, arm, budget, known)
            else:
                found = field_logs.outcome(log, folder, arm)
            show(log.name, found.verdict, found.line, folder)
        for number, (name, world) in enumerate(WORLDS.items() if given.follow else ()):
            if given.only not in name:
                continue
            folder = home / f"arm_{number}"
            folder.mkdir()
            found = worlds.followed(world, folder, f"{3 * given.follow}s", known)
            show(name, *found, folder)
    print(
        ", ".join(f"{verdict}: {count}" for verdict, count in counts.items()),
        f"of {counts.total()}",
    )


if __name__ == "__main__":
    main()
