"""A policy in the environment of any run: `python examples/gym_env.py [RUN]`, of a fit
or the shipped arm.

`hydroid.VectorEnv` steps several machines in one call; here a proportional policy
brings their joints to random angles. With a fit, all but the first are machines that
the logs do not rule out.
"""

import sys

import numpy as np

import hydroid
from hydroid.errors import HydroidError
from hydroid.plant import load_plant
from hydroid.use.environment import VectorEnv

MACHINES, SECONDS, GAIN = 4, 5.0, 10.0


def make_env(source: str) -> VectorEnv:
    """Return machines of a run's draws, or of its estimate where there is nothing to
    draw from."""
    model = load_plant(source).identified
    try:
        return hydroid.VectorEnv(model, MACHINES, seconds=SECONDS)
    except HydroidError:
        return hydroid.VectorEnv(model, MACHINES, seconds=SECONDS, seed=None)


if __name__ == "__main__":
    source = sys.argv[1] if len(sys.argv) > 1 else "article-hyd"
    plant, envs = load_plant(source), make_env(source)
    columns = [joint - 1 for joint in envs.joints]
    # a positive command lowers the angle of some joints
    senses = np.array(
        [np.sign(plant.speeds({plant.names[k]: 100.0})[k]) for k in columns]
    )
    seen, _ = envs.reset(seed=1)
    over = np.zeros(MACHINES, dtype=bool)
    while not over.any():
        distance = seen[:, len(columns) : 2 * len(columns)]
        seen, *_, over, _ = envs.step(
            np.clip(GAIN * senses * distance, -1.0, 1.0).astype(np.float32)
        )
    left = np.abs(seen[:, len(columns)]).round(4).tolist()
    print(
        f"error of {plant.names[columns[0]]} after {SECONDS:.0f} s [half ranges]: {left}"
    )
