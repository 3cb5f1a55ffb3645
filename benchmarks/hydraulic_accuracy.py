"""How exact the hydraulics are over the whole search space (takes minutes).

One joint against Radau (rtol 1e-8) of the full coupled equations: feasible parameter
sets drawn from 0.25 to 2.5 times the article's values, 30 s of pseudo-random pulses,
several sub-steps and MuJoCo steps.
"""

import numpy as np
from common import Clock, options, table
from hydraulic_reference import draw, parameters, pulses, reference, simulate

from hydroid.settings.hydraulics import HydraulicSettings

STEPS = [(1, 1), (1, 2), (1, 3), (1, 4), (1, 5), (1, 10), (2, 4), (4, 4)]
"""MuJoCo's steps in a sample, and sub-steps of the oil in each"""

if __name__ == "__main__":
    sets = options(__doc__, sets=24).sets
    rng, clock = np.random.default_rng(1), Clock()
    command = pulses(rng, 3000)
    candidates = parameters(HydraulicSettings(), **draw(rng, sets))
    pairs = [reference(candidates[i : i + 1], command, 1e-8) for i in range(sets)]  # pyright: ignore[reportArgumentType]
    exact, pressure = zip(*pairs, strict=True)
    angle, bar, errors = np.degrees(exact), 1e-5 * np.array(pressure), []
    print(
        f"{sets} sets, 30 s, joint from {angle.min():.0f} to {angle.max():.0f} deg; Radau took {clock}"
    )
    for steps, substeps in STEPS:
        seen: list = []
        out = simulate(
            candidates, command, HydraulicSettings(substeps=substeps), steps, seen
        )
        error = np.degrees(out) - angle
        rms, worst = np.sqrt((error**2).mean(axis=1)), abs(error).max(axis=1)
        p = 1e-5 * np.stack([o.pressure[:, 0] for o, _ in seen], axis=1)
        p_rms = np.median(np.sqrt(((p - bar[:, 1:]) ** 2).mean(axis=(1, 2))))
        errors.append((np.median(rms), rms.max(), np.median(worst), worst.max(), p_rms))
    table(
        "MuJoCo steps | sub-steps | median rms | worst rms | median max | worst max [deg] | p rms [bar]",
        "{} | {} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.4f}",
        *(*np.transpose(STEPS), *np.transpose(errors)),
    )
