"""What `hydroid init` makes of logs as machines record them: right, said in one line, refused, or wrong.

    python benchmarks/machine_logs.py

The logs are written for the purpose (tests/helpers/field_logs.py). With another version of hydroid on
PYTHONPATH the table is that of this version.
"""

import logging
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

from field_logs import FIELD_LOGS, outcome

import hydroid
from hydroid.settings.arm import load_arm


def main() -> None:
    """Print the table."""
    logging.getLogger("hydroid").setLevel(logging.CRITICAL)
    counts = Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        hydroid.init(home / "template")
        arm = load_arm(home / "template" / "arm.yaml")
        print("| log | outcome | line |", "| --- | --- | --- |", sep="\n")
        for number, log in enumerate(FIELD_LOGS):
            folder = home / str(number)
            folder.mkdir()
            found = outcome(log, folder, arm)
            counts[found.verdict] += 1
            line = found.line.replace(f"{folder}/", "")[:110]
            print(f"| {log.name} | {found.verdict} | {line} |", flush=True)
    print(", ".join(f"{verdict}: {count}" for verdict, count in counts.items()), f"of {len(FIELD_LOGS)}")


if __name__ == "__main__":
    main()
