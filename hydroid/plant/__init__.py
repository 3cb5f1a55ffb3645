"""The plant: an identified arm, hydraulics included, to be stepped in a program of one's own.

    plant = load_plant("runs/a")
    q = plant.reset()
    while plant.time < 10:
        q = plant.step(controller(q))

It gives, bit for bit, what the simulations of a fit give; contacts are off as there. `plant.model` and
`plant.data` are MuJoCo's: what acts on them (`xfrc_applied`, a changed `qpos`) acts on the plant;
`qfrc_applied` is its own. Between two steps use `mj_kinematics` to refresh the positions of bodies.
"""

from hydroid.plant.load import load_plant
from hydroid.plant.plant import Plant

__all__ = ["Plant", "load_plant"]
