"""The arm in motion under its hydraulics: in a window, or as a film.

Its modules import MuJoCo, which looks then for a way to render: `choose_platform` comes
first.
"""

import os
import subprocess
import sys

PLATFORMS = "egl", "osmesa"
"""what MuJoCo renders with where there is no display, the fastest first"""
_TRIAL = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).render()"


def choose_platform() -> None:
    """Choose a way to render that needs no window and works on this machine.

    MUJOCO_GL has precedence.
    """
    if sys.platform == "linux" and not os.environ.get("MUJOCO_GL"):
        working = next(filter(renders, PLATFORMS), None)
        os.environ |= {"MUJOCO_GL": working} if working else {}


def renders(platform: str) -> bool:
    """Return whether MuJoCo can draw with a platform here: its library may be there
    without a driver.

    It is tried in a process of its own, since a process can load only one.
    """
    environment = os.environ | {"MUJOCO_GL": platform}
    trial = subprocess.run(
        [sys.executable, "-c", _TRIAL], env=environment, capture_output=True
    )
    return trial.returncode == 0
