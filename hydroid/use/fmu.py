"""A plant as an FMU for co-simulation (FMI 2), by pythonfmu: for Simulink,
OpenModelica, Dymola and others.

The file holds the plant and a script that steps it. Where it runs, Python must find
hydroid.
"""

import re
import tempfile
from importlib import import_module
from pathlib import Path

from hydroid.errors import RunError
from hydroid.files import fill_template
from hydroid.plant import Plant


def fmu_bytes(plant: Plant) -> bytes:
    """Return a plant as an FMU: inputs `u_JOINT` [%], outputs `q_JOINT` [rad, m], from
    its start pose.

    Raises:
        RunError: pythonfmu is not installed.
    """
    try:
        builder = import_module("pythonfmu.builder").FmuBuilder
    except ImportError:
        raise RunError(
            "needs the package pythonfmu", "--to fmu", "pip install 'hydroid[fmu]'"
        ) from None
    columns = [joint - 1 for joint in plant.joints]
    names = [plant.names[column] for column in columns]
    joints = {name: re.sub(r"\W", "_", name) for name in names}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        plant.save(folder / "plant")
        script = folder / "hydroid_plant.py"
        script.write_text(
            fill_template("use/fmu.py.j2", joints=joints, columns=columns),
            encoding="utf-8",
        )
        built = builder.build_FMU(
            script, dest=folder / "out", project_files=[folder / "plant"]
        )
        return Path(built).read_bytes()
