"""Do the tests of assumptions name a planted error, and are they silent where nothing
is wrong?

The logs of each machine of stranger.py are tested with the arm as it is, and with the
axis of one joint turned round, a sign error (docs/measured.md). It is named where that
joint is among those that are doubted.
"""

import tempfile
from pathlib import Path

import numpy as np
from common import options, row, table
from stranger import Machine, urdf, write_machine

import hydroid
from hydroid.advice.assumptions import doubts


def doubted(folder: Path, logs: list[Path]) -> tuple[list[int], str]:
    """Return the joints that are doubted in a project of the folder's arm, and a text
    with the evidence."""
    hydroid.init(folder / "mine", arm=folder / "robot.urdf", log=[*logs], force=True)
    settings = hydroid.load_settings(folder / "mine" / "fit.yaml")
    found = doubts(settings, hydroid.read_logs(logs, settings))
    return [*found], ", ".join(
        f"{joint} ({evidence:.1f})" for joint, evidence in found.items()
    )


if __name__ == "__main__":
    given, counts = options(__doc__, machines=20, first=0, seed=3), np.zeros(3, int)
    table(
        "machine | turned round | doubted, arm as it is | doubted, one turned (evidence)"
    )
    for number in range(given.first, given.first + given.machines):
        rng = np.random.default_rng([given.seed, number])
        machine = Machine(rng, number)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            logs = write_machine(folder, machine, rng)
            right, right_text = doubted(folder, logs)
            wrong = int(rng.choice(np.flatnonzero(~machine.vertical)))
            (folder / "robot.urdf").write_text(urdf(machine, wrong))
            turned, turned_text = doubted(folder, logs)
        counts += [wrong + 1 in turned, turned[:1] == [wrong + 1], bool(right)]
        row(number, wrong + 1, right_text, turned_text)
    print(
        f"\nNamed {counts[0]}, first {counts[1]} of {given.machines}; false alarms {counts[2]}."
    )
