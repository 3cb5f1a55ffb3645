"""Six hydraulic joints at once, 54 parameters, one log of 75 s: time, simulations and
error; then per joint.

six_joints.yaml has the settings. --seconds cuts the log.
"""

from pathlib import Path

import numpy as np
from common import EXAMPLES, Clock, options

import hydroid

LOG = EXAMPLES / "logs" / "rig_all_joints_1.csv"

if __name__ == "__main__":
    settings = hydroid.load_settings(Path(__file__).with_suffix(".yaml"))
    logs = [
        log.first(options(__doc__, seconds=1e9).seconds)
        for log in hydroid.read_logs([LOG], settings)
    ]
    clock, result = Clock(), hydroid.fit(settings, logs)
    fit, count = result.fit, len(result.problem.parameters.names)
    assert fit.refinement is not None
    simulations, ending = (
        int(fit.history[-1, 2]) + fit.refinement.evaluations,
        fit.refinement.ending.value,
    )
    print(
        f"{count} parameters, {logs[0].duration:g} s of log, {clock}, {simulations} simulations: {ending}"
    )
    for estimate in fit.estimates.values():
        print(f"{estimate.name}: rms {np.rad2deg(estimate.rms):.3f} deg")
    error = np.rad2deg(
        np.abs(logs[0].angle[:, :6] - fit.best.responses[0]).mean(axis=0)
    )
    print("mean absolute [deg], joints 1 to 6:", *(f"{e:.3f}" for e in error))
