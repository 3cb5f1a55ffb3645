"""The arm in motion under its hydraulics: in a window, or as a film.

Its modules import MuJoCo, which looks then for a way to render: `choose_platform` comes first.
"""

import os
import sys
from ctypes.util import find_library


def choose_platform() -> None:
    """Choose a way to render that needs no window."""
    for name, library in (("egl", "EGL"), ("osmesa", "OSMesa")):
        if sys.platform == "linux" and find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)
