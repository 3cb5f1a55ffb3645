"""A plant on the screen, in MuJoCo's own viewer and in real time; or as pictures in a file."""

import io
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, Protocol

import mujoco

from hydroid.errors import RunError
from hydroid.plant import Plant
from hydroid.viewer.playback import Playback

FRAME = 1 / 60  # between two pictures of the viewer [s]
LATE = 0.1  # a machine too slow by this [s] shows slow motion instead of jumps
CLOSING = 5.0  # the longest that closing the window may take [s]
GIF_FRAME, SIZE = 0.1, (480, 360)  # between two pictures of a file [s]; their size [px]


def show(playback: Playback) -> None:
    """Show a playback in MuJoCo's viewer until its window is closed.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
    """
    with window(playback.plant) as viewer:
        play(playback, viewer)


class Viewer(Protocol):
    """What is used of `mujoco.viewer.Handle`."""

    def is_running(self) -> bool: ...  # noqa: D102
    def sync(self) -> None: ...  # noqa: D102
    def set_texts(self, texts: Any) -> None: ...  # noqa: D102


def play(
    playback: Playback,
    viewer: Viewer,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Show a plant in real time until the window is closed; the viewer's reset starts it again.

    Raises:
        RunError: the simulation diverged.
    """
    plant, begun = playback.plant, clock()
    while viewer.is_running():
        frame = clock()
        begun += max(0.0, frame - begun - plant.time - LATE) if plant.time < playback.duration else 0.0
        playback.advance(frame - begun)
        viewer.set_texts((None, None, *playback.captions()))
        before = plant.data.time
        viewer.sync()
        if plant.data.time < before:
            playback.restart()
            begun = clock()
        sleep(max(0.0, FRAME - (clock() - frame)))


@contextmanager
def window(plant: Plant) -> Generator[Viewer]:
    """Open MuJoCo's viewer on a plant; it closes with the context.

    Raises:
        RunError: this machine cannot show a window.
    """
    others = set(threading.enumerate())
    try:
        import mujoco.viewer  # loads the window library, which a cluster may lack

        if sys.platform != "darwin":
            _try_window()
        viewer = mujoco.viewer.launch_passive(plant.model, plant.data, show_left_ui=False)
    except (ImportError, RuntimeError) as error:
        hint = "without a display write a file with --gif OUT.gif"
        raise RunError(f"no window can be opened ({error})", hint=hint) from None
    drawing = set(threading.enumerate()) - others
    try:
        with viewer.lock():
            viewer.cam.lookat[:] = plant.model.stat.center
            viewer.cam.distance = 2.3 * plant.model.stat.extent
            # where the model's camera `corner` stands
            viewer.cam.azimuth, viewer.cam.elevation = 135.0, -25.0
        yield viewer
    finally:
        viewer.close()
        for thread in drawing:  # a program that ends while it still draws crashes
            thread.join(CLOSING)


def _try_window() -> None:
    """Open and close a hidden window: where the viewer cannot, it ends the whole program."""
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # glfw says in warnings what it returns as well
        opened = glfw.init()
        if opened:
            glfw.window_hint(glfw.VISIBLE, False)
            opened = glfw.create_window(64, 64, "", None, None)
            glfw.terminate()
    if not opened:
        raise RuntimeError("no display, or no OpenGL on it")


def animation(playback: Playback, camera: str = "corner") -> bytes:
    """Render a playback to its end as an animated GIF.

    Raises:
        RunError: the simulation diverged, or this machine cannot render.
    """
    from PIL import Image  # comes with matplotlib

    plant = playback.plant
    try:
        renderer = mujoco.Renderer(plant.model, height=SIZE[1], width=SIZE[0])
    except (mujoco.FatalError, ImportError, RuntimeError, AttributeError) as error:
        hint = "install libEGL or libOSMesa (Mesa's need no GPU)"
        raise RunError(f"no picture can be rendered ({error})", hint=hint) from None
    frames: list[Image.Image] = []
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # most of the time where there is no GPU
    named = mujoco.mj_name2id(plant.model, mujoco.mjtObj.mjOBJ_CAMERA, camera) >= 0
    with renderer:
        for k in range(round(playback.duration / GIF_FRAME) + 1):
            playback.advance(k * GIF_FRAME)
            renderer.update_scene(plant.data, camera if named else -1)
            frames.append(Image.fromarray(renderer.render()).quantize(128))
    buffer, pause = io.BytesIO(), round(1e3 * GIF_FRAME)  # [ms]
    frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], duration=pause, loop=0)
    return buffer.getvalue()
