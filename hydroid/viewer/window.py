"""A motion on the screen, in MuJoCo's own viewer and in real time."""

import sys
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

from hydroid.errors import RunError
from hydroid.viewer.film import add_ghost, look_at
from hydroid.viewer.motion import Playback

FRAME = 1 / 60  # between two pictures of the viewer [s]
LATE = 0.1  # a machine too slow by this [s] shows slow motion instead of jumps


def play(
    playback: Playback,
    viewer: Any,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Show what moves in real time until the window is closed; the viewer's reset starts it again.

    `viewer` is a `mujoco.viewer.Handle`, or what behaves like one.

    Raises:
        RunError: the simulation diverged.
    """
    begun = clock()
    while viewer.is_running():
        frame = clock()
        late = frame - begun - playback.time - LATE
        begun += max(0.0, late) if playback.time < playback.duration else 0.0
        playback.advance(frame - begun)
        viewer.user_scn.ngeom = 0
        add_ghost(playback, viewer.user_scn, (viewer.cam.azimuth, viewer.cam.elevation))
        before = playback.data.time
        viewer.sync()
        if playback.data.time < before:
            playback.restart()
            begun = clock()
        sleep(max(0.0, FRAME - (clock() - frame)))


def show(playback: Playback) -> None:
    """Show a playback in MuJoCo's viewer until its window is closed.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
    """
    others = set(threading.enumerate())
    try:
        import glfw  # the window library, which a cluster may lack
        import mujoco.viewer

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # glfw says in warnings what it returns as well
            if sys.platform != "darwin" and not glfw.init():  # the viewer would end the whole program
                raise RuntimeError("no display")
        viewer = mujoco.viewer.launch_passive(playback.model, playback.data, show_left_ui=False)
    except (ImportError, RuntimeError) as error:
        hint = "without a display write a file: hydroid view RUN -o arm.mp4"
        raise RunError(f"no window can be opened ({error})", hint=hint) from None
    drawing = set(threading.enumerate()) - others
    try:
        with viewer.lock():
            look_at(viewer.cam, playback.model)
        play(playback, viewer)
    finally:
        viewer.close()
        for thread in drawing:  # a program that ends while it still draws crashes
            thread.join(5.0)
