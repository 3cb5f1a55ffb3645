"""Six hydraulic joints at once, 54 parameters, one log of 75 s: time, simulations and error; then per joint.

Start values are those of the arm's file and of `START`, none of them tuned to this log. --seconds cuts it.
"""

import numpy as np
from common import EXAMPLES, Clock, options

import hydroid

LOG = EXAMPLES / "logs" / "rig_all_joints_1.csv"
START = {
    "A_A": {"quantity": "area_a", "within": 2},
    "A_B": {"quantity": "area_b", "within": 2},
    "open_A": {"quantity": "opening_a", "within": 4},
    "open_B": {"quantity": "opening_b", "within": 4},
    "overlap_A": {"quantity": "overlap_a", "bounds": [0.0, 1.0], "start": 0.1},
    "overlap_B": {"quantity": "overlap_b", "bounds": [0.0, 1.0], "start": 0.1},
    "delay": {"quantity": "delay", "bounds": [0.0, 0.2], "start": 0.02},
    "friction": {"quantity": "dry_friction", "bounds": [0.0, 1000.0], "start": 20.0},
    "D": {"quantity": "damping", "bounds": [1.0, 1000.0], "start": 50.0},
}
SETTINGS = {
    "parameters": {name: p | {"each": [1, 2, 3, 4, 5, 6]} for name, p in START.items()},
    "outputs": [1, 2, 3, 4, 5, 6],
    "objective": {"norm": 2, "segments": 1},
    "search.algorithm": "multistart",
    "search.multistart": {"starts": 1, "horizons": [5.0, 20.0], "iterations": 30, "gain_tolerance": 1e-3},
    "refinement": {"iterations": 40, "gain_tolerance": 1e-4},
}

if __name__ == "__main__":
    settings = hydroid.load_settings("fit-hyd", SETTINGS)
    logs = [log.first(options(__doc__, seconds=1e9).seconds) for log in hydroid.read_logs([LOG], settings)]
    clock, result = Clock(), hydroid.fit(settings, logs)
    fit, count = result.fit, len(result.problem.parameters.names)
    assert fit.refinement is not None
    simulations, ending = int(fit.history[-1, 2]) + fit.refinement.evaluations, fit.refinement.ending.value
    print(f"{count} parameters, {logs[0].duration:g} s of log, {clock}, {simulations} simulations: {ending}")
    for estimate in fit.estimates.values():
        print(f"{estimate.name}: rms {np.rad2deg(estimate.rms):.3f} deg")
    error = np.rad2deg(np.abs(logs[0].angle[:, :6] - fit.best.responses[0]).mean(axis=0))
    print("mean absolute [deg], joints 1 to 6:", *(f"{e:.3f}" for e in error))
