"""Pictures without a display: which OpenGL, and what to say where there is none."""

import os
import sys
from ctypes.util import find_library
from typing import Any

from hydroid.errors import RunError

PLATFORMS = (("egl", "EGL"), ("osmesa", "OSMesa"))
"""values of MUJOCO_GL that need no display, the fastest first, and their libraries"""


def choose_platform() -> None:
    """Choose a way to render that needs no window; MuJoCo looks for the choice when it is imported."""
    for name, library in PLATFORMS:
        if sys.platform == "linux" and find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)


def make_renderer(model: Any, width: int, height: int) -> Any:
    """Return MuJoCo's renderer of pictures of a size [px]; it is a context.

    Raises:
        RunError: this machine cannot render.
    """
    import mujoco

    model.vis.global_.offwidth = max(model.vis.global_.offwidth, width)
    model.vis.global_.offheight = max(model.vis.global_.offheight, height)
    try:
        return mujoco.Renderer(model, height=height, width=width)
    except (mujoco.FatalError, ImportError, RuntimeError, AttributeError) as error:
        wanted = os.environ.get("MUJOCO_GL")
        found = [name for name, library in PLATFORMS if find_library(library)]
        if sys.platform == "linux" and not found:
            hint = "install libEGL or libOSMesa (Debian: libegl1 or libosmesa6; neither needs a GPU)"
        else:
            others = [name for name in found if name != wanted] or ["egl"]
            hint = f"set MUJOCO_GL={others[-1]} in the environment before Python starts"
        what = f"no picture can be rendered (MUJOCO_GL={wanted}: {' '.join(str(error).split())})"
        raise RunError(what, hint=hint) from None
