"""Make the logs of the example's boom: one joint, constant duties, up from its stop and down from above.

    python examples/boom/make_logs.py

NO MACHINE: a virtual boom. `benchmarks/virtual_boom.py` simulates it in plain equations of its own.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from virtual_boom import NOISE_DEG, PERIOD, REST, STAGES, boom

FITTED, UNSEEN = (40, 60, 100), (50, 80)


def main(folder: Path) -> None:
    """Write one CSV per duty and direction."""
    rng = np.random.default_rng(0)
    for way, (_, sign) in STAGES.items():
        for duty in (*FITTED, *UNSEEN):
            angle = np.degrees(boom(duty, way)) + rng.normal(0, NOISE_DEG, round(5.0 / PERIOD) + 1)
            time = PERIOD * np.arange(len(angle))
            command = np.where(time >= REST - 1e-9, sign * duty, 0.0)
            kind = "fit" if duty in FITTED else "check"
            rows, header = np.column_stack([time, command, angle]), "time [s],duty [%],angle [deg]"
            path = folder / f"{kind}_{way}_{duty}.csv"
            np.savetxt(path, rows, fmt="%.5g", delimiter=",", header=header, comments="")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
