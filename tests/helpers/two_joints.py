"""A boom and a bar against gravity with one pump, simulated without oil: fits take
seconds."""

from pathlib import Path

import numpy as np
import yaml
from arms import BOOM, MODELS, write_arm
from made_logs import at_rest, noisy, simulate_log

import hydroid
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

PERIOD = 0.05
FIT = yaml.safe_load((MODELS / "two_joints.yaml").read_text())
PARAMETERS = FIT["parameters"]
OPENINGS = {
    "open_A_lift": 24.0,
    "open_A_tilt": 3.0,
    "open_B_lift": 16.0,
    "open_B_tilt": 4.0,
}
TRUTH = OPENINGS | {"M_boom": 1300.0, "M_bar": 110.0, "flow": 120.0, "droop": 60.0}


def two_joints(folder: Path, model: str = BOOM, **settings) -> FitSettings:
    sizes = {"lift": (8000, 20), "tilt": (400, 3)}
    actuators = {
        n: {"kind": "rotary", "displacement": d, "max_opening": a}
        for n, (d, a) in sizes.items()
    }
    write_arm(folder, model, actuators=actuators)
    (folder / "fit.yaml").write_text(yaml.safe_dump(FIT | settings))
    return hydroid.load_settings(folder / "fit.yaml")


def drive(settings: FitSettings, seed: int = 0, truth: dict[str, float] = TRUTH) -> Log:
    """A log of the true arm that keeps off its stops, with 0.02 deg of noise."""
    rng = np.random.default_rng(seed)
    samples = 400
    pose, command = rng.uniform(0.1, 0.4, 2), np.zeros((samples, 2))
    command[-1] = 50.0  # both are driven
    log = at_rest(pose, command, PERIOD, f"drive_{seed}.csv")
    for start in range(10, samples, 30):  # each level lasts 1.5 s
        levels = rng.uniform(40, 100, 2)
        now = simulate_log(settings, log, truth).angle[start]
        command[start : start + 20] = np.where(
            now > np.array([0.3, 0.2]), -levels, levels
        )
    return noisy(simulate_log(settings, log, truth), 0.02, rng, exact_start=False)
