"""Arms as CAD and simulators have them: right, said in one line, refused, or wrong
without a word.

    python benchmarks/machine_arms.py
    python benchmarks/machine_arms.py --follow 20 --sample 5

The arms are written for the purpose (tests/helpers/field_arms.py) and given to `hydroid
init`. An arm is right if its joints, their distances, the masses of its links and the
lengths of its cylinders over the joints' ranges are the truth's. It is said if they are
what they should be where the file does not tell, and a line says so. With --follow
those that are taken so go through the commands that `init` prints: check, a fit of that
budget, and validation on a second log; an arm is right then if the fit errs there by at
most a third of what standing still does (shown in brackets) [deg, mm]. Their logs are of
valves of their own equations, on which no load acts: they show that the way is open,
not how well loads are predicted. With another version of hydroid on PYTHONPATH the
table is that of this version.
"""

import argparse
import logging
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

from field_arms import FIELD_ARMS, followed, outcome


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="a part of the names of arms")
    parser.add_argument(
        "--follow", type=int, metavar="SECONDS", help="budget of each arm's fit"
    )
    parser.add_argument("--sample", type=int, help="so many arms, drawn at random")
    parser.add_argument("--seed", type=int, default=0, help="of that draw")
    given = parser.parse_args()
    arms = [arm for arm in FIELD_ARMS if given.only in arm.name]
    if given.sample:
        drawn = random.Random(given.seed).sample(range(len(arms)), given.sample)
        arms = [arms[number] for number in sorted(drawn)]
    logging.getLogger("hydroid").setLevel(logging.CRITICAL)
    counts = Counter[str]()
    print("| arm | outcome | line |", "| --- | --- | --- |", sep="\n")
    for arm in arms:
        with tempfile.TemporaryDirectory() as folder:
            if given.follow:
                found = followed(arm, Path(folder), f"{given.follow}s")
            else:
                found = outcome(arm, Path(folder))
            line = found.line.replace(f"{folder}/", "")[:150]
        counts[found.verdict] += 1
        print(f"| {arm.name} | {found.verdict} | {line} |", flush=True)
    parts = [f"{verdict}: {count}" for verdict, count in counts.items()]
    print(", ".join(parts), f"of {counts.total()}")


if __name__ == "__main__":
    main()
