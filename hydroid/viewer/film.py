"""A motion as pictures: the simulated machine, the measured one as its ghost, and the signals beside them."""

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hydroid.errors import RunError, SettingsError
from hydroid.parameters import Array
from hydroid.progress import Progress, no_progress
from hydroid.reporting.outlines import body_poses, shapes, sight
from hydroid.viewer.motion import Motion
from hydroid.viewer.opengl import make_renderer
from hydroid.viewer.panel import SignalPanel

Picture = NDArray[np.uint8]

KINDS = {".mp4": ((1920, 1080), 20.0), ".gif": ((960, 540), 10.0), ".png": ((1920, 1080), 0.0)}
"""width and height of a file's pictures [px], and pictures in a second"""
GHOST = (0.12, 0.44, 0.82, 0.42)
"""colour and opacity of the measured machine"""
AZIMUTH, ELEVATION, FIELD = 125.0, -18.0, 40.0
"""where the camera looks to, and how high its picture is [deg]"""


class Stage:
    """Renders a motion; it is a context.

    Args:
        motion: what moves.
        size: of a whole picture [px].
        panel: whether the signals stand beside the machine.

    Raises:
        RunError: this machine cannot render.
    """

    def __init__(self, motion: Motion, size: tuple[int, int], *, panel: bool = True) -> None:
        width, height = size
        wide = round(0.62 * width) if panel and motion.signals else width
        self._motion, self._model = motion, motion.machine.model
        self._model.vis.global_.fovy = FIELD
        # the map covers what the camera sees, or its border shows as dots on the floor
        self._model.vis.map.shadowclip, self._model.vis.quality.shadowsize = 3.0, 4096
        self._renderer = make_renderer(self._model, wide, height)
        self._data = mujoco.MjData(self._model), mujoco.MjData(self._model)
        self._camera = _camera(motion, wide / height)
        self._panel = SignalPanel(motion, (width - wide, height), height / 1080) if wide < width else None

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def machine(self, time: float) -> Picture:
        """Return the machine at a time [s] as RGB, shape (height, width, 3)."""
        sample, (data, ghost) = self._motion.sample(time), self._data
        place(self._model, data, self._motion.simulated[sample])
        self._renderer.update_scene(data, self._camera)
        if self._motion.measured is not None:
            place(self._model, ghost, self._motion.measured[sample])
            add_ghost(self._model, ghost, self._renderer.scene, (AZIMUTH, ELEVATION))
        return self._renderer.render().copy()

    def picture(self, times: Sequence[float]) -> Picture:
        """Return the machine at one time, or in two columns at several, with the signals beside it."""
        shown = [self.machine(time) for time in times]
        if len(shown) > 1:
            small = [np.asarray(Image.fromarray(one).reduce(2)) for one in shown]
            shown = [np.vstack([np.hstack(small[k : k + 2]) for k in range(0, len(small), 2)])]
        return np.hstack(shown if self._panel is None else [*shown, self._panel.at(times)])


def render_motion(
    motion: Motion, kind: str, span: tuple[float, float], progress: Progress = no_progress
) -> bytes:
    """Render a motion as a film or a strip of moments.

    Args:
        motion: what moves.
        kind: .mp4, .gif or .png.
        span: from when to when [s].
        progress: called with what is done, how much of it, and how much there is.

    Returns:
        The file's content.

    Raises:
        SettingsError: a span without time.
        RunError: this machine cannot render, or cannot write films.
    """
    begin, end = max(span[0], 0.0), min(span[1], float(motion.time[-1]))
    if not begin < end:
        what = f"{span[0]:g}:{span[1]:g} s holds nothing of a motion of {motion.time[-1]:g} s"
        raise SettingsError(what, where="--span", hint="write FROM:TO in seconds")
    size, rate = KINDS[kind]
    with Stage(motion, size) as stage:
        if kind == ".png":
            content = io.BytesIO()
            strip = stage.picture(np.linspace(begin, end, 4).tolist())
            Image.fromarray(strip).save(content, "PNG", optimize=True)
            return content.getvalue()

        def picture(k: int) -> Picture:
            progress("pictures", k, count)
            return stage.picture([begin + k / rate])

        count = int(np.ceil((end - begin) * rate - 1e-9))
        return (_gif if kind == ".gif" else _mp4)(map(picture, range(count)))


def check_kind(file: Path) -> str:
    """Return the ending of a file that `render_motion` writes.

    Raises:
        SettingsError: another one.
    """
    kind = file.suffix.lower()
    if kind not in KINDS:
        raise SettingsError("is no film or picture", where=str(file), hint=f"end it in {', '.join(KINDS)}")
    return kind


def add_ghost(
    model: mujoco.MjModel, data: mujoco.MjData, scene: mujoco.MjvScene, view: tuple[float, float]
) -> None:
    """Add what moves of a machine to a scene, translucent.

    It stands 4 mm farther away in a view of these angles [deg]: where both machines agree only the
    simulated one is seen, and their surfaces do not flicker.
    """
    first, seen = scene.ngeom, (mujoco.MjvOption(), mujoco.MjvPerturb())
    mujoco.mjv_addGeoms(model, data, *seen, mujoco.mjtCatBit.mjCAT_DYNAMIC, scene)
    for geom in scene.geoms[first : scene.ngeom]:
        geom.rgba[:], geom.matid, geom.transparent = GHOST, -1, 1
        geom.pos[:] += 0.004 * sight(*view)[2]


def place(model: mujoco.MjModel, data: mujoco.MjData, angle: Array) -> None:
    """Bring all that is drawn of a machine to joint angles [rad], shape (nq,)."""
    data.qpos[:] = angle
    for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_tendon):
        update(model, data)


def _camera(motion: Motion, aspect: float) -> mujoco.MjvCamera:
    """Return a camera that has the machine and its ghost in its picture all the time."""
    every = max(1, len(motion.time) // 40)
    moves = [angle[::every] for angle in (motion.simulated, motion.measured) if angle is not None]
    poses, axes = body_poses(motion.machine.model, np.vstack(moves)), sight(AZIMUTH, ELEVATION)
    corners = [shape.placed(poses).reshape(-1, 3) for shape in shapes(motion.machine.model)]
    seen = np.concatenate(corners) @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    slope = np.tan(0.5 * np.radians(FIELD)) * np.array([aspect, 1.0])
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.lookat[:] = AZIMUTH, ELEVATION, middle @ axes
    across, ahead = np.abs(seen - middle)[:, :2], (seen - middle)[:, 2:]
    camera.distance = 1.1 * float((across / slope - ahead).max())  # with some room around it
    return camera


def _gif(pictures: Iterable[Picture]) -> bytes:
    first, *rest = (Image.fromarray(one).quantize(96, dither=Image.Dither.NONE) for one in pictures)
    content, pause = io.BytesIO(), round(1e3 / KINDS[".gif"][1])  # [ms]
    first.save(content, "GIF", save_all=True, append_images=rest, duration=pause, loop=0, optimize=True)
    return content.getvalue()


def _mp4(pictures: Iterable[Picture]) -> bytes:
    try:
        import av
    except ImportError:
        hint = "pip install 'hydroid[film]', or write a .gif"
        raise RunError("an mp4 needs the package av", hint=hint) from None
    content, ((width, height), rate) = io.BytesIO(), KINDS[".mp4"]
    with av.open(content, "w", format="mp4") as file:
        stream: Any = file.add_stream("libx264", rate=round(rate))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"crf": "20", "preset": "fast"}
        for picture in pictures:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())
    return content.getvalue()
