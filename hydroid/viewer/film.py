"""A motion on the screen, as a film or a picture: the simulated machine over the
measured one, its ghost.
"""

import io
import os
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hydroid.arrays import Limits
from hydroid.errors import RunError, SettingsError
from hydroid.progress import Progress, no_progress
from hydroid.reporting.outlines import sight
from hydroid.viewer.motion import Motion, Playback, Region, Replay

Picture = NDArray[np.uint8]

KINDS = {
    ".mp4": ((1920, 1080), 20.0),
    ".gif": ((960, 540), 10.0),
    ".png": ((1920, 1080), 0.0),
}
"""width and height of a file's pictures [px], and pictures in a second"""


def rendered(
    motion: Motion, size: tuple[int, int], frames: Iterable[tuple[float, str]]
) -> Iterator[Picture]:
    """Yield a machine at times [s], a text above each, in a size [px]: RGB, shape
    (height, width, 3).
    """
    replay = Replay(motion)
    width, height = size
    look = replay.model.vis
    look.global_.offwidth = width
    look.global_.offheight = height
    # the map covers what the camera sees, or its border shows as dots on the floor
    look.map.shadowclip = 3.0
    look.quality.shadowsize = 4096
    try:
        with warnings.catch_warnings():
            # glfw says in warnings what the error says as well
            warnings.simplefilter("ignore")
            renderer = mujoco.Renderer(replay.model, height=height, width=width)
    except (mujoco.FatalError, ImportError, RuntimeError, AttributeError) as error:
        how = f"MUJOCO_GL={os.environ.get('MUJOCO_GL')}: {' '.join(str(error).split())}"
        hint = "install libegl1 or libosmesa6, and set MUJOCO_GL=egl or osmesa before Python starts"
        raise RunError(f"no picture can be rendered ({how})", hint=hint) from None
    camera = mujoco.MjvCamera()
    look_at(camera, replay.model, replay.region)
    letters = height // 30
    font = ImageFont.load_default(letters)
    corner = (letters, letters // 2)
    with renderer:
        for time, text in frames:
            replay.advance(time)
            renderer.update_scene(replay.data, camera)
            add_ghost(replay, renderer.scene, camera)
            picture = Image.fromarray(renderer.render())
            ImageDraw.Draw(picture).text(corner, text, "black", font)
            yield np.asarray(picture)


def render_motion(
    motion: Motion,
    kind: str,
    span: Limits,
    progress: Progress = no_progress,
) -> bytes:
    """Return the content of a film of a motion in a span [s], or of a picture of its
    beginning (.png).
    """
    begin = max(span[0], 0.0)
    end = min(span[1], motion.time[-1])
    if not begin < end:
        what = f"{span[0]:g}:{span[1]:g} s is empty"
        hint = f"write FROM:TO in seconds; the motion ends at {motion.time[-1]:g} s"
        raise SettingsError(what, "--span", hint)
    size, rate = KINDS[kind]
    count = max(1, int(np.ceil((end - begin) * rate - 1e-9)))
    error = ""
    if np.isfinite(motion.error):
        error = f", rms error {motion.error:.2g}°"

    def frames() -> Iterator[tuple[float, str]]:
        for k in range(count):
            progress("pictures", k, count)
            time = begin + k / max(rate, 1.0)
            yield time, f"{time:.1f} s{error}"

    pictures = rendered(motion, size, frames())
    if kind == ".mp4":
        return _mp4(pictures)
    if kind == ".gif":
        return _gif(pictures)
    return _png(pictures)


def look_at(camera: mujoco.MjvCamera, model: mujoco.MjModel, region: Region) -> None:
    """Point a camera at a whole machine, so far away that its region is inside the
    picture."""
    camera.lookat[:] = region.centre
    camera.distance = region.radius / np.sin(np.radians(model.vis.global_.fovy) / 2)
    camera.azimuth = 125.0  # [deg]
    camera.elevation = -18.0  # [deg]


def add_ghost(
    playback: Playback, scene: mujoco.MjvScene, camera: mujoco.MjvCamera
) -> None:
    """Add what moves of a playback's ghost, if it has one, to a scene, blue and
    translucent.

    It stands 4 mm farther away from the camera: where both machines agree only the
    simulated one is seen, and their surfaces do not flicker.
    """
    if playback.ghost is None:
        return
    first = scene.ngeom
    mujoco.mjv_addGeoms(
        playback.model,
        playback.ghost,
        mujoco.MjvOption(),
        mujoco.MjvPerturb(),
        mujoco.mjtCatBit.mjCAT_DYNAMIC,  # what stands still is the same for both
        scene,
    )
    for geom in scene.geoms[first : scene.ngeom]:
        geom.rgba[:] = (0.12, 0.44, 0.82, 0.42)
        geom.matid = -1  # a material's colour would hide this one
        geom.transparent = 1
        geom.pos[:] += 0.004 * sight(camera.azimuth, camera.elevation)[2]


def _png(pictures: Iterable[Picture]) -> bytes:
    """Return the first of some pictures as a file."""
    content = io.BytesIO()
    Image.fromarray(next(iter(pictures))).save(content, "PNG", optimize=True)
    return content.getvalue()


def _gif(pictures: Iterable[Picture]) -> bytes:
    # dithering would flicker from picture to picture
    few_colours = [
        Image.fromarray(picture).quantize(96, dither=Image.Dither.NONE)
        for picture in pictures
    ]
    pause = round(1e3 / KINDS[".gif"][1])  # [ms]
    content = io.BytesIO()
    few_colours[0].save(
        content,
        "GIF",
        save_all=True,
        append_images=few_colours[1:],
        duration=pause,
        loop=0,
        optimize=True,
    )
    return content.getvalue()


def _mp4(pictures: Iterable[Picture]) -> bytes:
    try:
        import av
    except ImportError:
        hint = "pip install 'hydroid[film]', or write a .gif"
        raise RunError("an mp4 needs the package av", hint=hint) from None
    content = io.BytesIO()
    (width, height), rate = KINDS[".mp4"]
    with av.open(content, "w", format="mp4") as file:
        stream: Any = file.add_stream("libx264", rate=round(rate))
        stream.width = width
        stream.height = height
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "fast"}
        for picture in pictures:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())
    return content.getvalue()


