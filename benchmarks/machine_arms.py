"""Arms as CAD and simulators have them: right, said in one line, refused, or wrong
without a word.

    python benchmarks/machine_arms.py

The arms are written for the purpose (tests/helpers/field_arms.py) and given to `hydroid
init`. An arm is right if its joints, their distances, the masses of its links and the
lengths of its cylinders over the joints' ranges are the truth's. It is said if they are
what they should be where the file does not tell, and a line says so. With another
version of hydroid on PYTHONPATH the table is that of this version.
"""

import argparse
import logging
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

from field_arms import FIELD_ARMS, outcome


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="a part of the names of arms")
    given = parser.parse_args()
    logging.getLogger("hydroid").setLevel(logging.CRITICAL)
    counts = Counter[str]()
    print("| arm | outcome | line |", "| --- | --- | --- |", sep="\n")
    for arm in FIELD_ARMS:
        if given.only not in arm.name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            found = outcome(arm, Path(folder))
            line = found.line.replace(f"{folder}/", "")[:150]
        counts[found.verdict] += 1
        print(f"| {arm.name} | {found.verdict} | {line} |", flush=True)
    parts = [f"{verdict}: {count}" for verdict, count in counts.items()]
    print(", ".join(parts), f"of {counts.total()}")


if __name__ == "__main__":
    main()
