"""A boom and a bar against gravity with one pump, simulated without oil: fits take seconds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from arms import BOOM, write_arm

import hydroid
from hydroid.log import Log
from hydroid.prediction import simulate_log
from hydroid.settings.fit import FitSettings

PERIOD = 0.05
PARAMETERS = {
    "open_A": {"quantity": "opening_a", "each": True, "within": 4},
    "open_B": {"quantity": "opening_b", "each": True, "within": 4},
    "M": {"quantity": "mass", "each": ["boom", "bar"], "within": 2},
    "flow": {"quantity": "pump_flow", "within": 3},
    "droop": {"quantity": "pump_droop", "within": 3},
}
OPENINGS = {"open_A_1": 24.0, "open_A_2": 3.0, "open_B_1": 16.0, "open_B_2": 4.0}
TRUTH = OPENINGS | {"M_boom": 1300.0, "M_bar": 110.0, "flow": 120.0, "droop": 60.0}


def two_joints(folder: Path, model: str = BOOM, **settings) -> FitSettings:
    """Settings of a fit of both joints."""
    sizes = {"lift": (8000, 20), "tilt": (400, 3)}
    actuators = {
        n: {"kind": "rotary", "displacement": size, "max_opening": area} for n, (size, area) in sizes.items()
    }
    write_arm(folder, model, actuators=actuators)
    document = {
        "stage": "hyd",
        "arm": "arm.yaml",
        "outputs": [1, 2],
        "free_start": False,
        "log": {"period_s": PERIOD},
        "simulation": {"model": "quasi-static", "threads": 1},
        "hydraulics": {
            "supply_pressure": 200,
            "dead_band": 20,
            "delay": 0.1,
            "pump_flow": 120,
            "pump_droop": 60,
            "onset": 0,
        },
        "objective": {"norm": 2, "segments": 1},
        "parameters": PARAMETERS,
    }
    (folder / "fit.yaml").write_text(yaml.safe_dump(document | settings))
    return hydroid.load_settings(folder / "fit.yaml")


def drive(
    settings: FitSettings, seed: int = 0, truth: dict[str, float] = TRUTH, seconds: float = 20.0
) -> Log:
    """A log of the true arm that keeps off its stops, with 0.02 deg of noise."""
    rng = np.random.default_rng(seed)
    samples = 400
    command, angle = np.zeros((samples, 2)), np.tile(rng.uniform(0.1, 0.4, 2), (samples, 1))
    command[-1] = 50.0  # both are driven
    time = PERIOD * np.arange(samples)
    log = Log(f"drive_{seed}.csv", time, command, angle, PERIOD)
    for start in range(10, samples, 30):  # each level lasts 1.5 s
        levels = rng.uniform(40, 100, 2)
        now = simulate_log(settings, log, truth, "truth").angle[start]
        command[start : start + 20] = np.where(now > np.array([0.3, 0.2]), -levels, levels)
    exact = simulate_log(settings, log, truth, "truth")
    return replace(exact, angle=exact.angle + rng.normal(0, np.radians(0.02), angle.shape))