FRAME = 1 / 60
"""time between two pictures of the viewer [s]"""
LONGEST_WAIT = 0.1
"""a machine too slow by this shows slow motion instead of jumps [s]"""


def play(playback: Playback, viewer: Any) -> None:
    """Show what moves in real time until the window is closed; the viewer's reset
    starts it again.

    `viewer` is a `mujoco.viewer.Handle`, or what behaves like one.
    """
    clock = time.perf_counter
    begun = clock()
    while viewer.is_running():
        frame = clock()
        behind = frame - begun - playback.time - LONGEST_WAIT
        begun += max(0.0, behind) if playback.time < playback.duration else 0.0
        playback.advance(frame - begun)
        viewer.user_scn.ngeom = 0
        add_ghost(playback, viewer.user_scn, viewer.cam)
        before = playback.data.time
        viewer.sync()
        if playback.data.time < before:
            playback.restart()
            begun = clock()
        time.sleep(max(0.0, FRAME - (clock() - frame)))


def show(playback: Playback) -> None:
    """Show a playback in MuJoCo's viewer until its window is closed."""
    others = set(threading.enumerate())
    try:
        import glfw  # the window library, which a cluster may lack
        import mujoco.viewer

        with warnings.catch_warnings():
            # glfw says in warnings what it returns as well
            warnings.simplefilter("ignore")
            # the viewer would end the whole program
            if sys.platform != "darwin" and not glfw.init():
                raise RuntimeError("no display")
        viewer = mujoco.viewer.launch_passive(
            playback.model, playback.data, show_left_ui=False
        )
    except (ImportError, RuntimeError) as error:
        hint = "without a display write a file: hydroid view RUN -o arm.mp4"
        raise RunError(f"no window can be opened ({error})", hint=hint) from None
    drawing = set(threading.enumerate()) - others
    try:
        with viewer.lock():
            look_at(viewer.cam, playback.model, playback.region)
        play(playback, viewer)
    finally:
        viewer.close()
        for thread in drawing:  # a program that ends while it still draws crashes
            thread.join(5.0)
