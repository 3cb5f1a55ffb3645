"""The machines of the gallery that `make demo` and `make excavator` do not fit: a boom
with logs of constant commands, a truck's crane and a forwarder's, each with a telescope.

    python docs/machines.py [runs]     # fits what is missing: runs/boom, runs/crane, runs/forwarder

The cranes and their logs are those of `tests/helpers/worlds.py`: boxes, and valves of
equations that are not hydroid's. Each is fitted to one log, as `hydroid init` sets it
up, and judged on another.
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests" / "helpers"))

from worlds import BOOM, CRANE, LONG, SWING, Joint, World, named, write_log

import hydroid

ROOT = Path(__file__).parents[1]
TELESCOPE: Joint = (
    "telescope",
    "boom_link",
    "telescope_link",
    "prismatic",
    (1.4, 0, 0),
    "0 1.4",
)
ON_A_TRUCK = ("swing", "boom", "telescope")
WORLDS = {
    "crane": World(ON_A_TRUCK, (SWING, BOOM, TELESCOPE), named(*ON_A_TRUCK)),
    "forwarder": World(LONG, CRANE, named(*LONG)),
}
SECONDS = 60.0  # of a log
BUDGET = "10min"  # of a fit


def fit_boom(run: Path) -> None:
    """Fit the boom of the examples, and judge it on the logs that are left."""
    example = ROOT / "examples" / "boom"
    fitted = sorted(example.glob("fit_*.csv"))
    hydroid.fit_hyd(fitted, config=example / "fit.yaml", out=run / "fit")
    others = sorted(example.glob("check_*.csv"))
    hydroid.validate(others, fit=run / "fit", out=run / "validation")


def fit_world(name: str, run: Path) -> None:
    """Make an arm and two logs; fit it to one, and judge it on the other."""
    run.mkdir(parents=True, exist_ok=True)
    world = WORLDS[name]
    log = write_log(world, run / "log.csv", SECONDS, 1)
    other = write_log(world, run / "other.csv", SECONDS, 2)
    hydroid.init(run / "mine", arm=world.write(world, run), log=log)
    config = run / "mine" / "fit.yaml"
    hydroid.fit_hyd(log, config=config, out=run / "fit", budget=BUDGET)
    hydroid.validate(other, fit=run / "fit", out=run / "validation")


def main(runs: Path) -> None:
    """Fit the machines that have no finished run there."""
    for name in ("boom", *WORLDS):
        if (runs / name / "validation").exists():
            continue
        print(f"{name} ...", flush=True)
        if name == "boom":
            fit_boom(runs / name)
        else:
            fit_world(name, runs / name)


if __name__ == "__main__":
    main(Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "runs")
