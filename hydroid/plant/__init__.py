"""The plant: an identified arm, hydraulics included, to be stepped in a program of
one's own.

    plant = load_plant("runs/a")
    q = plant.reset()
    while plant.time < 10:
        q = plant.step(controller(q))

It gives, bit for bit, what the simulations of a fit give; contacts are off as there.
`plant.model` and `plant.data` are MuJoCo's: what acts on them (`xfrc_applied`, a
changed `qpos`) acts on the plant; `qfrc_applied` is its own. Between two steps use
`mj_kinematics` to refresh the positions of bodies.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydroid.errors import SettingsError
from hydroid.identified_model import load_identified
from hydroid.plant.batch import PlantBatch
from hydroid.plant.plant import Plant, PlantState
from hydroid.plant.steady import Limit, SteadyCommands

__all__ = ["Limit", "Plant", "PlantBatch", "PlantState", "SteadyCommands", "load_plant"]


def load_plant(
    source: Any, *, overrides: Mapping[str, Any] | None = None, **how: Any
) -> Plant:
    """Read a plant.

    Args:
        source: the result of a fit, or an `IdentifiedModel`; a run folder, or a folder
            that `Plant.save` wrote; or settings of stage hyd, a path or a shipped name
            such as "article-hyd". Parameters that these do not fix are then nominal: as
            the hydraulics and the arm's file have them, and 0 for dampers and springs.
        overrides: settings to replace in what is read, by dotted key.
        how: keywords of `Plant`.

    Raises:
        RunError: the folder holds no estimate.
        SettingsError: what `Plant` refuses, a file that cannot be read, or nominal
            parameters of stage mech.
    """
    if not isinstance(source, str | Path):
        identified = getattr(source, "model", source)
    elif Path(source).is_dir():
        identified = load_identified(source, overrides=overrides)
    else:
        identified = load_identified(None, source, overrides, nominal=True)
        if identified.settings.stage == "mech":
            raise SettingsError(
                "stage mech has no nominal gain", source, "name a run folder"
            )
    return Plant(identified, **how)
